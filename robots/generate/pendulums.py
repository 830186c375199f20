"""Small textbook mechanisms."""

from math import pi

from bodies import Robot, box, cylinder
from profile import Profile


def double_pendulum():
    robot = Robot(
        "double-pendulum",
        """
Two equal rods that hang along -z at q = 0 and rotate about y without limits: each a uniform cylinder of 1 kg, 0.5 m and
radius 0.02 m.
""",
    )
    robot.link("base")
    parent, at = "base", (0, 0, 0)
    for name, rod in (("shoulder", "upper_rod"), ("elbow", "lower_rod")):
        robot.joint(name, "continuous", parent, rod, at=at, axis=(0, 1, 0), velocity=20, effort=10, damping=0.01)
        robot.link(rod, cylinder(0.02, 0.5, at=(0, 0, -0.25), mass=1.0, colour="blue"))
        parent, at = rod, (0, 0, -0.5)
    robot.frame("tip", "lower_rod", at=(0, 0, -0.5))
    joints = ["shoulder", "elbow"]
    return robot, Profile(
        title="Double pendulum: two driven rods",
        sources=["Uniform cylinders, 1 kg, 0.5 m, radius 0.02 m"],
        home="hanging",
        poses={"hanging": {}, "level": {"shoulder": pi / 2}, "upright": {"shoulder": pi}},
        stiffness={"shoulder": 60, "elbow": 25},
        end_effectors={"tip": {"frame": "tip", "joints": joints}},
    )


def acrobot():
    robot = Robot(
        "acrobot",
        """
The acrobot: a double pendulum driven only at the elbow. It hangs along -z at q = 0. Uniform rods: 1 kg and 1 m above,
1 kg and 2 m below, so that m l^2 / 12 is 0.083 and 0.333 kg m2 apart from the thickness.
Masses, lengths and damping: R. Tedrake, "Underactuated Robotics", the acrobot's swing-up.
""",
    )
    robot.link("base")
    robot.joint("shoulder", "continuous", "base", "upper_rod", axis=(0, 1, 0), damping=0.1)
    robot.link("upper_rod", cylinder(0.03, 1.0, at=(0, 0, -0.5), mass=1.0, colour="grey"))
    robot.joint(
        "elbow", "continuous", "upper_rod", "lower_rod", at=(0, 0, -1), axis=(0, 1, 0), velocity=30, effort=25, damping=0.1
    )
    robot.link("lower_rod", cylinder(0.03, 2.0, at=(0, 0, -1), mass=1.0, colour="orange"))
    robot.frame("tip", "lower_rod", at=(0, 0, -2))
    return robot, Profile(
        title="Acrobot: a double pendulum driven at the elbow",
        sources=[
            "M. W. Spong: The Swing Up Control Problem for the Acrobot, IEEE Control Systems Magazine 15(1), 1995",
            "R. Tedrake: Underactuated Robotics (masses, lengths, damping)",
        ],
        home="hanging",
        poses={"hanging": {}, "upright": {"shoulder": pi}},
        passive=["shoulder"],
        stiffness={"elbow": 30},
        end_effectors={"tip": {"frame": "tip", "joints": ["shoulder", "elbow"]}},
    )


def cart_pole():
    robot = Robot(
        "cart-pole",
        """
A cart on a rail along x, and a pole that swings on it about y; the pole hangs along -z at q = 0 and stands at pi.
Masses, length, force and rail: A. G. Barto, R. S. Sutton, C. W. Anderson, "Neuronlike Adaptive Elements That Can Solve
Difficult Learning Control Problems", IEEE Transactions on Systems, Man, and Cybernetics 13(5), 1983. The pole is a
uniform rod.
""",
    )
    robot.link("base", cylinder(0.01, 5.4, rpy=(0, pi / 2, 0), colour="grey"))
    robot.joint(
        "slider", "prismatic", "base", "cart", axis=(1, 0, 0), lower=-2.4, upper=2.4, velocity=10, effort=10, damping=0.0005
    )
    robot.link("cart", box((0.4, 0.2, 0.15), mass=1.0, colour="blue"))
    robot.joint("hinge", "continuous", "cart", "pole", at=(0, -0.12, 0), axis=(0, 1, 0), damping=0.000002)
    robot.link("pole", cylinder(0.015, 1.0, at=(0, 0, -0.5), mass=0.1, colour="orange"))
    robot.frame("tip", "pole", at=(0, 0, -1))
    return robot, Profile(
        title="Cart-pole: a pole on a driven cart",
        sources=[
            "Barto, Sutton, Anderson: Neuronlike Adaptive Elements That Can Solve Difficult Learning Control Problems, "
            "IEEE Trans. SMC 13(5), 1983",
        ],
        home="hanging",
        poses={"hanging": {}, "upright": {"hinge": pi}, "tilted": {"hinge": pi - 0.2}},
        passive=["hinge"],
        stiffness={"slider": 20},
        end_effectors={"tip": {"frame": "tip", "joints": ["slider", "hinge"]}},
    )


def rrbot():
    robot = Robot(
        "rrbot",
        """
RRBot, the two-joint arm of the Gazebo and ros2_control tutorials: a post of 2 m, two arms of 1 m that rotate about y
next to it. Square bars of 0.1 m and 1 kg each, axles 0.05 m from the ends. Upright at q = 0.
""",
    )
    width, tall, arm, axle, mass = 0.1, 2.0, 1.0, 0.05, 1.0
    robot.link("world")
    robot.joint("fixed", "fixed", "world", "link1")
    robot.link("link1", box((width, width, tall), at=(0, 0, tall / 2), mass=mass, colour="orange"))
    limits = dict(axis=(0, 1, 0), velocity=10, effort=100, damping=0.7)
    robot.joint("joint1", "continuous", "link1", "link2", at=(0, width, tall - axle), **limits)
    robot.link("link2", box((width, width, arm), at=(0, 0, arm / 2 - axle), mass=mass, colour="black"))
    robot.joint("joint2", "continuous", "link2", "link3", at=(0, width, arm - 2 * axle), **limits)
    robot.link("link3", box((width, width, arm), at=(0, 0, arm / 2 - axle), mass=mass, colour="orange"))
    robot.frame("tool_link", "link3", at=(0, 0, arm - axle))
    joints = ["joint1", "joint2"]
    return robot, Profile(
        title="RRBot: two joints in a vertical plane",
        sources=["gazebo_ros_demos and ros2_control_demos tutorials (sizes, masses, damping)"],
        home="bent",
        poses={"upright": {}, "bent": {"joint1": pi / 4, "joint2": pi / 2}, "hanging": {"joint1": pi}},
        stiffness={"joint1": 200, "joint2": 100},
        end_effectors={"tool": {"frame": "tool_link", "joints": joints}},
    )


ROBOTS = [double_pendulum, acrobot, cart_pole, rrbot]
