"""Shells of the Panda, in the axes of its links. Its handwritten URDF refers to them.

Lengths from joint to joint are from the URDF; the shapes between them are original.
"""

from bodies import ALONG_Y
from shells import Part, block, drum, loft, revolved, ring

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
# Radius of shoulder and elbow, half the width of the parts that rotate in them, radius of the seams.
LARGE, HALF, SEAM = 0.0605, 0.062, 0.056
# Radius of the wrist.
SMALL = 0.0465


def cap(radius, low, high, swell=0.012):
    """Returns a drum about z from a sharp edge to a domed end."""
    return revolved([(0, low), (radius, low), (radius, high - swell, 1.4 * swell), (0.72 * radius, high, 0.03), (0, high)])


def caps(radius, low, high):
    one = cap(radius, low, high)
    return one + one.scaled(1, 1, -1)


def base():
    tower = loft(
        [
            ((-0.032, 0, 0.004), 0.104, 0.092, 3.6),
            ((-0.032, 0, 0.03), 0.103, 0.091, 3.4),
            ((-0.016, 0, 0.075), 0.084, 0.078, 2.6),
            ((-0.001, 0, 0.112), 0.066, 0.066, 2.0),
            ((0, 0, 0.135), 0.064, 0.064, 2.0),
        ],
        X, Y, 28, 3, (0.004, 0.96), (0.003, 0.93),
    )  # fmt: skip
    plugs = block((0.02, 0.11, 0.042), 0.004, (-0.13, 0, 0.026), around=16)
    return {"link0": tower, "link0_dark": plugs + ring(0.059, 0.13, 0.146)}


def column():
    tube = loft(
        [
            ((0, 0, -0.186), 0.064, 0.064, 2.0),
            ((0, 0, -0.14), 0.0625, 0.0625, 2.0),
            ((0, 0, -0.08), 0.059, 0.062, 2.1),
            ((0, 0, -0.03), 0.056, 0.061, 2.4),
        ],
        X, Y, 24, 3, (0.003, 0.93),
    )  # fmt: skip
    middle = drum(LARGE, -HALF, HALF, 0.003, 24).moved(rpy=ALONG_Y)
    return {"link1": tube + middle, "link1_dark": ring(SEAM, -HALF - 0.01, HALF + 0.01, 24).moved(rpy=ALONG_Y)}


def shoulder():
    up = loft(
        [
            ((0, -0.03, 0), 0.042, 0.096, 2.8),
            ((0, -0.07, 0), 0.047, 0.092, 2.5),
            ((0, -0.115, 0), 0.054, 0.07, 2.1),
            ((0, -0.163, 0), 0.057, 0.057, 2.0),
        ],
        X, Z, 24, 3, (0.02, 0.5), (0.003, 0.93),
    )  # fmt: skip
    return {"link2": caps(LARGE, HALF + 0.008, 0.119), "link2_column": up}


def elbow():
    bend = loft(
        [
            ((0, 0, -0.146), 0.057, 0.057, 2.0),
            ((0, 0, -0.105), 0.057, 0.058, 2.0),
            ((0.016, 0, -0.055), 0.056, 0.06, 2.2),
            ((0.05, 0, -0.014), 0.05, 0.06, 2.5),
            ((0.0825, 0, 0), 0.044, 0.058, 2.6),
        ],
        (X, (0, 0, -1)), (Y, Y), 24, 3, (0.003, 0.93),
    )  # fmt: skip
    middle = drum(LARGE - 0.003, -HALF + 0.002, HALF - 0.002, 0.003, 24).moved((0.0825, 0, 0), ALONG_Y)
    seams = ring(0.053, -0.157, -0.14, 24) + ring(SEAM - 0.003, -HALF - 0.01, HALF + 0.01, 24).moved((0.0825, 0, 0), ALONG_Y)
    return {"link3": bend, "link3_elbow": middle, "link3_dark": seams}


def upper_forearm():
    bend = loft(
        [
            ((0.004, -0.004, 0), 0.044, 0.094, 2.8),
            ((-0.034, 0.014, 0), 0.049, 0.09, 2.5),
            ((-0.07, 0.052, 0), 0.056, 0.07, 2.2),
            ((-0.0825, 0.096, 0), 0.057, 0.057, 2.0),
        ],
        (Y, X), (Z, Z), 24, 3, (0.02, 0.5), (0.003, 0.93),
    )  # fmt: skip
    return {"link4": caps(LARGE - 0.003, HALF + 0.008, 0.115), "link4_bend": bend}


