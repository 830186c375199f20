"""Joints and free joints."""

from .robots import BOX, ROD, arm, defaults, file, free

# Joints.
file("joint_degrees", arm('<joint name="one" axis="0 1 0" range="-30 60" ref="20"/>' + ROD), compiler="")
file(
    "joint_degrees_slide",
    arm('<joint name="one" type="slide" axis="0 1 0" range="-30 60" ref="20"/>' + ROD),
    compiler="",
)
file("joint_radians", arm('<joint name="one" axis="0 1 0" range="-.3 .6" ref=".2"/>' + ROD))
file("joint_ref_below_anchor", arm('<joint name="one" axis="0 1 1" pos=".1 .2 .3" ref=".7" range="-1 1"/>' + ROD))
file("joint_range_zero", arm('<joint name="one" range="0 0"/>' + ROD))
file("joint_range_zero_limited", arm('<joint name="one" range="0 0" limited="true"/>' + ROD))
file("joint_range_equal", arm('<joint name="one" range=".5 .5"/>' + ROD))
file("joint_range_reversed", arm('<joint name="one" range="1 -1"/>' + ROD))
file("joint_range_unlimited", arm('<joint name="one" range="-1 1" limited="false"/>' + ROD))
file(
    "joint_range_without_autolimits",
    arm('<joint name="one" range="-1 1"/>' + ROD),
    compiler='angle="radian" autolimits="false"',
)
file(
    "joint_limited_without_autolimits",
    arm('<joint name="one" range="-1 1" limited="true"/>' + ROD),
    compiler='angle="radian" autolimits="false"',
)
file("joint_limited_without_range", arm('<joint name="one" limited="true"/>' + ROD))
file("joint_class_range", arm('<joint name="one" limited="false"/>' + ROD), defaults('<joint range="-1 2"/>'))
file("joint_class_limited_false", arm('<joint name="one" range="-1 2"/>' + ROD), defaults('<joint limited="false"/>'))
file("joint_effort", arm('<joint name="one" actuatorfrcrange="-20 20"/>' + ROD))
file("joint_effort_zero", arm('<joint name="one" actuatorfrcrange="0 0"/>' + ROD))
file("joint_effort_unlimited", arm('<joint name="one" actuatorfrcrange="-20 20" actuatorfrclimited="false"/>' + ROD))
file("joint_effort_one_sided", arm('<joint name="one" actuatorfrcrange="-5 20"/>' + ROD))
file("joint_effort_limited_without_range", arm('<joint name="one" actuatorfrclimited="true"/>' + ROD))
file("joint_damping_friction_armature", arm('<joint name="one" damping=".5" frictionloss=".2" armature=".3"/>' + ROD))
file("joint_damping_of_three", arm('<joint name="one" damping=".5 0 0"/>' + ROD))
file("joint_damping_polynomial", arm('<joint name="one" damping=".5 .1 0"/>' + ROD))
file("joint_stiffness", arm('<joint name="one" stiffness="3" springref=".2"/>' + ROD))
file("joint_stiffness_polynomial", arm('<joint name="one" stiffness="3 0 1"/>' + ROD))
file("joint_stiffness_zero", arm('<joint name="one" stiffness="0.0" springref=".2"/>' + ROD))
file("joint_springyield", arm('<joint name="one" stiffness="3" springyield=".2"/>' + ROD))
file("joint_springdamper", arm('<joint name="one" axis="0 1 0" springdamper=".5 1" armature=".1"/>' + ROD))
file("joint_springdamper_class", arm(), defaults('<joint springdamper=".2 .7" damping="9"/>'))
file("joint_springdamper_zero", arm('<joint name="one" springdamper="0 0" damping=".4"/>' + ROD))
file("joint_springdamper_half", arm('<joint name="one" springdamper=".5 0" damping=".4"/>' + ROD))
file("joint_springdamper_free", free(BOX + '<joint name="x" type="hinge"/>', joint=""))
file(
    "joint_springdamper_floating",
    free(BOX, joint='<freejoint name="root"/>').replace('name="hip"', 'name="hip" springdamper=".3 1"'),
)
file(
    "joint_springdamper_ref",
    arm(
        '<joint name="one" axis="0 1 0" pos=".1 0 .1" springdamper=".5 1" ref=".4"/>' + ROD,
        '<joint name="two" axis="0 1 0" ref="-.6"/><geom type="box" size=".1 .05 .2"/>',
    ),
)
file(
    "joint_springdamper_total_mass",
    arm('<joint name="one" axis="0 1 0" springdamper=".5 1"/>' + ROD),
    compiler='angle="radian" settotalmass="3"',
)
file("joint_ball", arm('<joint name="one" type="ball"/>' + ROD))
file("joint_unnormalised_axis", arm('<joint name="one" axis="0 3 4"/>' + ROD))
file("joint_axis_missing", arm('<joint name="one" axis="0 0 0"/>' + ROD))
file(
    "joint_axis_near_minus_z",
    arm(
        '<joint name="one" axis="0 1.22465e-16 -1"/>' + ROD,
        '<joint name="two" axis="1e-9 0 -1"/><geom type="box" size=".1 .05 .2"/>',
    ),
)
file(
    "joint_axis_of_class",
    arm('<joint name="one"/>' + ROD, '<joint name="two" axis="1 1 0"/><geom type="box" size=".1 .05 .2"/>'),
    defaults('<joint axis="0 1 0" pos=".1 0 0"/>'),
)
file(
    "joint_several_with_anchors",
    arm(
        '<joint name="a" type="slide" axis="1 0 0" pos=".3 0 0"/><joint name="one" axis="0 1 0" pos="0 .1 .2"/>'
        '<joint name="c" axis="1 0 0" pos=".2 0 -.1" ref=".3"/>' + ROD,
        "<geom size='.1'/>",
    ),
)
file("joint_type_of_class", arm('<joint name="one"/>' + ROD), defaults('<joint type="slide" axis="1 0 1"/>'))
file("joint_in_frame", arm('<frame euler="0 .5 0"><joint name="one" axis="0 1 0"/></frame>' + ROD))
file(
    "joint_margin_and_solver",
    arm(
        '<joint name="one" range="-1 1" margin=".1" solreflimit=".01 1" solimplimit=".9 .95 .001" '
        'solreffriction=".01 1" solimpfriction=".9 .9 .01" group="2"/>' + ROD
    ),
)
file("joint_negative_armature_class", arm(), defaults('<joint armature=".25" damping=".1" frictionloss=".05"/>'))
file("joint_actuatorgravcomp", arm('<joint name="one" actuatorgravcomp="true"/>' + ROD))

