"""Wheeled robots, and one with rotors."""

from math import atan2, sqrt

from bodies import ALONG_Y, Robot, box, cylinder, diagonal, sphere
from profile import Profile

SIDES = (("left", 1), ("right", -1))


def differential_drive():
    robot = Robot(
        "differential-drive",
        """
A small robot with two driven wheels and a caster ball, of the size and mass of the TurtleBot3 Burger. The base frame is between
the wheels' centres, x ahead.

Size (138 x 178 x 192 mm), mass (1 kg), wheels (radius 33 mm, 160 mm apart), speed (0.22 m/s): ROBOTIS e-Manual,
  TurtleBot3 Burger. Torque of the wheels (1.4 N m): ROBOTIS e-Manual, XL430-W250.
Bodies of uniform density. The tyres have a crown: each touches the ground at its middle.
""",
    )
    radius, track, caster = 0.033, 0.16, 0.0075
    robot.link(
        "base",
        box((0.138, 0.1, 0.05), at=(-0.032, 0, 0.015), mass=0.5, colour="black"),
        box((0.13, 0.13, 0.08), at=(-0.032, 0, 0.08), mass=0.3, colour="grey"),
        cylinder(0.035, 0.039, at=(-0.032, 0, 0.1395), mass=0.13, colour="black"),
    )
    wheels = []
    for side, out in SIDES:
        robot.joint(
            f"{side}_wheel", "continuous", "base", f"{side}_wheel_link", at=(0, out * track / 2, 0), axis=(0, 1, 0), velocity=6.67, effort=1.4
        )
        robot.link(f"{side}_wheel_link", cylinder(radius, 0.018, rpy=ALONG_Y, mass=0.0285, colour="blue", crowned=True))
        wheels.append(f"{side}_wheel")
    robot.joint("caster_joint", "fixed", "base", "caster", at=(-0.081, 0, caster - radius))
    robot.link("caster", sphere(caster, mass=0.013, colour="grey"))
    robot.frame("scan", "base", at=(-0.032, 0, 0.14))
    return robot, Profile(
        title="Differential drive of the TurtleBot3 class",
        sources=["ROBOTIS e-Manual: TurtleBot3 Burger (size, mass, wheels, speed), XL430-W250 (torque)"],
        home="parked",
        poses={"parked": {}},
        speed_gains={wheel: 0.05 for wheel in wheels},
        floating=True,
        feet={"caster": {"frame": "caster", "radius": caster, "friction": 0.0}},
        mobile_base={"drive": "differential", "frame": "base", "wheels": wheels, "wheel_radius": radius, "track": track},
    )


