"""Arms with published parameters."""

from math import pi, radians

import matrices as m
from bodies import ALONG_X, ALONG_Y, Robot, box, cylinder, diagonal
from machines import ur5e as ur5e_shells
from profile import Profile


def iiwa14():
    robot = Robot(
        "iiwa14",
        """
KUKA LBR iiwa 14 R820. Each joint turns about the z axis of its link.

Lengths (0.36, 0.42, 0.40, 0.126 m), joint ranges, speeds and torques: KUKA, "LBR iiwa 7 R800, LBR iiwa 14 R820,
  Specification".
Masses, centres of mass and moments of inertia: iiwa_stack (V. Tkachev and others, TU Munich) and Drake's model of the
  arm.
Geometry: cylinders that approximate the arm; visual and collision are the same.
""",
    )
    quarter = pi / 2
    # above: position of the joint in its parent link; inertia: mass, centre of mass, principal moments
    rows = [
        ((0, 0, 0.1575), (0, 0, 0), 170, 85, 320, (5.76, (0, -0.03, 0.12), (0.033, 0.0333, 0.0123))),
        ((0, 0, 0.2025), (quarter, 0, pi), 120, 85, 320, (6.35, (0.0003, 0.059, 0.042), (0.0305, 0.0304, 0.011))),
        ((0, 0.2045, 0), (quarter, 0, pi), 170, 100, 176, (3.5, (0, 0.03, 0.13), (0.025, 0.0238, 0.0076))),
        ((0, 0, 0.2155), (quarter, 0, 0), 120, 75, 176, (3.5, (0, 0.067, 0.034), (0.017, 0.0164, 0.006))),
        ((0, 0.1845, 0), (-quarter, pi, 0), 170, 130, 110, (3.5, (0.0001, 0.021, 0.076), (0.01, 0.0087, 0.00449))),
        ((0, 0, 0.2155), (quarter, 0, 0), 120, 135, 40, (1.8, (0, 0.0006, 0.0004), (0.0049, 0.0047, 0.0036))),
        ((0, 0.081, 0), (-quarter, pi, 0), 175, 135, 40, (1.2, (0, 0, 0.02), (0.001, 0.001, 0.001))),
    ]
    solids = [
        [cylinder(0.075, 0.19, at=(0, 0, 0.095))],
        [cylinder(0.075, 0.16, colour="orange"), cylinder(0.07, 0.12, at=(0, 0.13, 0), rpy=ALONG_Y)],
        [cylinder(0.07, 0.2, at=(0, 0, 0.1))],
        [cylinder(0.07, 0.15, colour="orange"), cylinder(0.065, 0.12, at=(0, 0.12, 0), rpy=ALONG_Y)],
        [cylinder(0.06, 0.18, at=(0, 0, 0.09))],
        [cylinder(0.06, 0.14, colour="orange")],
        [cylinder(0.045, 0.045, at=(0, 0, 0.0225), colour="grey")],
    ]
    robot.link(
        "iiwa_link_0",
        cylinder(0.1, 0.15, at=(0, 0, 0.075), colour="grey"),
        published=(5.0, (-0.1, 0, 0.07), diagonal(0.05, 0.06, 0.03)),
    )
    for index, (at, rpy, reach, speed, torque, (mass, com, moments)) in enumerate(rows, 1):
        link = f"iiwa_link_{index}"
        robot.joint(
            f"iiwa_joint_{index}",
            "revolute",
            f"iiwa_link_{index - 1}",
            link,
            at=at,
            rpy=rpy,
            lower=-radians(reach),
            upper=radians(reach),
            velocity=radians(speed),
            effort=torque,
            damping=0.5,
        )
        robot.link(link, *solids[index - 1], published=(mass, com, diagonal(*moments)))
    robot.frame("iiwa_link_ee", "iiwa_link_7", at=(0, 0, 0.045))
    joints = [f"iiwa_joint_{index}" for index in range(1, 8)]
    ready = [0, pi / 6, 0, -pi / 2, 0, pi / 3, 0]
    return robot, Profile(
        title="KUKA LBR iiwa 14 R820",
        sources=[
            "KUKA: LBR iiwa 7 R800, LBR iiwa 14 R820, Specification (lengths, ranges, speeds, torques)",
            "iiwa_stack, Drake's iiwa14 model (masses, centres of mass, inertias)",
        ],
        home="ready",
        poses={"ready": dict(zip(joints, ready)), "stretched": {}},
        stiffness=dict(zip(joints, [800, 800, 600, 600, 250, 150, 50])),
        end_effectors={"flange": {"frame": "iiwa_link_ee", "joints": joints}},
    )


UR5E_JOINTS = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]


