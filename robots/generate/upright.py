"""Robots on two legs."""

from bodies import ALONG_Y, Robot, box, cylinder, sphere
from machines import humanoid as humanoid_shells
from profile import Profile

SIDES = (("left", 1), ("right", -1))
WINTER = (
    "D. A. Winter: Biomechanics and Motor Control of Human Movement, 4th edition, Wiley 2009, "
    "table 4.1 and figure 4.1 (lengths and masses of body segments)"
)


def add_leg(robot, side, out, base, at, thigh, shank, ankle, foot, masses, efforts, speed, thick):
    """Adds a leg with six joints: yaw, roll and pitch of the hip, knee, pitch and roll of the ankle. Returns their names.

    `masses`: thigh, shank and foot. `foot`: its length and width. The sole is `ankle` below the ankle.
    """
    length, width = foot
    hip = 0.12 * masses[0]
    parts = [
        ("hip_yaw", (0, 0, 1), base, "hip_yaw_link", at, (-1.0, 0.6), [
            cylinder(thick * 0.9, thick, at=(0, 0, thick / 2), mass=hip, colour="black")]),
        ("hip_roll", (1, 0, 0), None, "hip_roll_link", (0, 0, 0), (-0.5, 0.8), [
            cylinder(thick * 0.8, thick * 1.6, rpy=(0, 1.5707963267948966, 0), mass=hip, colour="black")]),
        ("hip_pitch", (0, 1, 0), None, "thigh", (0, 0, 0), (-1.9, 0.9), [
            cylinder(thick, thigh, at=(0, 0, -thigh / 2), mass=masses[0] - 2 * hip, colour="white")]),
        ("knee", (0, 1, 0), None, "shank", (0, 0, -thigh), (0.0, 2.3), [
            cylinder(thick * 0.95, thick * 2.2, rpy=ALONG_Y, mass=0.2 * masses[1], colour="black"),
            cylinder(thick * 0.8, shank, at=(0, 0, -shank / 2), mass=0.8 * masses[1], colour="white")]),
        ("ankle_pitch", (0, 1, 0), None, "ankle", (0, 0, -shank), (-1.1, 0.8), [
            cylinder(thick * 0.6, thick * 1.8, rpy=ALONG_Y, mass=0.2 * masses[2], colour="black")]),
        ("ankle_roll", (1, 0, 0), None, "foot", (0, 0, 0), (-0.6, 0.6), [
            box((length, width, ankle * 0.5), at=(0.18 * length, 0, -0.75 * ankle), mass=0.8 * masses[2], colour="grey")]),
    ]  # fmt: skip
    parent = None
    for (part, axis, first, child, place, (lower, upper), solids), effort in zip(parts, efforts):
        # Roll and yaw are mirrored, pitch is not.
        if axis[1] == 0 and out < 0:
            lower, upper = -upper, -lower
        child = f"{side}_{child}"
        robot.joint(
            f"{side}_{part}", "revolute", first or parent, child, at=place, axis=axis, lower=lower, upper=upper, velocity=speed,
            effort=effort,
        )  # fmt: skip
        parent = robot.link(child, *solids)
    robot.frame(f"{side}_sole", parent, at=(0.18 * length, 0, -ankle))
    return [f"{side}_{part[0]}" for part in parts]


