"""Shells of the quadruped, in the axes of its links: the front left leg, mirrored for the other legs."""

from math import pi

from shells import Part, block, drum, loft, revolved, ring

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
TO_X, TO_Y = (0, pi / 2, 0), (-pi / 2, 0, 0)
SHIN = 0.16


def trunk():
    hull = loft(
        [
            ((-0.186, 0, 0.002), 0.050, 0.024, 3.0),
            ((-0.14, 0, 0.002), 0.060, 0.033, 3.4),
            ((-0.05, 0, 0.003), 0.060, 0.037, 3.6),
            ((0.06, 0, 0.003), 0.060, 0.037, 3.6),
            ((0.14, 0, 0.002), 0.060, 0.034, 3.4),
            ((0.186, 0, 0), 0.050, 0.026, 3.0),
        ],
        Y, Z, 32, 3, (0.016, 0.5), (0.012, 0.72),
    )  # fmt: skip
    face = loft(
        [((0.188, 0, -0.001), 0.044, 0.022, 3.0), ((0.203, 0, -0.001), 0.041, 0.0195, 3.0)], Y, Z, 24, 1, end=(0.006, 0.8)
    )
    eyes = [drum(0.0085, 0, 0.006, 0.002, 16).moved((0.205, y, 0.001), TO_X) for y in (-0.022, 0.022)]
    belly = block((0.27, 0.092, 0.026), 0.009, (0, 0, -0.028))
    mast = revolved([(0, 0), (0.026, 0, 0.001), (0.024, 0.012, 0.004), (0.021, 0.022, 0.006), (0, 0.024)], 20)
    strips = [block((0.17, 0.006, 0.013), 0.0025, (0, y, 0.004), around=12) for y in (-0.059, 0.059)]
    rails = [drum(0.004, -0.055, 0.055, 0.002, 10).moved((-0.03, y, 0.044), TO_X) for y in (-0.038, 0.038)]
    feet = [block((0.008, 0.008, 0.012), 0.001, (x, y, 0.04), around=8) for x in (-0.075, 0.015) for y in (-0.038, 0.038)]
    dark = sum([belly, mast.moved((0.105, 0, 0.036)), *strips], face)
    metal = sum([*eyes, *rails, *feet[1:]], feet[0])
    return [("base", "white", hull), ("base_dark", "black", dark), ("base_metal", "grey", metal)]


def hip():
    motor = drum(0.0285, -0.1, -0.008, 0.006, 24).moved(rpy=TO_X)
    arm = loft([((-0.03, 0.004, 0), 0.024, 0.024, 2.6), ((-0.002, 0.006, 0), 0.022, 0.022, 2.2)], Y, Z, 20, 2, end=(0.012, 0.6))
    rim = ring(0.0292, -0.058, -0.05, 24).moved(rpy=TO_X)
    return [("hip", "black", motor + arm), ("hip_metal", "grey", rim)]


def thigh():
    motor = drum(0.0305, 0.004, 0.03, 0.004, 24).moved(rpy=TO_Y)
    knee = drum(0.0165, 0.018, 0.038, 0.003, 20).moved((0, 0, -SHIN), TO_Y)
    plate = loft(
        [
            ((0, 0.031, 0.012), 0.023, 0.0125, 2.6),
            ((0.001, 0.032, -0.02), 0.0255, 0.014, 2.8),
            ((0.003, 0.031, -0.07), 0.0205, 0.0125, 2.8),
            ((0.002, 0.029, -0.12), 0.0155, 0.0105, 2.8),
            ((0, 0.0285, -0.158), 0.0155, 0.0095, 2.6),
        ],
        X, Y, 20, 3, (0.013, 0.4), (0.012, 0.4),
    )  # fmt: skip
    lid = revolved([(0, 0.04), (0.017, 0.04), (0.017, 0.046, 0.003), (0.011, 0.049), (0, 0.049)], 20).moved(rpy=TO_Y)
    return [("thigh", "black", motor + knee), ("thigh_plate", "white", plate), ("thigh_metal", "grey", lid)]


def shank():
    shaft = loft(
        [
            ((0, 0.008, 0.006), 0.0135, 0.0075, 2.4),
            ((0.002, 0.008, -0.02), 0.0125, 0.0078, 2.4),
            ((0.005, 0.008, -0.065), 0.0098, 0.0072, 2.2),
            ((0.003, 0.008, -0.115), 0.0078, 0.0068, 2.0),
            ((0, 0.008, -0.148), 0.0075, 0.0075, 2.0),
        ],
        X, Y, 20, 3, (0.008, 0.4),
    )  # fmt: skip
    radius = 0.0165
    foot = revolved(
        [
            (0, -radius), (0.0085, -0.0145, 0.006), (0.0145, -0.0085, 0.006), (radius, 0, 0.008), (0.0135, 0.012, 0.008),
            (0.0092, 0.028, 0.004), (0, 0.028),
        ],
        20,
    ).moved((0, 0.008, -SHIN))  # fmt: skip
    return [("shank", "grey", shaft), ("foot", "black", foot)]


def parts():
    """The parts of every link: those at the place of a collision shape first, in its colour."""
    found = {"base": [Part(*part) for part in trunk()]}
    for end, fore in (("front", 1), ("hind", -1)):
        for side, out in (("left", 1), ("right", -1)):
            for link, make in (("hip", hip), ("thigh", thigh), ("shank", shank)):
                found[f"{end}_{side}_{link}"] = [Part(*part, (fore, out, 1)) for part in make()]
    return found
