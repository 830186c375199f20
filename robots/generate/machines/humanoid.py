"""Shells of the humanoid, in the axes of its links: the left side, mirrored for the right side."""

from math import pi

from shells import Part, block, drum, loft, revolved, ring

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
TO_X, TO_Y = (0, pi / 2, 0), (-pi / 2, 0, 0)


def pelvis():
    core = loft(
        [
            ((0, 0, -0.03), 0.034, 0.05, 3.0),
            ((0, 0, 0.0), 0.045, 0.076, 3.0),
            ((0, 0, 0.035), 0.043, 0.066, 2.8),
            ((0, 0, 0.056), 0.038, 0.046, 2.4),
        ],
        X, Y, 20, 2, (0.006, 0.8), (0.003, 0.9),
    )  # fmt: skip
    belt = loft(
        [((0.002, 0, 0.004), 0.05, 0.083, 3.2), ((0.002, 0, 0.02), 0.052, 0.085, 3.2), ((0.002, 0, 0.036), 0.048, 0.078, 3.0)],
        X, Y, 20, 2, (0.005, 0.85), (0.005, 0.85),
    )  # fmt: skip
    return [("pelvis", "black", core), ("pelvis_belt", "white", belt)]


def waist():
    return [("waist", "black", drum(0.039, 0.0, 0.034, 0.005))]


def bellows():
    folds = [(0, -0.03), (0.034, -0.03, 0.003)]
    for step in range(3):
        folds += [(0.04, -0.022 + 0.018 * step, 0.003), (0.035, -0.013 + 0.018 * step, 0.003)]
    return [("bellows", "black", revolved([*folds, (0, 0.03)], 16, 1))]


def torso():
    chest = loft(
        [
            ((0.0, 0, 0.03), 0.042, 0.052, 2.6),
            ((0.002, 0, 0.07), 0.053, 0.07, 2.9),
            ((0.006, 0, 0.125), 0.064, 0.088, 3.2),
            ((0.006, 0, 0.175), 0.064, 0.09, 3.2),
            ((0.001, 0, 0.21), 0.048, 0.066, 2.7),
        ],
        X, Y, 24, 2, (0.008, 0.8), (0.012, 0.6),
    )  # fmt: skip
    panel = loft([((0.066, 0, 0.152), 0.043, 0.026, 3.4), ((0.0715, 0, 0.152), 0.041, 0.024, 3.4)], Y, Z, 20, 1, end=(0.003, 0.9))
    pack = loft(
        [((-0.05, 0, 0.135), 0.062, 0.062, 4.0), ((-0.078, 0, 0.135), 0.057, 0.057, 4.0)], Y, Z, 20, 1, end=(0.008, 0.85)
    )
    belly = drum(0.041, 0.012, 0.034, 0.004)
    collar = revolved([(0, 0.2), (0.034, 0.2), (0.03, 0.232, 0.004), (0, 0.232)], 20)
    lamp = drum(0.0095, 0, 0.0035, 0.0015, 18).moved((0.0735, 0, 0.152), TO_X)
    return [("torso", "white", chest), ("torso_dark", "black", panel + pack + belly + collar), ("torso_lamp", "blue", lamp)]


def neck():
    return [("neck", "black", revolved([(0, 0), (0.026, 0, 0.003), (0.02, 0.012, 0.005), (0.02, 0.05), (0, 0.05)], 18))]


def head():
    helmet = loft(
        [
            ((0.0, 0, 0.004), 0.034, 0.032, 2.2),
            ((0.006, 0, 0.03), 0.053, 0.047, 2.3),
            ((0.008, 0, 0.062), 0.06, 0.053, 2.3),
            ((0.004, 0, 0.096), 0.052, 0.047, 2.2),
            ((0.0, 0, 0.112), 0.038, 0.036, 2.1),
        ],
        X, Y, 22, 2, (0.006, 0.6), (0.014, 0.1),
    )  # fmt: skip
    visor = loft(
        [
            ((0.02, 0, 0.03), 0.044, 0.04, 2.5),
            ((0.02, 0, 0.048), 0.053, 0.0475, 2.6),
            ((0.02, 0, 0.07), 0.0535, 0.048, 2.6),
            ((0.018, 0, 0.088), 0.046, 0.0415, 2.5),
        ],
        X, Y, 20, 2, (0.005, 0.7), (0.005, 0.7),
    )  # fmt: skip
    ears = drum(0.018, 0.048, 0.06, 0.004, 16).moved((0.0, 0, 0.06), TO_Y)
    eyes = [drum(0.0062, 0, 0.004, 0.002, 14).moved((0.0695, y, 0.062), TO_X) for y in (-0.016, 0.016)]
    dark = visor + ears + ears.mirrored()
    return [("head", "white", helmet), ("head_dark", "black", dark), ("head_eyes", "blue", eyes[0] + eyes[1])]


