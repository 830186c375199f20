"""Geoms and inertia."""

from .robots import BOX, HINGE, arm, defaults, file

for label, text in {
    "sphere": 'size=".1"',
    "capsule": 'type="capsule" size=".1 .2"',
    "cylinder": 'type="cylinder" size=".1 .2"',
    "box": 'type="box" size=".1 .2 .3"',
    "capsule_fromto": 'type="capsule" size=".1" fromto="0 0 0 .1 .2 .3"',
    "cylinder_fromto": 'type="cylinder" size=".1" fromto=".1 .2 .3 0 0 -.1"',
    "box_fromto": 'type="box" size=".1" fromto="0 0 0 .1 .2 .3"',
    "ellipsoid": 'type="ellipsoid" size=".1 .2 .3"',
    "mass": 'size=".1" mass="2"',
    "density": 'size=".1" density="2"',
    "mass_zero": 'size=".1" mass="0"/><geom size=".2"',
    "density_zero": 'size=".1" density="0"/><geom size=".2"',
    "visual": 'size=".1" contype="0" conaffinity="0"',
    "shell": 'size=".1" shellinertia="true"',
    "shell_false": 'size=".1" shellinertia="false"',
    "shell_massless": 'size=".1" shellinertia="true" mass="0"/><geom size=".1"',
    "group_six": 'size=".1" group="6"/><geom size=".1" pos="0 0 .2"',
    "size_too_long": 'size=".1 .2 .3"',
    "size_of_four": 'size=".1 .2 .3 .4"',
    "negative_mass": 'size=".1" mass="-1"',
    "fluid": 'size=".1" fluidshape="ellipsoid"',
    "contact": 'size=".1" friction=".5" condim="6" solref=".01 1" solimp=".9 .95 .001" margin=".01" '
    'gap=".01" priority="1" solmix="2"',
    "adhesion": 'size=".1" adhesion="3"',
    "surfacevel": 'size=".1" surfacevel="1 0 0 0 0 0"',
    "looks": 'size=".1" rgba="1 0 0 1" castshadow="false" group="3"',
    "hfield": 'type="hfield" hfield="h"',
    "plane": 'type="plane" size="1 1 1"',
    "fromto_and_pos": 'type="capsule" size=".1" pos=".1 0 0" fromto="0 0 0 .1 .2 .3"',
}.items():
    file(
        f"geom_{label}",
        arm(lower=HINGE.replace("one", "two") + f"<geom {text}/>"),
        '  <asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>\n' if label == "hfield" else "",
    )