def add_ur5e(robot, base, prefix=""):
    """Adds the arm to the link `base`; returns the names of its joints."""
    quarter = pi / 2
    d1, a2, a3, d4, d5, d6 = 0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996
    # link, mass, centre of mass in its DH frame, DH frame in the link, bar that determines its inertia (radius, length, rpy)
    links = [
        ("shoulder_link", 3.761, (0, -0.02561, 0.00193), (0, 0, 0), quarter, (0.06, 0.15, (0, 0, 0))),
        ("upper_arm_link", 8.058, (0.2125, 0, 0.11336), (a2, 0, 0), 0, (0.054, 0.425, ALONG_X)),
        ("forearm_link", 2.846, (0.15, 0, 0.0265), (a3, 0, 0), 0, (0.04, 0.3922, ALONG_X)),
        ("wrist_1_link", 1.37, (0, -0.0018, 0.01634), (0, 0, 0), quarter, (0.045, 0.12, (0, 0, 0))),
        ("wrist_2_link", 1.3, (0, 0.0018, 0.01634), (0, 0, 0), -quarter, (0.045, 0.12, (0, 0, 0))),
        ("wrist_3_link", 0.365, (0, 0, -0.001159), (0, 0, 0), 0, (0.0375, 0.0458, (0, 0, 0))),
    ]
    mounts = [
        ((0, 0, d1), (0, 0, 0)),
        ((0, 0, 0), (quarter, 0, 0)),
        ((a2, 0, 0), (0, 0, 0)),
        ((a3, 0, d4), (0, 0, 0)),
        ((0, -d5, 0), (quarter, 0, 0)),
        ((0, d6, 0), (-quarter, 0, 0)),
    ]
    solids = [
        [cylinder(0.06, 0.14, at=(0, 0, -0.02), colour="grey")],
        [
            cylinder(0.06, 0.16, at=(0, 0, 0.12), colour="grey"),
            cylinder(0.054, 0.33, at=(a2 / 2, 0, 0.136), rpy=ALONG_X, colour="white"),
            cylinder(0.058, 0.13, at=(a2, 0, 0.11), colour="grey"),
        ],
        [
            cylinder(0.04, 0.33, at=(a3 / 2, 0, 0.007), rpy=ALONG_X, colour="white"),
            cylinder(0.042, 0.11, at=(a3, 0, 0.035), colour="grey"),
        ],
        [cylinder(0.042, 0.11, at=(0, -0.035, 0), rpy=ALONG_Y, colour="grey")],
        [cylinder(0.042, 0.11, at=(0, 0.035, 0), rpy=ALONG_Y, colour="grey")],
        [cylinder(0.0375, 0.045, at=(0, 0, -0.023), colour="black")],
    ]
    robot.joint(f"{prefix}base_link_inertia_joint", "fixed", base, f"{prefix}base_link_inertia", rpy=(0, 0, pi))
    robot.link(
        f"{prefix}base_link_inertia",
        cylinder(0.075, 0.09, at=(0, 0, 0.045), mass=4.0, colour="grey"),
    )
    parent = f"{prefix}base_link_inertia"
    limits = [(360, 150), (360, 150), (180, 150), (360, 28), (360, 28), (360, 28)]
    for row, (name, mass, com, at, roll, bar) in enumerate(links):
        radius, length, rpy = bar
        com = m.add(at, m.apply(m.from_rpy((roll, 0, 0)), com))
        turned = m.from_rpy(rpy)
        inertia = m.times(turned, m.times(cylinder(radius, length, mass=mass).inertia(), m.transposed(turned)))
        reach, torque = limits[row]
        robot.joint(
            f"{prefix}{UR5E_JOINTS[row]}_joint",
            "revolute",
            parent,
            f"{prefix}{name}",
            at=mounts[row][0],
            rpy=mounts[row][1],
            lower=-radians(reach),
            upper=radians(reach),
            velocity=pi,
            effort=torque,
        )
        parent = robot.link(f"{prefix}{name}", *solids[row], published=(mass, com, inertia))
    robot.frame(f"{prefix}tool0", parent)
    return [f"{prefix}{name}_joint" for name in UR5E_JOINTS]


UR5E_SOURCES = [
    "Universal Robots: DH Parameters for calculations of kinematics and dynamics (UR5e: DH parameters, masses, centres of mass)",
    "Universal Robots: UR5e technical specifications (ranges, speeds, torques)",
]
UR5E_COMMENT = """
DH parameters, masses and centres of mass: Universal Robots, "DH Parameters for calculations of kinematics and dynamics".
Ranges, speeds and torques: the technical specifications of the arm. Universal Robots publishes no inertias of the links:
  they are computed for solid cylinders with the link's mass and size.
Names, and base_link rotated by half a turn relative to the controller's base frame: as in Universal Robots' ROS description.
Geometry: cylinders that approximate the arm, and original shells for display.
"""
UR5E_READY = [0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0]
UR5E_STIFFNESS = [800, 1000, 600, 150, 100, 50]