def add_arm(robot, side, out, base, at, upper, lower, hand, masses, efforts, thick, speed=5.0):
    """Adds an arm with seven joints: pitch, roll and yaw of the shoulder, elbow, yaw, pitch and roll of the wrist."""
    ball = thick * 1.1
    parts = [
        ("shoulder_pitch", (0, 1, 0), "shoulder", at, (-3.0, 1.2), [
            cylinder(ball, thick * 1.6, rpy=ALONG_Y, mass=masses[0], colour="black")]),
        ("shoulder_roll", (1, 0, 0), "shoulder_roll_link", (0, out * thick * 1.2, 0), (-0.3, 2.2), [
            sphere(ball, mass=masses[1], colour="black")]),
        ("shoulder_yaw", (0, 0, 1), "upper_arm", (0, 0, 0), (-1.8, 1.8), [
            cylinder(thick * 0.9, upper - ball, at=(0, 0, -(upper + ball) / 2), mass=masses[2], colour="white")]),
        ("elbow", (0, 1, 0), "forearm", (0, 0, -upper), (-2.4, 0.0), [
            cylinder(thick * 0.9, thick * 1.9, rpy=ALONG_Y, mass=0.3 * masses[3], colour="black"),
            cylinder(thick * 0.75, lower * 0.5, at=(0, 0, -lower * 0.25), mass=0.7 * masses[3], colour="white")]),
        ("wrist_yaw", (0, 0, 1), "wrist", (0, 0, -lower * 0.5), (-2.5, 2.5), [
            cylinder(thick * 0.65, lower * 0.45, at=(0, 0, -lower * 0.25), mass=masses[4], colour="grey")]),
        ("wrist_pitch", (0, 1, 0), "wrist_pitch_link", (0, 0, -lower * 0.5), (-1.2, 1.2), [
            cylinder(thick * 0.5, thick * 1.1, rpy=ALONG_Y, mass=masses[5], colour="black")]),
        ("wrist_roll", (1, 0, 0), "hand", (0, 0, 0), (-0.9, 0.9), [
            box((thick * 1.5, thick * 0.7, hand), at=(0, 0, -hand / 2), mass=masses[6], colour="grey")]),
    ]  # fmt: skip
    parent = base
    for (part, axis, child, place, (low, high), solids), effort in zip(parts, efforts):
        if axis[1] == 0 and out < 0:
            low, high = -high, -low
        robot.joint(
            f"{side}_{part}", "revolute", parent, f"{side}_{child}", at=place, axis=axis, lower=low, upper=high, velocity=speed,
            effort=effort,
        )  # fmt: skip
        parent = robot.link(f"{side}_{child}", *solids)
    return [f"{side}_{part[0]}" for part in parts]


def bent(side, angle):
    """Returns the posture of a leg with the hip above the ankle; thigh and shank have equal lengths."""
    return {f"{side}_hip_pitch": -angle, f"{side}_knee": 2 * angle, f"{side}_ankle_pitch": -angle}


def planar_biped():
    robot = Robot(
        "planar-biped",
        """
A five-link biped that moves in the x-z plane, with point feet and torques at hips and knees. Its pose in the plane is
three joints without drives: base_x, base_z and base_pitch of the hip.

Masses and lengths: RABBIT; C. Chevallereau and others, "RABBIT: A Testbed for Advanced Control Theory", IEEE Control
  Systems Magazine 23(5), 2003 (32 kg; thighs and shanks of 0.4 m). Bodies of uniform density.
""",
    )
    robot.link("world")
    robot.joint("base_x", "prismatic", "world", "base_x_link", axis=(1, 0, 0), lower=-50, upper=50, velocity=20, effort=1e4)
    robot.link("base_x_link")
    robot.joint("base_z", "prismatic", "base_x_link", "base_z_link", axis=(0, 0, 1), lower=-1, upper=10, velocity=20, effort=1e4)
    robot.link("base_z_link")
    robot.joint("base_pitch", "continuous", "base_z_link", "torso", axis=(0, 1, 0))
    robot.link(
        "torso",
        cylinder(0.05, 0.3, rpy=ALONG_Y, mass=3.0, colour="black"),
        box((0.12, 0.2, 0.5), at=(0, 0, 0.3), mass=9.0, colour="white"),
    )
    feet = {}
    for side, out in SIDES:
        robot.joint(
            f"{side}_hip", "revolute", "torso", f"{side}_thigh", at=(0, out * 0.12, 0), axis=(0, 1, 0), lower=-1.6, upper=1.2,
            velocity=12, effort=150,
        )
        robot.link(f"{side}_thigh", cylinder(0.045, 0.4, at=(0, 0, -0.2), mass=6.8, colour="grey"))
        robot.joint(
            f"{side}_knee", "revolute", f"{side}_thigh", f"{side}_shank", at=(0, 0, -0.4), axis=(0, 1, 0), lower=0.0, upper=2.3,
            velocity=12, effort=150,
        )
        robot.link(
            f"{side}_shank",
            cylinder(0.035, 0.38, at=(0, 0, -0.19), mass=3.0, colour="blue"),
            sphere(0.03, at=(0, 0, -0.4), mass=0.2, colour="black"),
        )
        robot.frame(f"{side}_foot", f"{side}_shank", at=(0, 0, -0.4))
        feet[side] = {"frame": f"{side}_foot", "joints": [f"{side}_hip", f"{side}_knee"], "radius": 0.03}
    # One foot in front of the hip, one behind it, at the same height: the angle of each leg from hip to foot is -hip - knee / 2.
    stride, bend = 0.25, 0.3
    standing = {}
    for side, way in (("left", 1), ("right", -1)):
        standing |= {f"{side}_hip": -way * stride - bend, f"{side}_knee": 2 * bend}
    profile = Profile(
        title="Planar biped with point feet",
        sources=["Chevallereau and others: RABBIT: A Testbed for Advanced Control Theory, IEEE Control Systems Magazine 23(5), 2003"],
        home="standing",
        poses={"standing": standing, "straight": {}},
        passive=["base_x", "base_z", "base_pitch"],
        stiffness={joint.name: 600.0 for joint in robot.independent() if not joint.name.startswith("base")},
        feet=feet,
    )
    for pose in profile.poses.values():
        places = robot.place(profile.whole(robot, "straight") | pose)
        pose["base_z"] = round(-min(places[frame][1][2] - radius for frame, radius in profile.supports(robot)), 9)
    return robot, profile


