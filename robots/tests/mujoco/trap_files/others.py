"""Couplings, actuators, tendons, options, contacts and whole sections."""

from .robots import BOX, HINGE, ROD, arm, defaults, file, free


# Couplings.
def coupled(name, rule, before="", compiler='angle="radian"', refs=("", "")):
    first, second = (f'ref="{ref}"' if ref else "" for ref in refs)
    file(
        name,
        arm(
            f'<joint name="one" axis="0 1 0" {first}/>' + ROD,
            f'<joint name="two" axis="1 0 0" {second}/><geom type="box" size=".1 .05 .2"/>',
        ),
        before,
        f"  <equality>\n    {rule}\n  </equality>\n",
        compiler,
    )


coupled("equality_joint", '<joint joint1="two" joint2="one" polycoef=".1 -2 0 0 0"/>')
coupled("equality_references", '<joint joint1="two" joint2="one" polycoef=".1 -2 0 0 0"/>', refs=(".2", ".5"))
coupled("equality_default_polynomial", '<joint joint1="two" joint2="one"/>', refs=(".2", ".5"))
coupled("equality_short_polynomial", '<joint joint1="two" joint2="one" polycoef=".1"/>')
coupled("equality_polynomial_of_two", '<joint joint1="two" joint2="one" polycoef=".1 3"/>')
coupled("equality_quadratic", '<joint joint1="two" joint2="one" polycoef="0 1 .2 0 0"/>')
coupled("equality_inactive", '<joint joint1="two" joint2="one" active="false"/>')
coupled("equality_class_inactive", '<joint joint1="two" joint2="one"/>', defaults('<equality active="false"/>'))
coupled(
    "equality_class_inactive_own_active",
    '<joint joint1="two" joint2="one" active="true"/>',
    defaults('<equality active="false"/>'),
)
coupled(
    "equality_own_class_inactive",
    '<joint class="off" joint1="two" joint2="one"/>',
    defaults('<default class="off"><equality active="false"/></default>'),
)
coupled("equality_flag_off", '<joint joint1="two" joint2="one"/>', '  <option><flag equality="disable"/></option>\n')
coupled("equality_single", '<joint joint1="two" polycoef=".3 0 0 0 0"/>')
coupled("equality_weld", '<weld body1="lower"/>')
coupled("equality_connect", '<connect body1="lower" anchor="0 0 0"/>')
coupled("equality_connect_inactive", '<connect body1="lower" anchor="0 0 0" active="false"/>')
coupled("equality_solver", '<joint name="e" joint1="two" joint2="one" solref=".01 1" solimp=".9 .95 .001"/>')
coupled("equality_unknown_joint", '<joint joint1="two" joint2="oen"/>')
coupled("equality_degrees", '<joint joint1="two" joint2="one" polycoef=".1 2 0 0 0"/>', compiler="", refs=("20", "30"))


# Actuators and tendons.
def driven(name, actuator, before="", after="", world=None):
    file(name, world or arm(), before, f"{after}  <actuator>\n    {actuator}\n  </actuator>\n")


