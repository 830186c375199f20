"""Robots on four and six legs."""

from math import pi

from bodies import ALONG_X, ALONG_Y, Robot, box, cylinder, sphere
from machines import quadruped as quadruped_shells
from profile import Profile
from upright import add_arm

SIDES = (("left", 1), ("right", -1))
ENDS = (("front", 1), ("hind", -1))


def quadruped():
    robot = Robot(
        "quadruped",
        """
A torque-controlled quadruped of the size and mass of Solo12: twelve joints, ball feet, 2.5 kg.

Lengths, positions of the joints and masses: solo12.urdf, the robot's description in the PyPI package
  example-robot-data 6.0.0; the mass of a foot is included in its shank.
Torque: F. Grimminger and others, "An Open Torque-Controlled Modular Robot Architecture for Legged Locomotion Research",
  IEEE Robotics and Automation Letters 5(2), 2020, 2.7 N m at 12 A. Ranges and speeds are assumptions.
Bodies of uniform density, and original shells for display. All joints at zero: legs straight down. Roll about x, pitch about y.
""",
    )
    robot.link("base", box((0.38, 0.13, 0.06), mass=1.161, colour="white"))
    speed = dict(velocity=40, effort=2.7)
    feet, standing, crouched = {}, {}, {}
    for end, fore in ENDS:
        for side, out in SIDES:
            leg = f"{end}_{side}"
            thigh = [cylinder(0.022, 0.03, at=(0, out * 0.02, 0), rpy=ALONG_Y, mass=0.06, colour="black")]
            thigh.append(cylinder(0.013, 0.16, at=(0, out * 0.03, -0.08), mass=0.0885, colour="white"))
            shank = [cylinder(0.008, 0.15, at=(0, out * 0.008, -0.075), mass=0.03, colour="grey")]
            shank.append(sphere(0.0165, at=(0, out * 0.008, -0.16), mass=0.0076, colour="black"))
            robot.joint(
                f"{leg}_hip_roll", "revolute", "base", f"{leg}_hip", at=(fore * 0.1946, out * 0.0875, 0), axis=(1, 0, 0),
                lower=-0.9, upper=0.9, **speed,
            )
            robot.link(f"{leg}_hip", cylinder(0.025, 0.1, at=(-fore * 0.055, 0, 0), rpy=ALONG_X, mass=0.1485, colour="black"))
            robot.joint(
                f"{leg}_hip_pitch", "revolute", f"{leg}_hip", f"{leg}_thigh", at=(0, out * 0.014, 0), axis=(0, 1, 0),
                lower=-1.6, upper=1.6, **speed,
            )
            robot.link(f"{leg}_thigh", *thigh)
            robot.joint(
                f"{leg}_knee", "revolute", f"{leg}_thigh", f"{leg}_shank", at=(0, out * 0.03745, -0.16), axis=(0, 1, 0),
                lower=-2.7, upper=2.7, **speed,
            )
            robot.link(f"{leg}_shank", *shank)
            robot.frame(f"{leg}_foot", f"{leg}_shank", at=(0, out * 0.008, -0.16))
            joints = [f"{leg}_hip_roll", f"{leg}_hip_pitch", f"{leg}_knee"]
            feet[leg] = {"frame": f"{leg}_foot", "joints": joints, "radius": 0.0165}
            standing |= {joints[1]: fore * 0.8, joints[2]: -fore * 1.6}
            crouched |= {joints[1]: fore * 1.2, joints[2]: -fore * 2.4}
    robot.dress(quadruped_shells.parts())
    stiffness = {}
    for joint in robot.independent():
        stiffness[joint.name] = 6.0
    return robot, Profile(
        title="Quadruped of the Solo12 class",
        sources=[
            "Grimminger and others: An Open Torque-Controlled Modular Robot Architecture for Legged Locomotion Research, "
            "IEEE RA-L 5(2), 2020 (torque)",
            "example-robot-data 6.0.0: solo12.urdf (lengths, places of joints, masses)",
            "own figures: ranges, speeds",
        ],
        home="standing",
        poses={"standing": standing, "crouched": crouched},
        stiffness=stiffness,
        floating=True,
        feet=feet,
    )