def forearm():
    upper = loft(
        [
            ((0, 0, -0.279), 0.057, 0.057, 2.0),
            ((0, 0, -0.235), 0.056, 0.057, 2.0),
            ((0, 0.008, -0.19), 0.052, 0.056, 2.1),
            ((0, 0.026, -0.145), 0.045, 0.045, 2.2),
            ((0, 0.044, -0.105), 0.04, 0.035, 2.3),
        ],
        X, Y, 24, 3, (0.003, 0.93),
    )  # fmt: skip
    lower = loft(
        [
            ((0, 0.044, -0.105), 0.04, 0.035, 2.3),
            ((0, 0.056, -0.065), 0.038, 0.03, 2.4),
            ((0, 0.06, -0.025), 0.039, 0.028, 2.4),
            ((0, 0.06, 0.0), 0.038, 0.026, 2.4),
        ],
        X, Y, 24, 3,
    )  # fmt: skip
    wrist = cap(SMALL, 0.034, 0.09, 0.01).moved(rpy=(-ALONG_Y[0], 0, 0))
    seams = ring(0.053, -0.292, -0.272, 24) + ring(0.043, -0.04, 0.04, 24).moved(rpy=ALONG_Y)
    return {"link5": upper, "link5_blade": lower, "link5_wrist": wrist, "link5_dark": seams}


def wrist():
    hub = cap(SMALL, -0.026, 0.062, 0.01)
    bridge = loft(
        [
            ((0.0, 0, 0.014), 0.04, 0.036, 2.6),
            ((0.04, 0, 0.01), 0.038, 0.036, 2.6),
            ((0.088, 0, 0), 0.036, 0.04, 2.4),
        ],
        Y, Z, 24, 3,
    )  # fmt: skip
    head = cap(0.0455, -0.02, 0.062, 0.01).moved((0.088, 0, 0), (-ALONG_Y[0], 0, 0))
    return {
        "link6": hub,
        "link6_head": bridge + head,
        "link6_dark": ring(0.042, -0.03, 0.02, 24).moved((0.088, 0, 0), (-ALONG_Y[0], 0, 0)),
    }


def flange():
    body = revolved([(0, 0.026), (0.0455, 0.026), (0.0455, 0.07, 0.012), (0.04, 0.084, 0.008), (0, 0.084)], 24)
    return {"link7": body, "link7_dark": drum(0.034, 0.08, 0.107, 0.003)}


def hand():
    body = loft(
        [
            ((0, 0, 0.004), 0.032, 0.042, 2.2),
            ((0, 0, 0.014), 0.0315, 0.066, 2.8),
            ((0, 0, 0.028), 0.031, 0.096, 4.0),
            ((0, 0, 0.044), 0.03, 0.102, 5.0),
            ((0, 0, 0.058), 0.0285, 0.102, 5.0),
        ],
        X, Y, 28, 3, (0.004, 0.9), (0.007, 0.8),
    )  # fmt: skip
    rail = block((0.022, 0.176, 0.01), 0.003, (0, 0, 0.0622), around=16)
    return {"hand": body, "hand_dark": rail}


def finger():
    carriage = block((0.021, 0.024, 0.022), 0.003, (0, 0.0135, 0.011), around=16)
    tip = loft(
        [
            ((0, 0.0105, 0.016), 0.01, 0.0105, 5.0),
            ((0, 0.0098, 0.028), 0.0098, 0.0098, 5.0),
            ((0, 0.0068, 0.04), 0.0095, 0.0068, 5.0),
            ((0, 0.0058, 0.051), 0.0095, 0.0058, 5.0),
        ],
        X, Y, 16, 3, end=(0.003, 0.75),
    )  # fmt: skip
    return carriage + tip


def parts():
    """The parts of every link: those at the place of a collision shape first, in its colour."""
    makers = {
        "panda_link0": base, "panda_link1": column, "panda_link2": shoulder, "panda_link3": elbow, "panda_link4": upper_forearm,
        "panda_link5": forearm, "panda_link6": wrist, "panda_link7": flange, "panda_hand": hand,
    }  # fmt: skip
    found = {
        link: [Part(name, "black" if name.endswith("_dark") else "white", shell) for name, shell in make().items()]
        for link, make in makers.items()
    }
    found["panda_leftfinger"] = [Part("finger", "black", finger())]
    found["panda_rightfinger"] = [Part("finger", "black", finger(), (1, -1, 1))]
    return found