def biped():
    height, mass = 1.5, 50.0
    robot = Robot(
        "biped",
        f"""
A biped with twelve joints: a torso on two legs, each with yaw, roll and pitch of the hip, a knee, pitch and roll of the
ankle. Flat feet. Roll about x, pitch about y, yaw about z. All joints at zero: legs straight.

Lengths and masses: {WINTER};
  a person of {height} m and {mass:.0f} kg without head and arms. Bodies of uniform density.
""",
    )
    robot.link(
        "pelvis",
        box((0.16, 0.2, 0.12), at=(0, 0, 0.06), mass=0.142 * mass, colour="black"),
        box((0.2, 0.3, 0.36), at=(0, 0, 0.31), mass=0.355 * mass, colour="white"),
    )
    stiffness, feet = {}, {}
    for side, out in SIDES:
        thigh = shank = 0.245 * height
        sole = (0.152 * height, 0.055 * height)
        joints = add_leg(
            robot, side, out, "pelvis", (0, out * 0.0955 * height * 0.7, 0), thigh, shank, 0.039 * height, sole,
            masses=(0.1 * mass, 0.0465 * mass, 0.0145 * mass), efforts=(80, 150, 200, 250, 150, 80), speed=12, thick=0.055,
        )  # fmt: skip
        feet[side] = {"frame": f"{side}_sole", "joints": joints, "sole": sole}
        stiffness |= dict(zip(joints, (400, 1500, 1500, 1500, 1000, 600)))
    return robot, Profile(
        title="Biped of twelve joints",
        sources=[WINTER],
        home="standing",
        poses={
            "standing": bent("left", 0.35) | bent("right", 0.35),
            "straight": {},
            "squatting": bent("left", 0.9) | bent("right", 0.9),
        },
        stiffness=stiffness,
        floating=True,
        feet=feet,
    )


