"""Shells of the UR5e, in the axes of its links.

Lengths from joint to joint are from its DH parameters; the shapes between them are original.
"""

from math import pi

from shells import Part, drum, loft, revolved, ring

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
# Rotations of the z axis to y and to -y.
TO_Y, FROM_Y = (-pi / 2, 0, 0), (pi / 2, 0, 0)
LARGE, MIDDLE, SMALL = 0.06, 0.052, 0.0415
UPPER, FORE = 0.425, 0.3922


def lid(radius, low, high):
    """Returns the cap at the end of a joint: a disc with a rounded edge."""
    return revolved([(0, low), (radius, low), (radius, 0.4 * low + 0.6 * high, 0.009), (0.8 * radius, high, 0.02), (0, high)])


def tube(length, height, ends, middle):
    """Returns a tube along -x that widens towards the joints."""
    stations = [
        ((-0.02, 0, height), ends, ends, 2.2),
        ((-0.085, 0, height), middle + 0.002, middle + 0.002, 2.0),
        ((-0.5 * length, 0, height), middle, middle, 2.0),
        ((0.085 - length, 0, height), middle + 0.001, middle + 0.001, 2.0),
        ((0.02 - length, 0, height), ends - 0.004, ends - 0.004, 2.2),
    ]
    return loft(stations, Y, Z, 24, 4)


def base():
    foot = revolved(
        [(0, 0), (0.0745, 0, 0.003), (0.0745, 0.028, 0.008), (0.064, 0.045, 0.02), (LARGE, 0.0885, 0.002), (0, 0.0885)], 28
    )
    plug = drum(0.016, 0, 0.022, 0.003, 14).moved((-0.06, 0, 0.03), (0, -pi / 2, 0))
    return {"base": ("grey", foot), "base_dark": ("black", ring(0.0555, 0.08, 0.105, 24) + plug)}


def shoulder():
    body = revolved([(0, -0.066), (LARGE - 0.001, -0.066, 0.003), (LARGE - 0.001, -0.01, 0.06), (0.042, 0.03), (0, 0.03)], 28)
    through = drum(LARGE, -0.056, 0.0605, 0.002, 28).moved(rpy=FROM_Y)
    return {
        "shoulder": ("grey", body + through),
        "shoulder_cap": ("blue", lid(LARGE - 0.003, 0.057, 0.074).moved(rpy=TO_Y)),
        "shoulder_dark": ("black", ring(0.0555, 0.05, 0.075, 24).moved(rpy=FROM_Y)),
    }


def upper_arm():
    at = (-UPPER, 0, 0)
    seams = ring(0.048, 0.055, 0.08, 24).moved(at)
    lids = lid(LARGE - 0.003, 0.193, 0.21) + lid(MIDDLE - 0.002, 0.187, 0.202).moved(at)
    return {
        "upper_arm": ("grey", drum(LARGE, 0.069, 0.192, 0.003, 28)),
        "upper_arm_tube": ("white", tube(UPPER, 0.136, 0.054, 0.047)),
        "upper_arm_elbow": ("grey", drum(MIDDLE, 0.072, 0.186, 0.003, 28).moved(at)),
        "upper_arm_caps": ("blue", lids),
        "upper_arm_dark": ("black", seams),
    }


def forearm():
    at = (-FORE, 0, 0)
    lids = lid(MIDDLE - 0.002, 0.051, 0.066).scaled(1, 1, -1) + lid(SMALL - 0.002, 0.041, 0.053).scaled(1, 1, -1).moved(at)
    joints = drum(MIDDLE, -0.05, 0.063, 0.003, 28) + drum(SMALL, -0.04, 0.07, 0.003).moved(at)
    return {
        "forearm": ("white", tube(FORE, 0.007, 0.043, 0.037)),
        "forearm_joints": ("grey", joints),
        "forearm_caps": ("blue", lids),
        "forearm_dark": ("black", ring(0.0375, 0.06, 0.085).moved(at)),
    }


def wrist(number, turn):
    """Returns a joint about z with its output along y or -y; `turn` rotates z to that axis."""
    body = drum(SMALL, -0.0555, 0.043, 0.003) + drum(SMALL - 0.001, 0, 0.044, 0.002).moved(rpy=turn)
    return {
        f"wrist_{number}": ("grey", body),
        f"wrist_{number}_cap": ("blue", lid(SMALL - 0.002, 0.044, 0.057)),
        f"wrist_{number}_dark": ("black", ring(0.0375, 0.035, 0.06).moved(rpy=turn)),
    }


def tool():
    wide = SMALL - 0.003
    flange = revolved([(0, -0.0455), (wide, -0.0455), (wide, -0.012, 0.004), (0.0315, -0.008), (0.0315, 0, 0.001), (0, 0)])
    return {"wrist_3": ("black", flange)}


def parts():
    """The parts of every link: those at the place of a collision shape first, in its colour."""
    links = {
        "base_link_inertia": base(), "shoulder_link": shoulder(), "upper_arm_link": upper_arm(), "forearm_link": forearm(),
        "wrist_1_link": wrist(1, FROM_Y), "wrist_2_link": wrist(2, TO_Y), "wrist_3_link": tool(),
    }  # fmt: skip
    return {link: [Part(name, *part) for name, part in shells.items()] for link, shells in links.items()}