def hip_yaw():
    return [("hip_yaw", "black", drum(0.034, -0.006, 0.038, 0.006, 18))]


def hip_roll():
    return [("hip_roll", "black", drum(0.032, -0.036, 0.036, 0.006, 18).moved(rpy=TO_X))]


def thigh():
    cover = loft(
        [
            ((0.003, 0.004, 0.012), 0.037, 0.034, 2.6),
            ((0.005, 0.004, -0.03), 0.043, 0.04, 2.6),
            ((0.006, 0.002, -0.09), 0.041, 0.038, 2.4),
            ((0.004, 0, -0.15), 0.034, 0.034, 2.4),
            ((0.002, 0, -0.198), 0.031, 0.033, 2.6),
        ],
        X, Y, 20, 2, (0.014, 0.55), (0.005, 0.85),
    )  # fmt: skip
    motor = drum(0.03, -0.03, 0.052, 0.006, 18).moved(rpy=TO_Y)
    band = loft([((0.0055, 0.003, -0.072), 0.0425, 0.0395, 2.5), ((0.006, 0.002, -0.079), 0.0423, 0.0392, 2.5)], X, Y, 24, 1)
    return [("thigh", "white", cover), ("thigh_dark", "black", motor + band)]


def shank():
    knee = drum(0.0355, -0.04, 0.04, 0.006, 20).moved(rpy=TO_Y)
    shin = loft(
        [
            ((0.0, 0, -0.022), 0.029, 0.03, 2.8),
            ((-0.005, 0, -0.065), 0.037, 0.034, 2.6),
            ((-0.006, 0, -0.11), 0.034, 0.031, 2.4),
            ((0.0, 0, -0.165), 0.025, 0.026, 2.3),
            ((0.0, 0, -0.205), 0.022, 0.025, 2.4),
        ],
        X, Y, 20, 2, (0.006, 0.8), (0.004, 0.85),
    )  # fmt: skip
    lids = drum(0.019, 0.038, 0.046, 0.003, 16).moved(rpy=TO_Y)
    stations = [
        ((0.024, 0, -0.04), 0.012, 0.02, 2.6),
        ((0.024, 0, -0.085), 0.012, 0.02, 2.6),
        ((0.021, 0, -0.14), 0.008, 0.014, 2.4),
    ]
    guard = loft(stations, X, Y, 12, 2, (0.004, 0.7), (0.004, 0.7))
    return [("shank", "black", knee), ("shank_cover", "white", shin), ("shank_metal", "grey", lids + lids.mirrored() + guard)]


def ankle():
    return [("ankle", "black", drum(0.0235, -0.034, 0.034, 0.005, 18).moved(rpy=TO_Y))]


def foot():
    sole = loft([((0.036, 0, -0.06), 0.098, 0.043, 3.6), ((0.036, 0, -0.05), 0.1, 0.045, 3.6)], X, Y, 28, 1)
    cover = loft(
        [
            ((-0.052, 0, -0.042), 0.03, 0.012, 3.0),
            ((-0.025, 0, -0.035), 0.037, 0.021, 2.8),
            ((0.012, 0, -0.034), 0.038, 0.023, 2.8),
            ((0.06, 0, -0.043), 0.04, 0.013, 3.0),
            ((0.118, 0, -0.049), 0.036, 0.007, 3.0),
        ],
        Y, Z, 18, 2, (0.01, 0.5), (0.012, 0.5),
    )  # fmt: skip
    return [("foot", "grey", sole), ("foot_cover", "white", cover)]


def shoulder():
    return [("shoulder", "black", drum(0.032, -0.03, 0.02, 0.005, 18).moved(rpy=TO_Y))]