def ur5e():
    robot = Robot("ur5e", f"Universal Robots UR5e.\n{UR5E_COMMENT}")
    robot.link("base_link")
    joints = add_ur5e(robot, "base_link")
    robot.dress(ur5e_shells.parts())
    return robot, Profile(
        title="Universal Robots UR5e",
        sources=UR5E_SOURCES,
        home="ready",
        poses={
            "ready": dict(zip(joints, UR5E_READY)),
            "upright": dict(zip(joints, [0.0, -pi / 2, 0.0, -pi / 2, 0.0, 0.0])),
        },
        stiffness=dict(zip(joints, UR5E_STIFFNESS)),
        end_effectors={"tool": {"frame": "tool0", "joints": joints}},
    )


def mobile_manipulator():
    robot = Robot(
        "mobile-manipulator",
        f"""
A UR5e on an omnidirectional base of the size and mass of Clearpath's Ridgeback. The base has three joints: two
slides along the world's axes and a rotation, so base_x, base_y and base_yaw are its pose in the world.

The base: Clearpath Robotics, Ridgeback data sheet (0.96 x 0.793 x 0.296 m, 135 kg, 1.1 m/s); modelled as two boxes
  of uniform density.
{UR5E_COMMENT.strip()}
""",
    )
    robot.link("world")
    slide = dict(lower=-50, upper=50, velocity=1.1, effort=600)
    robot.joint("base_x", "prismatic", "world", "base_x_link", axis=(1, 0, 0), **slide)
    robot.link("base_x_link")
    robot.joint("base_y", "prismatic", "base_x_link", "base_y_link", axis=(0, 1, 0), **slide)
    robot.link("base_y_link")
    robot.joint("base_yaw", "continuous", "base_y_link", "base_link", velocity=2.0, effort=250)
    wheels = [
        cylinder(0.0759, 0.08, at=(x, y, 0.0759), rpy=ALONG_Y, colour="black") for x in (0.319, -0.319) for y in (0.275, -0.275)
    ]
    robot.link(
        "base_link",
        box((0.96, 0.793, 0.2), at=(0, 0, 0.15), mass=120.0, colour="black"),
        box((0.9, 0.74, 0.046), at=(0, 0, 0.273), mass=15.0, colour="orange"),
        *wheels,
    )
    robot.frame("arm_mount", "base_link", at=(0.25, 0, 0.296))
    arm = add_ur5e(robot, "arm_mount", "arm_")
    robot.dress(ur5e_shells.parts(), "ur5e", "arm_")
    base = ["base_x", "base_y", "base_yaw"]
    return robot, Profile(
        title="Mobile manipulator: a UR5e on an omnidirectional base",
        sources=["Clearpath Robotics: Ridgeback data sheet (size, mass, speed)", *UR5E_SOURCES],
        home="ready",
        poses={
            "ready": dict(zip(arm, UR5E_READY)),
            "travel": dict(zip(arm, [0.0, -2.4, 2.4, -pi / 2, -pi / 2, 0.0])),
        },
        stiffness=dict(zip(base, [8000, 8000, 2000])) | dict(zip(arm, UR5E_STIFFNESS)),
        end_effectors={
            "tool": {"frame": "arm_tool0", "joints": arm},
            "tool_with_base": {"frame": "arm_tool0", "joints": base + arm},
        },
        mobile_base={"drive": "omnidirectional", "frame": "base_link", "joints": base},
    )