driven("actuator_plain", '<motor joint="one" gear="3"/>')
driven("actuator_armature", '<motor joint="one" armature=".01" gear="5"/>')
driven(
    "actuator_armature_twice",
    '<motor joint="one" armature=".01" gear="5"/>\n    <position joint="one" armature=".1" kp="3"/>',
)
driven(
    "actuator_armature_class",
    '<motor joint="one"/>\n    <motor class="big" joint="two"/>',
    defaults('<motor armature=".1" gear="2"/><default class="big"><general gear="3"/></default>'),
)
driven(
    "actuator_armature_childclass",
    '<motor joint="one"/>',
    defaults('<default class="c"><motor armature=".1"/></default>'),
    world=arm(upper_body='childclass="c"'),
)
driven("actuator_armature_zero", '<motor joint="one" armature="0.0"/>')
driven("actuator_jointinparent", '<motor jointinparent="one" armature=".01" gear="5"/>')
driven("actuator_damping", '<motor joint="one" damping=".1" gear="5"/>')
driven("actuator_damping_polynomial", '<motor joint="one" damping=".1 .1"/>')
driven("actuator_kv", '<velocity joint="one" kv="3"/>')
driven("actuator_forcerange", '<motor joint="one" forcerange="-3 3"/>')
driven("actuator_dcmotor", '<dcmotor joint="one" motorconst="1" resistance="1" armature=".02"/>')
TENDON = (
    '  <tendon>\n    <fixed name="t" %s><joint joint="one" coef="1"/><joint joint="two" coef="2"/></fixed>\n'
    "  </tendon>\n"
)
driven("actuator_tendon_armature", '<motor tendon="t" armature=".01"/>', after=TENDON % "")
driven("actuator_tendon", '<motor tendon="t" gear="2"/>', after=TENDON % "")
driven(
    "actuator_site_armature",
    '<motor site="s" armature=".01"/>',
    world=arm(lower=HINGE.replace("one", "two") + '<geom size=".1"/><site name="s"/>'),
)
driven(
    "actuator_free_armature",
    '<motor joint="root" armature=".1" gear="1 0 0 0 0 0"/>',
    world=free(BOX, joint='<freejoint name="root"/>'),
)
driven("actuator_adhesion", '<adhesion body="lower" ctrlrange="0 1" gain="2"/>')
driven("actuator_unknown_attribute", '<motor joint="one" amrature=".1"/>')
driven("actuator_unknown_joint", '<motor joint="oen" armature=".1"/>')
file("tendon_plain", arm(), after=TENDON % 'group="2"')
file("tendon_armature", arm(), after=TENDON % 'armature=".2"')
file("tendon_class_armature", arm(), defaults('<tendon armature=".2"/>'), after=TENDON % "")
file("tendon_armature_zero", arm(), after=TENDON % 'armature="0.0"')
file("tendon_damping", arm(), after=TENDON % 'damping=".3"')
file("tendon_stiffness", arm(), after=TENDON % 'stiffness="3"')
file("tendon_range", arm(), after=TENDON % 'range="-1 1"')
file("tendon_friction", arm(), after=TENDON % 'frictionloss=".2"')
file("tendon_unknown_attribute", arm(), after=TENDON % 'amrature=".2"')

# Options, contacts and the rest.
file("option_gravity", arm(), '  <option gravity="0 0 -1.62" timestep=".001" integrator="RK4"/>\n')
file("option_gravity_usual", arm(), '  <option gravity="0 0 -9.81"/>\n')
file("option_fluid", arm(), '  <option density="1.2" viscosity="2e-5" wind="1 0 0"/>\n')
file(
    "option_solver",
    arm(),
    '  <option timestep=".005" cone="elliptic" impratio="10" iterations="3" solver="CG" jacobian="dense" '
    'tolerance="1e-6"/>\n',
)
for flag in ("limit", "damper", "frictionloss", "gravity", "constraint", "spring", "contact", "warmstart"):
    file(
        f"option_flag_{flag}",
        arm('<joint name="one" range="-1 1" damping=".2" frictionloss=".1"/>' + ROD),
        f'  <option><flag {flag}="disable"/></option>\n',
    )
file("option_flag_energy", arm(), '  <option><flag energy="enable" limit="enable"/></option>\n')
file("option_unknown", arm(), '  <option gravitty="0 0 -1"/>\n')
file("contact_exclude", arm(), after='  <contact><exclude name="e" body1="upper" body2="lower"/></contact>\n')
file(
    "contact_pair",
    arm(HINGE + '<geom name="g" size=".1"/>', HINGE.replace("one", "two") + '<geom name="h" size=".1"/>'),
    after='  <contact><pair geom1="g" geom2="h"/></contact>\n',
)
file(
    "contact_masks", '    <geom type="plane" size="1 1 1"/>\n' + arm(), defaults('<geom contype="0" conaffinity="1"/>')
)
file(
    "sections_skipped",
    arm(),
    '  <size nuserdata="3"/>\n  <statistic extent="2"/>\n  <visual><map znear=".1"/></visual>\n'
    '  <custom><numeric name="n" data="1"/></custom>\n',
    '  <sensor><jointpos joint="one"/></sensor>\n  <keyframe><key qpos="0 0"/></keyframe>\n',
)
file("section_extension", arm(), "  <extension/>\n")
file("section_deformable", arm(), "  <deformable/>\n")
file("include_root", arm(), '  <include file="x.xml"/>\n')
file("include_in_asset", arm(), '  <asset><include file="x.xml"/></asset>\n')
file("include_in_actuator", arm(), after='  <actuator><include file="x.xml"/></actuator>\n')
file(
    "worldbody_twice",
    arm(),
    after='  <worldbody>\n    <body name="post" pos="1 0 0"><geom size=".1"/></body>\n  </worldbody>\n',
)
file("number_malformed", arm('<joint name="one" axis="0 1 zero"/>' + ROD))
file("number_infinite", arm('<joint name="one" armature="inf"/>' + ROD))
file("number_missing", arm('<joint name="one" axis="0 1"/>' + ROD))
file("xml_broken", "    <body></bdy>\n")