def ackermann():
    robot = Robot(
        "ackermann",
        """
A 1:10 car as raced in F1TENTH: two steered front wheels, and all four wheels driven. The base frame is
between the rear wheels' centres, x ahead.

Mass (3.74 kg), wheelbase (0.159 + 0.171 m), width (0.31 m), length (0.58 m), height of the centre of mass (0.074 m),
  steering (0.4189 rad, 3.2 rad/s), speed (20 m/s): M. O'Kelly and others, "F1TENTH: An Open-source Evaluation Environment
  for Continuous Control and Reinforcement Learning", PMLR 123, 2020, and the simulator published with it.
Wheels (radius 0.05 m, 0.1 kg) and the mass distribution are estimates.
""",
    )
    front, rear, radius, track = 0.15875, 0.17145, 0.05, 0.26
    base = front + rear
    wheel, knuckle = 0.1, 0.03
    chassis = 3.74 - 4 * wheel - 2 * knuckle
    # The whole car's centre of mass is `rear` ahead of the rear axle, 0.074 m above the ground.
    com_x = (3.74 * rear - 2 * (wheel + knuckle) * base) / chassis
    com_z = (3.74 * (0.074 - radius)) / chassis
    robot.link(
        "base",
        box((0.45, 0.16, 0.07), at=(com_x, 0, com_z), mass=chassis, colour="blue"),
        box((0.04, 0.25, 0.05), at=(0.415, 0, 0), colour="black"),
        box((0.03, 0.25, 0.05), at=(-0.08, 0, 0), colour="black"),
    )
    wheels, steering, stiffness = [], [], {}
    for end, x in (("front", base), ("rear", 0.0)):
        for side, out in SIDES:
            name = f"{end}_{side}"
            parent, at = "base", (x, out * track / 2, 0)
            if end == "front":
                robot.joint(
                    f"{name}_steering", "revolute", parent, f"{name}_knuckle", at=at, lower=-0.4189, upper=0.4189, velocity=3.2, effort=3.0
                )
                parent, at = robot.link(f"{name}_knuckle", box((0.02, 0.02, 0.04), mass=knuckle, colour="grey")), (0, 0, 0)
                steering.append(f"{name}_steering")
                stiffness[f"{name}_steering"] = 10.0
            robot.joint(f"{name}_wheel", "continuous", parent, f"{name}_wheel_link", at=at, axis=(0, 1, 0), velocity=400, effort=2.0)
            robot.link(f"{name}_wheel_link", cylinder(radius, 0.045, rpy=ALONG_Y, mass=wheel, colour="black"))
            wheels.append(f"{name}_wheel")
    # The axes of both front wheels intersect 0.9 m to the left of the rear axle's middle.
    turn = {joint: round(atan2(base, 0.9 - out * track / 2), 6) for joint, (_, out) in zip(steering, SIDES)}
    return robot, Profile(
        title="Ackermann-steered car of the F1TENTH class",
        sources=[
            "O'Kelly and others: F1TENTH: An Open-source Evaluation Environment for Continuous Control and Reinforcement Learning, "
            "PMLR 123, 2020, and the simulator published with it",
        ],
        home="parked",
        poses={"parked": {}, "left_turn": turn},
        stiffness=stiffness,
        speed_gains={name: 0.02 for name in wheels},
        floating=True,
        mobile_base={
            "drive": "ackermann", "frame": "base", "wheels": wheels, "steering": steering, "wheel_radius": radius, "track": track,
            "wheelbase": base,
        },
    )


def quadrotor():
    robot = Robot(
        "quadrotor",
        """
A quadrotor of the size and mass of the Crazyflie 2.0 in X configuration, x ahead. It has no joints: each rotor pulls
along the z axis of its frame.

Mass (28 g), inertia, torque per thrust (0.005964552 m): J. Förster, "System Identification of the Crazyflie 2.0 Nano
  Quadrocopter", bachelor's thesis, ETH Zurich, 2015. Motors 92 mm apart along the diagonals, 0.15 N each at most:
  Bitcraze, Crazyflie 2.0 data sheet (thrust rounded down).
""",
    )
    arm = 0.046 / sqrt(2.0)
    rods = [cylinder(0.003, 0.092, rpy=(1.5707963267948966, 0, turn), colour="black") for turn in (0.7853981633974483, -0.7853981633974483)]
    rotors, solids = {}, []
    for end, fore in (("front", 1), ("rear", -1)):
        for side, out in SIDES:
            at = (fore * arm, out * arm, 0.008)
            solids.append(cylinder(0.0035, 0.02, at=(at[0], at[1], -0.002), colour="grey"))
            solids.append(cylinder(0.0225, 0.002, at=at, colour="blue"))
            rotors[f"{end}_{side}"] = {
                "frame": f"{end}_{side}_rotor",
                "spin": "clockwise" if fore == out else "counterclockwise",
                "max_thrust": 0.15,
                "torque_per_thrust": 0.005964552,
                "at": at,
            }
    robot.link(
        "base",
        box((0.032, 0.03, 0.02), colour="white"),
        *rods,
        *solids,
        published=(0.028, (0, 0, 0), diagonal(16.571710e-6, 16.655602e-6, 29.261652e-6)),
    )
    for rotor in rotors.values():
        robot.frame(rotor["frame"], "base", at=rotor.pop("at"))
    return robot, Profile(
        title="Quadrotor of the Crazyflie 2.0 class",
        sources=[
            "Förster: System Identification of the Crazyflie 2.0 Nano Quadrocopter, bachelor's thesis, ETH Zurich, 2015",
            "Bitcraze: Crazyflie 2.0 data sheet (size)",
        ],
        home="hovering",
        poses={"hovering": {}, "landed": {}},
        heights={"hovering": 1.0, "landed": 0.012},
        floating=True,
        rotors=rotors,
    )


ROBOTS = [differential_drive, ackermann, quadrotor]