# Free joints.
file("free_plain", free(BOX, joint='<freejoint name="root"/>'))
file(
    "free_unnamed_static",
    '    <geom type="plane" size="1 1 1"/>\n    <body name="table" pos="1 0 0">'
    + BOX
    + "</body>\n"
    + free(BOX, joint='<freejoint name="root"/>'),
)
file(
    "free_in_frame",
    '    <frame pos="1 2 3" euler=".1 .2 .3">\n' + free(BOX, joint='<freejoint name="root"/>') + "    </frame>\n",
)
file(
    "free_class_armature_not_inherited",
    free(BOX, joint='<freejoint name="root"/>'),
    defaults('<joint armature=".3" damping=".2"/>'),
)
file(
    "free_type_class_armature", free(BOX, joint='<joint name="root" type="free"/>'), defaults('<joint armature=".3"/>')
)
file("free_type_armature", free(BOX, joint='<joint name="root" type="free" armature=".3"/>'))
file("free_type_armature_zero", free(BOX, joint='<joint name="root" type="free" armature="0.00" damping="0"/>'))
file("free_type_damping", free(BOX, joint='<joint name="root" type="free" damping=".3"/>'))
file("free_type_friction", free(BOX, joint='<joint name="root" type="free" frictionloss=".3"/>'))
file("free_type_stiffness", free(BOX, joint='<joint name="root" type="free" stiffness=".3"/>'))
file(
    "free_type_class_range_axis_pos",
    free(BOX, joint='<joint name="root" type="free"/>'),
    defaults('<joint range="-1 1" axis="1 0 0" pos="0 .1 0" ref=".2"/>'),
)
file("free_type_springdamper", free(BOX, joint='<joint name="root" type="free" springdamper=".5 1"/>'))
file("free_align", free(BOX, joint='<freejoint name="root" align="true"/>', child=False))
file("free_align_with_child", free(BOX, joint='<freejoint name="root" align="true"/>'))
file(
    "free_align_false",
    free(BOX, joint='<freejoint name="root" align="false"/>', child=False),
    compiler='angle="radian" alignfree="true"',
)
file(
    "free_alignfree",
    free(BOX, joint='<freejoint name="root"/>', child=False),
    compiler='angle="radian" alignfree="true"',
)
file(
    "free_alignfree_joint_class",
    free(BOX, joint='<joint name="root" type="free"/>', child=False),
    compiler='angle="radian" alignfree="true"',
)
file(
    "free_alignfree_with_child", free(BOX, joint='<freejoint name="root"/>'), compiler='angle="radian" alignfree="true"'
)
file(
    "free_two",
    free(BOX, joint='<freejoint name="root"/>', child=False) + '    <body><freejoint/><geom size=".1"/></body>\n',
)
