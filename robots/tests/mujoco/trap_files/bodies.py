"""Bodies, frames and sites."""

from .robots import HINGE, arm, defaults, file

file("body_static_chain", '    <body name="pillar" pos="0 0 1" euler="0 .3 0">\n' + arm() + "    </body>\n")
file(
    "body_welded",
    arm(
        lower=HINGE.replace("one", "two")
        + '<geom size=".1"/><body name="tool" pos="0 0 .3" euler="0 .2 0"><geom type="box" size=".1 .1 .2"/></body>'
    ),
)
file("body_gravcomp_zero", arm(upper_body='gravcomp="0.0" pos="0 0 1"'))
file("body_gravcomp", arm(upper_body='gravcomp="1" pos="0 0 1"'))
file("body_mocap", '    <body name="target" mocap="true" pos="1 0 0"><geom size=".1"/></body>\n' + arm())
file("body_mocap_false", arm(upper_body='mocap="false" pos="0 0 1"'))
file("body_harmless", arm(upper_body='sleep="never" simple="false" fuse="false" pos="0 0 1"'))
file("body_class", arm(upper_body='class="main"'))
file(
    "frame_nested",
    arm(
        lower=HINGE.replace("one", "two")
        + '<frame pos="0 .1 0" euler=".3 0 0"><frame pos=".1 0 0"><geom type="box" size=".1 .2 .3"/><site name="s"/>'
        '<body name="inner" pos="0 0 .2"><joint name="three" axis="0 0 1"/><geom size=".1" pos=".1 0 0"/></body>'
        + "</frame></frame>"
    ),
)
file("frame_free_of_class", arm(lower=HINGE.replace("one", "two") + '<frame class="main"><geom size=".1"/></frame>'))
file(
    "site_poses",
    arm(
        lower=HINGE.replace("one", "two")
        + '<geom size=".1"/><site name="a" pos=".1 0 0" euler=".1 .2 .3"/><site name="b" quat="1 1 0 0"/>'
    ),
)
file(
    "site_class",
    arm(
        lower=HINGE.replace("one", "two")
        + '<geom size=".1"/><site name="a"/><site name="b" pos="0 .1 0"/><site name="c" quat="1 1 0 0"/>'
    ),
    defaults('<site pos=".1 .2 .3" euler=".1 .2 .3"/>'),
)
file(
    "site_childclass",
    arm(
        lower_body='pos=".1 0 .4" childclass="c"',
        lower=HINGE.replace("one", "two") + '<geom size=".1"/><site name="a"/>',
    ),
    defaults('<default class="c"><site pos=".1 .2 .3"/></default>'),
)
file(
    "site_fromto",
    arm(
        lower=HINGE.replace("one", "two")
        + '<geom size=".1"/><site name="a" type="capsule" size=".01" fromto="0 0 0 .1 .2 .3"/>'
    ),
)
file(
    "site_class_fromto",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/><site name="a" type="capsule" size=".01"/>'),
    defaults('<site fromto="0 0 0 .1 .2 .3"/>'),
)
file(
    "site_mesh",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/><site name="a" type="mesh" mesh="tetra" pos=".1 0 0"/>'),
    '  <asset><mesh file="tetra.obj"/></asset>\n',
)
file(
    "site_looks",
    arm(
        lower=HINGE.replace("one", "two")
        + '<geom size=".1"/><site name="a" type="box" size=".1 .1 .1" rgba="1 0 0 1" group="4"/>'
    ),
)
file(
    "site_named_like_a_body",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/><site name="lower" pos=".1 0 0"/>'),
)
file(
    "replicate",
    arm(
        lower=HINGE.replace("one", "two")
        + '<geom size=".1"/><replicate count="2" offset=".1 0 0"><geom size=".1"/></replicate>'
    ),
)
file("attach", arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/><attach model="m" body="b" prefix="p"/>'))
file("composite", arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/><flexcomp name="f" type="grid" dim="1"/>'))