def humanoid():
    height, mass = 0.945, 31.0
    robot = Robot(
        "humanoid",
        f"""
A humanoid of the size and mass of COMAN: legs of six joints, a waist of three, arms of seven, a neck of two; 31 joints.
Roll about x, pitch about y, yaw about z. All joints at zero: legs straight, arms straight down.

Height, mass, largest torque: N. G. Tsagarakis and others, "COMpliant huMANoid COMAN: Optimal Joint Stiffness Tuning for
  Modal Frequency Control", IEEE ICRA 2013 (945 mm, 31 kg, 55 N m).
Assumptions: ranges, speeds and the torques of the weaker joints; three more joints in each arm than COMAN, and a neck.
Lengths and masses of the segments in proportion: {WINTER}.
Bodies of uniform density, and original shells for display.
""",
    )
    robot.link("pelvis", box((0.1, 0.16, 0.08), at=(0, 0, 0.02), mass=0.142 * mass - 0.6, colour="black"))
    stiffness, feet, ends, poses = {}, {}, {}, {"standing": {}, "straight": {}, "squatting": {}, "reaching": {}}
    for side, out in SIDES:
        thigh = shank = 0.245 * height
        sole = (0.2, 0.09)
        joints = add_leg(
            robot, side, out, "pelvis", (0, out * 0.0725, -0.03), thigh, shank, 0.06, sole,
            masses=(0.1 * mass, 0.0465 * mass, 0.0145 * mass + 0.3), efforts=(40, 55, 55, 55, 55, 40), speed=9, thick=0.04,
        )  # fmt: skip
        feet[side] = {"frame": f"{side}_sole", "joints": joints, "sole": sole}
        stiffness |= dict(zip(joints, (150, 600, 600, 600, 500, 300)))
        for pose, angle in (("standing", 0.3), ("squatting", 0.8), ("reaching", 0.45)):
            poses[pose] |= bent(side, angle)
    waist = [
        ("waist_yaw", (0, 0, 1), "waist_yaw_link", (0, 0, 0.06), 1.2, cylinder(0.04, 0.03, at=(0, 0, 0.015), mass=0.4, colour="black")),
        ("waist_roll", (1, 0, 0), "waist_roll_link", (0, 0, 0.04), 0.4, sphere(0.04, mass=0.5, colour="black")),
        ("waist_pitch", (0, 1, 0), "torso", (0, 0, 0), 0.6, box((0.13, 0.18, 0.2), at=(0, 0, 0.12), mass=0.355 * mass - 0.9)),
    ]
    parent = "pelvis"
    for name, axis, child, at, reach, solid in waist:
        robot.joint(name, "revolute", parent, child, at=at, axis=axis, lower=-reach, upper=reach, velocity=9, effort=55)
        parent = robot.link(child, solid)
    stiffness |= {"waist_yaw": 300, "waist_roll": 600, "waist_pitch": 600}
    for side, out in SIDES:
        upper_arm, forearm, hand = 0.028 * mass, 0.016 * mass, 0.006 * mass
        joints = add_arm(
            robot, side, out, "torso", (0, out * 0.122, 0.18), upper=0.186 * height, lower=0.146 * height, hand=0.09,
            masses=(0.3 * upper_arm, 0.3 * upper_arm, 0.4 * upper_arm, 0.6 * forearm, 0.3 * forearm, 0.1 * forearm, hand),
            efforts=(40, 40, 30, 40, 15, 10, 10), thick=0.03, speed=9,
        )  # fmt: skip
        robot.frame(f"{side}_palm", f"{side}_hand", at=(0, 0, -0.06))
        ends[f"{side}_hand"] = {"frame": f"{side}_palm", "joints": joints}
        stiffness |= dict(zip(joints, (80, 80, 30, 50, 6, 6, 4)))
        poses["standing"] |= {f"{side}_shoulder_pitch": 0.15, f"{side}_shoulder_roll": out * 0.2, f"{side}_elbow": -0.5}
        poses["squatting"] |= {f"{side}_shoulder_pitch": -0.6, f"{side}_shoulder_roll": out * 0.2, f"{side}_elbow": -0.6}
        poses["reaching"] |= {f"{side}_shoulder_pitch": -0.9, f"{side}_shoulder_roll": out * 0.15, f"{side}_elbow": -0.9}
    robot.joint("neck_yaw", "revolute", "torso", "neck", at=(0, 0, 0.235), lower=-1.4, upper=1.4, velocity=6, effort=10)
    robot.link("neck", cylinder(0.025, 0.04, at=(0, 0, 0.02), mass=0.3, colour="black"))
    robot.joint("neck_pitch", "revolute", "neck", "head", at=(0, 0, 0.04), axis=(0, 1, 0), lower=-0.6, upper=0.8, velocity=6, effort=10)
    robot.link("head", sphere(0.065, at=(0.01, 0, 0.06), mass=0.081 * mass - 0.3))
    robot.frame("gaze", "head", at=(0.075, 0, 0.065))
    stiffness |= {"neck_yaw": 15, "neck_pitch": 30}
    ends["gaze"] = {"frame": "gaze", "joints": ["neck_yaw", "neck_pitch"]}
    robot.dress(humanoid_shells.parts())
    return robot, Profile(
        title="Humanoid of the COMAN class with two arms of seven joints",
        sources=[
            "Tsagarakis and others: COMpliant huMANoid COMAN: Optimal Joint Stiffness Tuning for Modal Frequency Control, "
            "IEEE ICRA 2013 (height, mass, largest torque)",
            "own figures: ranges, speeds, weaker torques",
            WINTER,
        ],
        home="standing",
        poses=poses,
        stiffness=stiffness,
        floating=True,
        end_effectors=ends,
        feet=feet,
    )


ROBOTS = [planar_biped, biped, humanoid]