def shoulder_roll():
    profile = [(0, -0.032), (0.02, -0.027, 0.008), (0.031, -0.008, 0.01), (0.031, 0.012, 0.008), (0.02, 0.027, 0.008), (0, 0.031)]
    ball = revolved(profile, 16, 2)
    cap = loft(
        [((0, 0.004, 0.0), 0.033, 0.036, 2.6), ((0, 0.014, 0.002), 0.034, 0.037, 2.6), ((0, 0.026, 0.0), 0.029, 0.031, 2.5)],
        X, Z, 18, 2, (0.004, 0.85), (0.011, 0.35),
    )  # fmt: skip
    return [("shoulder_roll", "black", ball), ("shoulder_cap", "white", cap)]


def upper_arm():
    sleeve = loft(
        [
            ((0, 0, -0.044), 0.025, 0.024, 2.2),
            ((0, 0, -0.075), 0.0285, 0.0275, 2.3),
            ((0, 0, -0.115), 0.026, 0.0255, 2.3),
            ((0, 0, -0.148), 0.0225, 0.024, 2.6),
        ],
        X, Y, 18, 2, (0.005, 0.8), (0.004, 0.85),
    )  # fmt: skip
    return [("upper_arm", "white", sleeve), ("upper_arm_dark", "black", ring(0.022, -0.05, -0.02, 20))]


def forearm():
    elbow = drum(0.0265, -0.028, 0.028, 0.005, 18).moved(rpy=TO_Y)
    sleeve = loft(
        [((0, 0, -0.016), 0.021, 0.022, 2.6), ((0, 0, -0.042), 0.0255, 0.0245, 2.3), ((0, 0, -0.066), 0.0235, 0.0225, 2.1)],
        X, Y, 18, 2, (0.004, 0.85), (0.002, 0.92),
    )  # fmt: skip
    lids = drum(0.014, 0.026, 0.032, 0.002, 14).moved(rpy=TO_Y)
    return [("forearm", "black", elbow), ("forearm_sleeve", "white", sleeve), ("forearm_metal", "grey", lids + lids.mirrored())]


def wrist():
    stations = [((0, 0, -0.002), 0.021, 0.0205, 2.1), ((0, 0, -0.03), 0.0195, 0.019, 2.2), ((0, 0, -0.06), 0.0155, 0.016, 2.3)]
    cuff = loft(stations, X, Y, 16, 2, end=(0.004, 0.8))
    return [("wrist", "grey", cuff)]


def wrist_pitch():
    return [("wrist_pitch", "black", drum(0.0145, -0.0165, 0.0165, 0.003, 18).moved(rpy=TO_Y))]


def hand():
    palm = loft(
        [((0, 0, -0.008), 0.016, 0.0105, 2.8), ((0, 0, -0.026), 0.0225, 0.0115, 3.2), ((0, 0, -0.05), 0.0225, 0.0105, 3.2)],
        X, Y, 16, 2, (0.004, 0.7), (0.003, 0.85),
    )  # fmt: skip

    def finger(x, y, top, length, out=0.0):
        stations = [
            ((x, y, top), 0.0048, 0.0052, 2.2),
            ((x + 0.6 * out, y, top - 0.5 * length), 0.0046, 0.005, 2.2),
            ((x + out, y - 0.004, top - length), 0.0038, 0.0042, 2.2),
        ]
        return loft(stations, X, Y, 8, 1, end=(0.003, 0.3))

    fingers = [finger(x, 0, -0.048, length) for x, length in ((-0.0165, 0.03), (-0.0055, 0.036), (0.0055, 0.037), (0.0165, 0.033))]
    thumb = finger(0.021, -0.004, -0.018, 0.036, 0.008)
    return [("hand", "grey", palm), ("fingers", "black", sum(fingers, thumb))]


def parts():
    """The parts of every link: those at the place of a collision shape first, in its colour."""
    middle = {
        "pelvis": pelvis, "waist_yaw_link": waist, "waist_roll_link": bellows, "torso": torso, "neck": neck, "head": head,
    }  # fmt: skip
    sides = {
        "hip_yaw_link": hip_yaw, "hip_roll_link": hip_roll, "thigh": thigh, "shank": shank, "ankle": ankle, "foot": foot,
        "shoulder": shoulder, "shoulder_roll_link": shoulder_roll, "upper_arm": upper_arm, "forearm": forearm,
        "wrist": wrist, "wrist_pitch_link": wrist_pitch, "hand": hand,
    }  # fmt: skip
    found = {link: [Part(*part) for part in make()] for link, make in middle.items()}
    for side, out in (("left", 1), ("right", -1)):
        found |= {f"{side}_{link}": [Part(*part, (1, out, 1)) for part in make()] for link, make in sides.items()}
    return found
