"""Writes nut.obj, a hexagonal nut 40 mm across flats, and bin.obj, a tray of 170 mm, both closed, in metres.

python meshes.py
"""

import math
import pathlib

here = pathlib.Path(__file__).parent


def write(name, points, faces):
    lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in points]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
    (here / name).write_text("\n".join(lines) + "\n")


def nut(flats=0.04, hole=0.01, height=0.03):
    """Two rings of six corners below and two above, the outer ones first; two sides are across y."""
    rings = []
    for radius in (flats / math.sqrt(3), hole):
        angles = [math.radians(60 * corner) for corner in range(6)]
        rings.append([(radius * math.cos(a), radius * math.sin(a)) for a in angles])
    points = [(x, y, z) for z in (-height / 2, height / 2) for ring in rings for x, y in ring]
    faces = []
    for side in range(6):
        after = (side + 1) % 6
        outer, inner = (side, after), (6 + side, 6 + after)
        faces.append((outer[0], outer[1], outer[1] + 12, outer[0] + 12))
        faces.append((inner[1], inner[0], inner[0] + 12, inner[1] + 12))
        faces.append((outer[1], outer[0], inner[0], inner[1]))
        faces.append((outer[0] + 12, outer[1] + 12, inner[1] + 12, inner[0] + 12))
    write("nut.obj", points, faces)


def tray(outer=0.17, wall=0.01, floor=0.006, height=0.055):
    """A square tray about the middle of its floor, open above."""
    inner = outer / 2 - wall
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    ring = lambda half, z: [(half * x, half * y, z) for x, y in square]
    points = ring(outer / 2, 0) + ring(outer / 2, height) + ring(inner, height) + ring(inner, floor)
    faces = [(3, 2, 1, 0), (12, 13, 14, 15)]
    for side in range(4):
        after = (side + 1) % 4
        for below, above in ((0, 4), (4, 8), (8, 12)):
            faces.append((below + side, below + after, above + after, above + side))
    write("bin.obj", points, faces)


nut()
tray()
