"""Orientations and default classes."""

from .robots import HINGE, arm, defaults, file

POSES = {
    "quat": 'quat=".7 .1 -.3 .5"',
    "axisangle": 'axisangle="1 2 3 .7"',
    "xyaxes": 'xyaxes="1 .2 0 0 1 .3"',
    "zaxis": 'zaxis=".1 -.2 -1"',
    "euler": 'euler=".3 -.4 .5"',
}
for way, text in POSES.items():
    file(
        f"orientation_{way}",
        arm(upper_body=text, lower=f'{HINGE.replace("one", "two")}<geom type="box" size=".1 .05 .2" {text}/>'),
    )
file("orientation_zaxis_minus_z", arm(upper_body='zaxis="0 0 -1"', lower_body='zaxis="1e-12 0 -2"'))
file("orientation_zaxis_near_minus_z", arm(upper_body='zaxis="1e-9 2e-9 -1"', lower_body='zaxis="1e-5 1e-7 -1"'))
file("orientation_zaxis_near_z", arm(upper_body='zaxis="5e-8 2e-8 1"', lower_body='zaxis="3e-7 1e-7 1"'))
file("orientation_degrees", arm(upper_body='euler="30 -40 50"', lower_body='axisangle="1 2 3 40"'), compiler="")
for sequence in ("zyx", "XYZ", "xZx", "ZYx"):
    file(
        f"orientation_eulerseq_{sequence.lower()}_{sum(c.isupper() for c in sequence)}",
        arm(upper_body=POSES["euler"]),
        compiler=f'angle="radian" eulerseq="{sequence}"',
    )
file("orientation_two_ways", arm(upper_body=POSES["quat"] + " " + POSES["euler"]))
for first in ("quat", "euler", "axisangle"):
    for second in ("quat", "euler", "zaxis"):
        if first != second:
            file(
                f"class_{first}_then_{second}",
                arm(lower=f'{HINGE.replace("one", "two")}<geom type="box" size=".1 .05 .2" {POSES[second]}/>'),
                defaults(f"<geom {POSES[first]} pos='.1 0 0'/>"),
            )
            file(
                f"class_{first}_child_class_{second}",
                arm(lower=f'{HINGE.replace("one", "two")}<geom class="c" type="box" size=".1 .05 .2"/>'),
                defaults(f'<geom {POSES[first]}/><default class="c"><geom {POSES[second]}/></default>'),
            )
file(
    "class_childclass",
    arm(
        upper_body='pos="0 0 1" childclass="c"',
        lower=HINGE.replace("one", "two") + '<geom size=".1"/><geom class="main" size=".1" pos=".3 0 0"/>',
    ),
    defaults('<geom density="500"/><default class="c"><geom density="2000"/><joint armature=".2"/></default>'),
)
file(
    "class_childclass_of_frame",
    arm(
        lower=HINGE.replace("one", "two")
        + '<frame childclass="c" pos=".1 0 0"><geom size=".1"/></frame><geom size=".1"/>'
    ),
    defaults('<geom density="500"/><default class="c"><geom density="2000"/></default>'),
)
file(
    "class_after_children",
    arm(lower=HINGE.replace("one", "two") + '<geom class="c" size=".1"/>'),
    defaults('<default class="c"><geom pos=".1 0 0"/></default><geom density="700"/>'),
)
file("class_sections_merge", arm(), defaults('<geom density="700"/>') + defaults('<joint armature=".2"/>'))
file(
    "class_compiler_after",
    arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/>'),
    defaults('<geom pos=".1 0 0" euler="30 0 0"/>'),
    after='  <compiler angle="radian"/>\n',
    compiler="",
)
file("class_renamed_root", arm(), '  <default class="robot">\n    <geom density="700"/>\n  </default>\n')
file(
    "class_repeated",
    arm(),
    defaults('<default class="c"><geom density="1"/></default><default class="c"><geom density="2"/></default>'),
)
file("class_unknown", arm(HINGE + '<geom class="x" size=".1"/>'))
file("class_unknown_attribute", arm(), defaults('<geom densty="700"/>'))
file("class_include", arm(), defaults('<include file="x.xml"/>'))
file(
    "class_of_material_and_camera",
    arm(),
    defaults('<material specular="1"/><camera fovy="30"/><light castshadow="false"/><pair condim="3"/>'),
)