def hexapod():
    robot = Robot(
        "hexapod",
        """
A six-legged crawler of the size of the PhantomX hexapod, driven by eighteen AX-12A servos. Every leg's x axis points
outward; its coxa turns about z, femur and tibia about y, downward for positive angles. All joints at zero: legs straight
out.

Lengths (coxa 52 mm, femur 66 mm, tibia 133 mm): Trossen Robotics, PhantomX AX hexapod Mark II.
Servos (54.6 g, 1.5 N m, 59 rpm, 300 degrees): ROBOTIS e-Manual, AX-12A. The range is limited to 100 degrees to either side.
Bodies of uniform density.
""",
    )
    servo = 0.0546
    robot.link(
        "base",
        box((0.24, 0.1, 0.045), at=(0, 0, 0), mass=0.75, colour="black"),
        box((0.1, 0.2, 0.02), at=(0, 0, 0), mass=0.25, colour="black"),
    )
    limits = dict(lower=-1.75, upper=1.75, velocity=6.18, effort=1.5)
    feet, standing, low = {}, {}, {}
    for end, x, y, turn in (("front", 0.125, 0.062, pi / 4), ("middle", 0.0, 0.103, pi / 2), ("hind", -0.125, 0.062, 3 * pi / 4)):
        for side, out in SIDES:
            leg = f"{end}_{side}"
            robot.joint(f"{leg}_coxa", "revolute", "base", f"{leg}_coxa_link", at=(x, out * y, 0), rpy=(0, 0, out * turn), **limits)
            robot.link(f"{leg}_coxa_link", box((0.05, 0.032, 0.038), at=(0.026, 0, 0), mass=2 * servo, colour="grey"))
            robot.joint(
                f"{leg}_femur", "revolute", f"{leg}_coxa_link", f"{leg}_femur_link", at=(0.052, 0, 0), axis=(0, 1, 0), **limits
            )
            robot.link(f"{leg}_femur_link", box((0.066, 0.028, 0.024), at=(0.033, 0, 0), mass=0.02, colour="orange"))
            robot.joint(
                f"{leg}_tibia", "revolute", f"{leg}_femur_link", f"{leg}_tibia_link", at=(0.066, 0, 0), axis=(0, 1, 0), **limits
            )
            robot.link(
                f"{leg}_tibia_link",
                box((0.04, 0.032, 0.038), at=(0.016, 0, 0), mass=servo, colour="grey"),
                cylinder(0.008, 0.1, at=(0.083, 0, 0), rpy=ALONG_X, mass=0.02, colour="black"),
                sphere(0.008, at=(0.133, 0, 0), mass=0.002, colour="black"),
            )
            robot.frame(f"{leg}_foot", f"{leg}_tibia_link", at=(0.133, 0, 0))
            joints = [f"{leg}_{part}" for part in ("coxa", "femur", "tibia")]
            feet[leg] = {"frame": f"{leg}_foot", "joints": joints, "radius": 0.008}
            standing |= {joints[1]: -0.35, joints[2]: 1.6}
            low |= {joints[1]: -0.9, joints[2]: 1.7}
    return robot, Profile(
        title="Hexapod: a crawler on six legs of three joints",
        sources=["Trossen Robotics: PhantomX AX hexapod Mark II (lengths)", "ROBOTIS e-Manual: AX-12A (mass, torque, speed)"],
        home="standing",
        poses={"standing": standing, "low": low},
        stiffness={joint.name: 8.0 if "coxa" in joint.name else 12.0 for joint in robot.independent()},
        floating=True,
        feet=feet,
    )