file("geom_class_shell", arm(), defaults('<geom shellinertia="true"/>'))
file(
    "geom_class_shell_own_false",
    arm(
        HINGE + '<geom size=".1" shellinertia="false"/>',
        HINGE.replace("one", "two") + '<geom size=".1" shellinertia="false"/>',
    ),
    defaults('<geom shellinertia="true"/>'),
)
file(
    "geom_class_mass_own_density",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1" density="50"/>'),
    defaults('<geom mass="2"/>'),
)
file(
    "geom_class_fromto_own_pos",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1" pos=".1 0 0" euler="1 0 0"/>'),
    defaults('<default class="x"/><geom type="capsule" size=".05" fromto="0 0 0 .1 .2 .3"/>'),
)
file(
    "geom_class_fromto_own_quat",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1" euler="1 0 0"/>'),
    defaults('<geom type="capsule" size=".05" fromto="0 0 0 .1 .2 .3"/>'),
)
file(
    "geom_class_size",
    arm(lower=HINGE.replace("one", "two") + '<geom type="box"/>'),
    defaults('<geom size=".1 .2 .3"/>'),
)
file(
    "geom_class_size_partly_own",
    arm(lower=HINGE.replace("one", "two") + '<geom type="box" size=".05"/>'),
    defaults('<geom size=".1 .2 .3"/>'),
)
file(
    "geom_mesh_massless",
    arm(lower=HINGE.replace("one", "two") + '<geom type="mesh" mesh="tetra" mass="0"/><geom size=".1"/>'),
    '  <asset><mesh file="tetra.obj"/></asset>\n',
)
file(
    "geom_mesh_visual_class",
    arm(lower=HINGE.replace("one", "two") + '<geom class="v" mesh="tetra"/><geom size=".1"/>'),
    defaults('<default class="v"><geom type="mesh" contype="0" conaffinity="0" density="0"/></default>')
    + '  <asset><mesh file="tetra.obj"/></asset>\n',
)
file(
    "geom_mesh_with_inertial",
    arm(
        lower=HINGE.replace("one", "two")
        + '<inertial pos="0 0 .1" mass="1" diaginertia=".1 .1 .1"/><geom type="mesh" mesh="m"/>'
    ),
    '  <asset><mesh name="m" file="tetra.obj" scale="1 2 1" inertia="shell"/></asset>\n',
)
file(
    "geom_mesh_inertia",
    arm(lower=HINGE.replace("one", "two") + '<geom type="mesh" mesh="tetra"/>'),
    '  <asset><mesh file="tetra.obj"/></asset>\n',
)
file(
    "geom_mesh_refpos",
    arm(lower=HINGE.replace("one", "two") + '<geom type="mesh" mesh="tetra" mass="0"/><geom size=".1"/>'),
    '  <asset><mesh file="tetra.obj" refpos="0 0 1"/></asset>\n',
)
file(
    "geom_mesh_vertices",
    arm(lower=HINGE.replace("one", "two") + '<geom type="mesh" mesh="m" mass="0"/><geom size=".1"/>'),
    '  <asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>\n',
)
file(
    "geom_mesh_builtin",
    arm(lower=HINGE.replace("one", "two") + '<geom type="mesh" mesh="m" mass="0"/><geom size=".1"/>'),
    '  <asset><mesh name="m" builtin="sphere" params="1"/></asset>\n',
)
file(
    "geom_fitted_to_mesh",
    arm(lower=HINGE.replace("one", "two") + '<geom type="box" mesh="tetra"/>'),
    '  <asset><mesh file="tetra.obj"/></asset>\n',
)
file("inertial_diagonal", arm(HINGE + '<inertial pos=".1 0 0" mass="2" diaginertia=".1 .2 .25" euler=".3 0 .2"/>'))
file("inertial_full", arm(HINGE + '<inertial pos=".1 0 0" mass="2" fullinertia=".1 .2 .25 .01 -.02 .03"/>'))
file(
    "inertial_full_and_quat",
    arm(HINGE + '<inertial pos=".1 0 0" mass="2" quat=".7 .1 .3 -.2" fullinertia=".1 .2 .25 .01 -.02 .03"/>'),
)
file(
    "inertial_full_and_euler",
    arm(HINGE + '<inertial pos=".1 0 0" mass="2" euler=".7 .1 .3" fullinertia=".1 .2 .25 .01 -.02 .03"/>'),
)
file(
    "inertial_full_and_diagonal",
    arm(HINGE + '<inertial pos=".1 0 0" mass="2" diaginertia=".1 .1 .1" fullinertia=".1 .2 .25 .01 -.02 .03"/>'),
)
file("inertial_without_pos", arm(HINGE + '<inertial mass="2" diaginertia=".1 .2 .25"/>'))
file("inertial_without_inertia", arm(HINGE + '<inertial pos="0 0 .2" mass="2"/>'))
file("inertial_and_geoms", arm(HINGE + '<inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .1"/>' + BOX))
file(
    "inertial_twice",
    arm(
        HINGE
        + '<inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .1"/>'
        + '<inertial pos="0 .1 .2" mass="1" diaginertia=".1 .1 .1"/>'
    ),
)
file(
    "inertial_in_frame",
    arm(HINGE + '<frame pos="0 0 1"><inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .1"/></frame>'),
)
for value in ("true", "false", "auto"):
    file(
        f"inertiafromgeom_{value}",
        arm(
            HINGE + '<inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .1"/>' + BOX,
            HINGE.replace("one", "two") + '<inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .1"/>',
        ),
        compiler=f'angle="radian" inertiafromgeom="{value}"',
    )
file(
    "inertiafromgeom_true_zero_mass",
    arm(HINGE + '<inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .1"/><geom size=".1" mass="0"/>'),
    compiler='angle="radian" inertiafromgeom="true"',
)
file(
    "inertiagrouprange",
    arm(
        HINGE + '<geom size=".1" group="2"/><geom size=".1" group="3" pos=".2 0 0"/>',
        HINGE.replace("one", "two") + '<geom size=".1" group="2"/>',
    ),
    compiler='angle="radian" inertiagrouprange="2 2"',
)
file(
    "inertiagrouprange_class_group",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/><geom size=".2" group="1"/>'),
    defaults('<geom group="1"/><default class="x"/>'),
    compiler='angle="radian" inertiagrouprange="1 1"',
)
file("total_mass", arm(), compiler='angle="radian" settotalmass="3"')
file(
    "total_mass_with_static_body",
    '    <body name="table">' + BOX + "</body>\n" + arm(),
    compiler='angle="radian" settotalmass="30"',
)
file("total_mass_negative", arm(), compiler='angle="radian" settotalmass="-1"')
file("boundmass", arm(), compiler='angle="radian" boundmass="50"')
file("boundinertia", arm(), compiler='angle="radian" boundinertia="5"')
file("boundmass_zero", arm(), compiler='angle="radian" boundmass="0.0" boundinertia="0"')
file(
    "balanceinertia",
    arm(HINGE + '<inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .5"/>'),
    compiler='angle="radian" balanceinertia="true"',
)
file("inertia_triangle", arm(HINGE + '<inertial pos="0 0 .2" mass="2" diaginertia=".1 .1 .5"/>'))
file(
    "compiler_harmless",
    arm(),
    compiler='angle="radian" fusestatic="true" discardvisual="true" usethread="false" '
    'fitaabb="true" saveinertial="true"',
)
file("compiler_global", arm(), compiler='coordinate="global"')
file("compiler_unknown", arm(), compiler='angel="radian"')
file(
    "compiler_lengthrange", arm(), before='  <compiler angle="radian">\n    <lengthrange mode="none"/>\n  </compiler>\n'
)