# Joint: position and axes in its parent link, range. Link: mass, centre of mass, inertia (xx, yy, zz, xy, xz, yz), its shape.
SO101 = [
    (
        "shoulder_pan",
        ((0.0207909, -0.0230745, 0.0948817), (pi, 0, pi / 2), (-1.91986, 1.91986)),
        ("shoulder_link", 0.100006, (-0.0307604, -1.66727e-05, -0.0252713)),
        (8.3759e-05, 8.10403e-05, 2.39783e-05, 7.55525e-08, -1.16342e-06, 1.54663e-07),
        [box((0.045, 0.036, 0.06), at=(-0.03, 0, -0.028), colour="black")],
    ),
    (
        "shoulder_lift",
        ((-0.0303992, -0.0182778, -0.0542), (-pi / 2, -pi / 2, 0), (-1.74533, 1.74533)),
        ("upper_arm_link", 0.103, (-0.0898471, -0.00838224, 0.0184089)),
        (4.08002e-05, 0.000147318, 0.000142487, -1.97819e-05, -4.03016e-08, 8.97326e-09),
        [box((0.12, 0.035, 0.04), at=(-0.06, -0.008, 0.0184), colour="orange")],
    ),
    (
        "elbow_flex",
        ((-0.11257, -0.028, 0), (0, 0, pi / 2), (-1.69, 1.69)),
        ("lower_arm_link", 0.104, (-0.0980701, 0.00324376, 0.0182831)),
        (2.87438e-05, 0.000159844, 0.00014529, 7.41152e-06, 1.26409e-06, -4.90188e-08),
        [box((0.125, 0.032, 0.04), at=(-0.068, 0.0035, 0.0183), colour="orange")],
    ),
    (
        "wrist_flex",
        ((-0.1349, 0.0052, 0), (0, 0, -pi / 2), (-1.65806, 1.65806)),
        ("wrist_link", 0.079, (-0.000103312, -0.0386143, 0.0281156)),
        (3.68263e-05, 2.5391e-05, 2.1e-05, 1.7893e-08, -5.28128e-08, 3.6412e-06),
        [box((0.03, 0.046, 0.045), at=(0, -0.034, 0.022), colour="black")],
    ),
    (
        "wrist_roll",
        ((0, -0.0611, 0.0181), (pi / 2, 0, pi), (-2.79253, 2.79253)),
        ("gripper_link", 0.087, (0.000213627, 0.000245138, -0.025187)),
        (2.75087e-05, 4.33657e-05, 3.45059e-05, -3.35241e-07, -5.7352e-06, -5.17847e-08),
        [
            box((0.05, 0.032, 0.045), at=(0, 0, -0.0235), colour="orange"),
            box((0.012, 0.025, 0.055), at=(-0.014, 0, -0.0735), colour="orange"),
        ],
    ),
    (
        "gripper",
        ((0.0202, 0.0188, -0.0234), (pi / 2, 0, 0), (-0.174533, 1.74533)),
        ("jaw_link", 0.012, (-0.00157495, -0.0300244, 0.0192755)),
        (6.61427e-06, 1.89032e-06, 5.28738e-06, -3.19807e-07, -5.90717e-09, -1.09945e-07),
        [box((0.012, 0.075, 0.022), at=(-0.002, -0.036, 0.0189), colour="orange")],
    ),
]


def so101():
    robot = Robot(
        "so101",
        """
SO-101, an open-source arm with six serial servos and printed parts.

Positions of the joints, ranges, masses, centres of mass and moments of inertia: The Robot Studio, SO-ARM100, Simulation/SO101,
  so101_new_calib.urdf. Zero is the middle of a servo's calibrated range.
Torque and speed: Feetech, STS3215 at 7.4 V with a 1:345 gear (19.5 kg cm, 0.222 s for 60 degrees).
Damping of the joints, and the stiffness of the servos in the profile: joints_properties.xml of the same folder.
Geometry: boxes that approximate the arm; visual and collision are the same.
""",
    )

    def tensor(xx, yy, zz, xy, xz, yz):
        return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]

    robot.link(
        "base_link",
        box((0.06, 0.09, 0.07), at=(0.0207, 0.005, 0.035), colour="orange"),
        published=(
            0.147,
            (0.020739, 0.00204287, 0.065966),
            tensor(0.000136117, 0.000114686, 0.000130364, 4.59787e-07, 9.75275e-08, -4.97151e-06),
        ),
    )
    parent = "base_link"
    for name, (at, rpy, (lower, upper)), (link, mass, com), moments, solids in SO101:
        robot.joint(
            name,
            "revolute",
            parent,
            link,
            at=at,
            rpy=rpy,
            lower=lower,
            upper=upper,
            velocity=4.717,
            effort=1.912,
            damping=0.6,
        )
        parent = robot.link(link, *solids, published=(mass, com, tensor(*moments)))
    robot.frame("gripper_frame", "gripper_link", at=(-0.0079, -0.000218121, -0.0981274), rpy=(pi / 2, 0, pi / 2))
    joints = [row[0] for row in SO101]
    return robot, Profile(
        title="SO-101: a printed arm of six serial servos",
        sources=[
            "The Robot Studio: SO-ARM100, Simulation/SO101 (places, ranges, masses, inertias, damping, stiffness)",
            "Feetech: STS3215 of 7.4 V, gear 1:345 (torque, speed)",
        ],
        home="middle",
        poses={
            "middle": {},
            "reach": {"shoulder_lift": 0.6, "elbow_flex": -0.5, "wrist_flex": 0.4, "gripper": 0.6},
        },
        stiffness={joint: 17.8 for joint in joints},
        end_effectors={"gripper": {"frame": "gripper_frame", "joints": joints[:5], "fingers": ["gripper"]}},
    )


ROBOTS = [iiwa14, ur5e, mobile_manipulator, so101]