def centaur():
    robot = Robot(
        "centaur",
        """
A centaur similar to IIT's CENTAURO: four legs with five joints and a wheel each, a torso with two arms of seven
joints and a gripper each, and a head; 44 joints, 93 kg. Roll about x, pitch about y, yaw about z. All joints at zero: legs and
arms straight down.

Mass and arrangement: N. Kashiri and others, "CENTAURO: A Hybrid Locomotion and High Power Resilient Manipulation Platform",
  IEEE Robotics and Automation Letters 4(2), 2019. Positions, torques and speeds of the legs' joints, rounded, and torques of
  torso and arms: centauro.urdf in the PyPI package example-robot-data 6.0.0.
Assumptions: the seventh joint of each arm, the torso's pitch, the grippers and the head, for a total of 44 joints; the
  lengths of the arms, ranges and speeds; the distribution of the mass over the links.
Bodies of uniform density.
""",
    )
    robot.link(
        "base",
        box((0.6, 0.36, 0.16), at=(0, 0, 0), mass=22.0, colour="white"),
        box((0.24, 0.2, 0.06), at=(0, 0, 0.1), mass=4.0, colour="black"),
    )
    thigh, shank, ankle, radius = 0.3, 0.3, 0.14, 0.078
    feet, poses, wheels, steering = {}, {"standing": {}, "low": {}, "tall": {}}, [], []
    for end, fore in ENDS:
        for side, out in SIDES:
            leg = f"{end}_{side}"
            parts = [
                ("hip_yaw", (0, 0, 1), "base", "hip", (fore * 0.25, out * 0.15, -0.06), 2.0, 304, [
                    box((0.11, 0.13, 0.12), at=(0, out * 0.03, -0.05), mass=1.9, colour="black")]),
                ("hip_pitch", (0, 1, 0), "hip", "thigh", (0, out * 0.115, -0.06), 2.1, 304, [
                    cylinder(0.065, 0.1, rpy=ALONG_Y, mass=1.3, colour="black"),
                    box((0.09, 0.07, thigh), at=(0, 0, -thigh / 2), mass=1.5, colour="white")]),
                ("knee_pitch", (0, 1, 0), "thigh", "shank", (0, 0, -thigh), 2.4, 304, [
                    cylinder(0.055, 0.1, rpy=ALONG_Y, mass=0.7, colour="black"),
                    box((0.07, 0.06, shank), at=(0, 0, -shank / 2), mass=1.0, colour="white")]),
                ("ankle_pitch", (0, 1, 0), "shank", "ankle", (0, 0, -shank), 2.4, 147, [
                    box((0.08, 0.09, 0.1), at=(0, 0, -0.04), mass=1.1, colour="black")]),
                ("ankle_yaw", (0, 0, 1), "ankle", "fork", (0, 0, -0.09), 2.5, 35, [
                    cylinder(0.04, 0.05, mass=0.8, at=(0, 0, 0.0), colour="grey"),
                    box((0.05, 0.02, ankle), at=(0, out * 0.05, -ankle / 2 + 0.02), mass=0.4, colour="white")]),
            ]  # fmt: skip
            for part, axis, parent, child, at, reach, effort, solids in parts:
                parent = parent if parent == "base" else f"{leg}_{parent}"
                robot.joint(
                    f"{leg}_{part}", "revolute", parent, f"{leg}_{child}", at=at, axis=axis, lower=-reach, upper=reach,
                    velocity={304: 8.8, 147: 8.1, 35: 20.0}[effort], effort=effort,
                )
                robot.link(f"{leg}_{child}", *solids)
            robot.joint(
                f"{leg}_wheel", "continuous", f"{leg}_fork", f"{leg}_wheel_link", at=(0, 0, -ankle), axis=(0, 1, 0),
                velocity=20, effort=35,
            )
            robot.link(f"{leg}_wheel_link", cylinder(radius, 0.06, rpy=ALONG_Y, mass=1.3, colour="black"))
            wheels.append(f"{leg}_wheel")
            steering.append(f"{leg}_ankle_yaw")
            joints = [f"{leg}_{part[0]}" for part in parts]
            feet[leg] = {"frame": f"{leg}_wheel_link", "joints": joints, "radius": radius}
            for pose, bend in (("standing", 0.8), ("low", 1.25), ("tall", 0.35)):
                # Thighs spread outward, shanks lean inward, ankles keep the wheels' forks upright.
                poses[pose] |= {joints[1]: -fore * bend, joints[2]: fore * 1.6 * bend, joints[3]: -fore * 0.6 * bend}
    robot.joint("torso_yaw", "revolute", "base", "waist", at=(0, 0, 0.13), lower=-2.6, upper=2.6, velocity=5.7, effort=147)
    robot.link("waist", cylinder(0.09, 0.1, at=(0, 0, 0.05), mass=2.6, colour="black"))
    robot.joint(
        "torso_pitch", "revolute", "waist", "torso", at=(0, 0, 0.1), axis=(0, 1, 0), lower=-0.4, upper=0.8, velocity=5.7, effort=147
    )
    robot.link("torso", box((0.2, 0.3, 0.34), at=(0, 0, 0.17), mass=8.8, colour="white"))
    arms, ends = [], {}
    for side, out in SIDES:
        joints = add_arm(
            robot, side, out, "torso", (0.02, out * 0.2, 0.28), upper=0.3, lower=0.28, hand=0.12,
            masses=(1.4, 1.2, 1.0, 1.0, 0.8, 0.5, 0.6), efforts=(147, 147, 147, 147, 55, 55, 28), thick=0.05,
        )  # fmt: skip
        grip = f"{side}_gripper"
        for finger, way, mimic in (("inner", 1, None), ("outer", -1, (grip, 1.0, 0.0))):
            name = grip if mimic is None else f"{side}_gripper_mirror"
            robot.joint(
                name, "prismatic", f"{side}_hand", f"{side}_{finger}_finger", at=(0, 0, -0.12), axis=(way, 0, 0),
                lower=0, upper=0.05, velocity=0.2, effort=100, mimic=mimic,
            )
            robot.link(f"{side}_{finger}_finger", box((0.015, 0.04, 0.09), at=(way * 0.0075, 0, -0.045), mass=0.1, colour="black"))
        robot.frame(f"{side}_grasp", f"{side}_hand", at=(0, 0, -0.19))
        arms += [*joints, grip]
        ends[f"{side}_hand"] = {"frame": f"{side}_grasp", "joints": joints, "fingers": [grip]}
        reach = {"shoulder_pitch": -0.3, "shoulder_roll": out * 0.35, "elbow": -1.4}
        for pose in poses.values():
            pose |= {f"{side}_{joint}": angle for joint, angle in reach.items()} | {grip: 0.04}
    robot.joint("head_yaw", "revolute", "torso", "neck", at=(0.02, 0, 0.36), lower=-1.5, upper=1.5, velocity=4.0, effort=20)
    robot.link("neck", cylinder(0.04, 0.06, at=(0, 0, 0.03), mass=0.5, colour="black"))
    robot.joint(
        "head_pitch", "revolute", "neck", "head", at=(0, 0, 0.06), axis=(0, 1, 0), lower=-0.7, upper=0.9, velocity=4.0, effort=20
    )
    robot.link("head", box((0.16, 0.16, 0.16), at=(0.02, 0, 0.08), mass=1.7, colour="white"))
    robot.frame("camera", "head", at=(0.1, 0, 0.08))
    stiffness = {}
    by_part = {
        "hip_yaw": 800, "hip_pitch": 2500, "knee_pitch": 2500, "ankle_pitch": 1500, "ankle_yaw": 200, "torso_yaw": 1000,
        "torso_pitch": 1500, "shoulder_pitch": 500, "shoulder_roll": 500, "shoulder_yaw": 200, "elbow": 300, "wrist_yaw": 40,
        "wrist_pitch": 60, "wrist_roll": 30, "gripper": 1000, "head_yaw": 40, "head_pitch": 60,
    }  # fmt: skip
    for joint in robot.independent():
        part = next((part for part in by_part if joint.name.endswith(part)), None)
        if part:
            stiffness[joint.name] = by_part[part]
    return robot, Profile(
        title="Centaur of the CENTAURO class: four wheeled legs, two arms",
        sources=[
            "Kashiri and others: CENTAURO: A Hybrid Locomotion and High Power Resilient Manipulation Platform, "
            "IEEE RA-L 4(2), 2019 (mass, arrangement)",
            "example-robot-data 6.0.0: centauro.urdf (legs: places of joints, torques, speeds; torques of torso and arms)",
            "own figures: arms, torso's pitch, grippers, head, how the mass spreads",
        ],
        home="standing",
        poses=poses,
        stiffness=stiffness,
        speed_gains={wheel: 2.0 for wheel in wheels},
        floating=True,
        end_effectors=ends,
        feet=feet,
        mobile_base={"drive": "steered_wheels", "frame": "base", "wheels": wheels, "steering": steering, "wheel_radius": radius},
    )


ROBOTS = [quadruped, hexapod, centaur]
