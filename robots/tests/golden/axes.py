#!/usr/bin/env python3
"""Writes golden vectors of Pinocchio for robots whose joint axes are at, or nearly at, a coordinate axis.

    python3 -m venv /tmp/pin && /tmp/pin/bin/pip install pin==4.1.0 example-robot-data==6.0.0
    /tmp/pin/bin/python robots/tests/golden/axes.py        # writes axes.json and icub.json next to this script

axes.json: random trees, each with its URDF text. Every joint axis is a pole (+-x, +-y, +-z), exactly or tilted by 1e-18 to
0.1 rad; the tree rotates each pole into the next, which combines every pole with every order of tilt. Every second base floats.

icub.json: the iCub of the PyPI package example-robot-data, whose knee has the axis `0 1.22465e-16 -1`. Its file is not
in this repository: the test reads it from the package.

The layout of the files is described in catalogue.py.
"""

import json
import pathlib
import sysconfig

import numpy as np
import pinocchio as pin

from catalogue import HERE, document

TREES = 16
JOINTS = 5
POLES = [(0, 0, -1), (0, 0, 1), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0)]
TILTS = [0, 1e-18, 1e-17, 1e-16, 1.22465e-16, 1e-15, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 3e-8, 1e-7, 1e-6, 1e-5, 1e-3, 1e-1]
ICUB = "cmeel.prefix/share/example-robot-data/robots/icub_description/robots/icub_reduced.urdf"


def text(numbers):
    return " ".join(repr(float(number)) for number in numbers)


def link(name, random):
    mass = random.uniform(0.2, 3.0)
    root = random.normal(size=(3, 3)) * 0.1
    inertia = root @ root.T + 0.01 * np.eye(3)
    entries = " ".join(f'i{"xyz"[i]}{"xyz"[j]}="{float(inertia[i, j])!r}"' for i in range(3) for j in range(i, 3))
    origin = f'<origin xyz="{text(random.uniform(-0.2, 0.2, 3))}" rpy="{text(random.uniform(-3, 3, 3))}"/>'
    return f'<link name="{name}"><inertial>{origin}<mass value="{mass!r}"/><inertia {entries}/></inertial></link>\n'


def tilted(pole, tilt, random):
    pole = np.array(pole, float)
    across = np.cross(pole, random.normal(size=3))
    return pole + tilt * across / np.linalg.norm(across)


def tree(number, random):
    urdf = f'<robot name="tree-{number}">\n' + link("link0", random)
    for index in range(1, JOINTS + 1):
        place = number * JOINTS + index
        kind = ("revolute", "continuous", "prismatic")[0 if index < 3 else place % 3]
        parent = int(random.integers(max(0, index - 3), index))
        rpy = random.choice([-np.pi / 2, 0, np.pi / 2, np.pi], 3) if place % 2 else random.uniform(-3, 3, 3)
        axis = tilted(POLES[place % len(POLES)], TILTS[place * 7 % len(TILTS)], random)
        limit = "" if kind == "continuous" else '<limit lower="-2" upper="2" velocity="3" effort="50"/>'
        urdf += link(f"link{index}", random)
        urdf += f'<joint name="joint{index}" type="{kind}"><parent link="link{parent}"/><child link="link{index}"/>'
        urdf += f'<origin xyz="{text(random.uniform(-0.5, 0.5, 3))}" rpy="{text(rpy)}"/><axis xyz="{text(axis)}"/>'
        urdf += f"{limit}</joint>\n"
    return urdf + "</robot>\n"


def write(name, content):
    out = HERE / f"{name}.json"
    out.write_text(json.dumps(content, separators=(",", ":")) + "\n")
    print(f"{out.name}: {out.stat().st_size} bytes")


def main():
    random = np.random.default_rng(3)
    trees = []
    for number in range(TREES):
        urdf = tree(number, random)
        floating = number % 2 == 1
        root = [pin.JointModelFreeFlyer()] if floating else []
        model = pin.buildModelFromXML(urdf, *root)
        trees.append({"urdf": urdf} | document(f"tree-{number}", model, floating, [f"link{JOINTS}"], 1))
    write("axes", trees)
    icub = pathlib.Path(sysconfig.get_path("purelib")) / ICUB
    model = pin.buildModelFromUrdf(str(icub))
    write("icub", document("icub_reduced", model, False, ["l_sole"] if model.existFrame("l_sole") else ["l_foot"], 2))


if __name__ == "__main__":
    main()
