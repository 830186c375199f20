#!/usr/bin/env python3
"""Writes values of the Lie group functions, computed with 60 digits, to vectors.json next to this script.

    python3 -m venv /tmp/mp && /tmp/mp/bin/pip install mpmath==1.4.1
    /tmp/mp/bin/python robots/tests/lie/generate.py

No closed form of a Jacobian is used: left Jacobians are sums of powers of the adjoint, inverses are solved for, rates are
differentiated numerically. Vectors have the linear part first, matrices are row by row, and quaternions are x y z w.
"""

import json
import pathlib

import mpmath as mp

mp.mp.dps = 60

ANGLES = ["0", "1e-30", "1e-12", "1e-9", "1e-8", "1e-6", "1e-4", "1e-3", "0.01", "0.1", "0.2499", "0.5", "0.9999999", "1.0000001"]
ANGLES += ["1.4999999", "1.5000001", "2", "2.5", "3", "3.1"]
# Up to half a turn; beyond it, only the Jacobians can be compared.
SHORT = ["1e-3", "1e-6", "1e-9", "1e-12"]
BEYOND = ["3.2", "4", "5", "6"]
DIRECTIONS = [([0, 0, 1], [1, 0, 0]), ([1, 2, -0.5], [0.3, -0.5, 0.8]), ([-0.5, 0.5, 0.7], [-20, 3, 0.1]), ([0, -1, 0], [0, 0, 0])]


def hat(w):
    return mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def sub(matrix, rows, columns, block):
    for i in range(block.rows):
        for j in range(block.cols):
            matrix[rows + i, columns + j] = block[i, j]


def adjoint(rho, phi):
    a = mp.zeros(6)
    sub(a, 0, 0, hat(phi))
    sub(a, 3, 3, hat(phi))
    sub(a, 0, 3, hat(rho))
    return a


def left(a):
    """sum a^k / (k + 1)!"""
    total, term = mp.eye(a.rows), mp.eye(a.rows)
    for k in range(1, 150):
        term = term * a / (k + 1)
        total += term
    return total


def floats(values):
    return [float(value) for value in values]


def case(direction, rho, angle):
    axis = mp.matrix(direction)
    axis /= mp.norm(axis)
    # The test reads doubles, so everything is computed from rounded values.
    phi = mp.matrix([mp.mpf(float(entry * angle)) for entry in axis])
    rho = mp.matrix([mp.mpf(float(entry)) for entry in rho])
    t = mp.norm(phi)
    sine = mp.sin(t / 2) / t if t else mp.mpf("0.5")
    quaternion = [*(phi * sine), mp.cos(t / 2)]
    small, large = left(hat(phi)), left(adjoint(rho, phi))
    rate, acceleration = mp.matrix([0.7, -1.1, 0.4]), mp.matrix([-2.0, 0.3, 1.5])
    moving = lambda s: left(hat(phi + rate * s + acceleration * s * s / 2)) * (rate + acceleration * s)
    h = mp.mpf("1e-15")
    return {
        "xi": floats([*rho, *phi]),
        "short": bool(t < mp.pi),
        "quaternion": floats(quaternion),
        "translation": floats(small * rho),
        "so3_left": floats(small),
        "so3_left_inverse": floats(small**-1),
        "se3_left": floats(large),
        "se3_left_inverse": floats(large**-1),
        "rate": floats(rate),
        "acceleration": floats(acceleration),
        "angular_velocity": floats(moving(0)),
        "angular_acceleration": floats((moving(h) - moving(-h)) / (2 * h)),
    }


def main():
    angles = [mp.mpf(text) for text in ANGLES] + [mp.pi - mp.mpf(text) for text in SHORT] + [mp.mpf(text) for text in BEYOND]
    cases = [case(direction, rho, angle) for direction, rho in DIRECTIONS for angle in angles]
    out = pathlib.Path(__file__).resolve().parent / "vectors.json"
    out.write_text(json.dumps(cases, separators=(",", ":")) + "\n")
    print(f"{out.name}: {len(cases)} cases, {out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
