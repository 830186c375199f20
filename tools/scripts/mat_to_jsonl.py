#!/usr/bin/env python3
"""Converts recordings in MATLAB files to JSON lines for `motorium library` and `motorium primitive`.

    pip install scipy
    python3 tools/scripts/mat_to_jsonl.py FILE_OR_FOLDER.. > recordings.jsonl

Supported variables:
- UTD-MHAD skeletons (aA_sS_tT_skeleton.mat): `d_skel`, joints x 3 x frames at 30 Hz, m. A line has the 3 coordinates of every
  joint relative to the hip centre, the label aA and the id of the file;
- UCI Character Trajectories (mixoutALL_shifted.mat): `mixout`, cells of 3 x samples at 200 Hz, and `consts`. A line has the
  velocities vx, vy of a letter; zero samples at both ends are removed;
- any other matrix (--variable NAME --rate HZ): samples x degrees of freedom.
"""

import argparse
import json
import re
import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat

JOINTS = [
    "head", "neck", "spine", "hip", "left_shoulder", "left_elbow", "left_wrist", "left_hand", "right_shoulder",
    "right_elbow", "right_wrist", "right_hand", "left_hip", "left_knee", "left_ankle", "left_foot", "right_hip",
    "right_knee", "right_ankle", "right_foot",
]  # fmt: skip


def skeleton(file, positions):
    joints, _, frames = positions.shape
    if joints != len(JOINTS):
        sys.exit(f"{file}: {joints} joints, expected {len(JOINTS)}")
    positions = positions - positions[JOINTS.index("hip")]
    name = file.stem.removesuffix("_skeleton")
    action = re.match(r"a\d+", name)
    columns = {
        f"{joint}_{axis}": positions[j, k].tolist()
        for j, joint in enumerate(JOINTS)
        for k, axis in enumerate("xyz")
        if joint != "hip"
    }
    yield {"id": name, "label": action.group() if action else None, "rate": 30.0, **columns}


def letters(_, content):
    consts = content["consts"]
    keys = [str(key) for key in np.ravel(consts.key)]
    for number, (cell, label) in enumerate(zip(np.ravel(content["mixout"]), np.ravel(consts.charlabels))):
        moving = np.flatnonzero(np.any(cell != 0, axis=0))
        cell = cell[:, moving[0] : moving[-1] + 1]
        label = keys[int(label) - 1]
        yield {"id": f"{label}-{number}", "label": label, "rate": 200.0, "vx": cell[0].tolist(), "vy": cell[1].tolist()}


def recordings(file, variable, rate):
    content = loadmat(file, squeeze_me=True, struct_as_record=False)
    if variable:
        if variable not in content:
            names = ", ".join(name for name in content if not name.startswith("__"))
            sys.exit(f"{file}: no variable {variable}; there are {names}")
        yield {"id": file.stem, "rate": rate, "positions": np.atleast_2d(content[variable]).tolist()}
    elif "d_skel" in content:
        yield from skeleton(file, content["d_skel"])
    elif "mixout" in content:
        yield from letters(file, content)
    else:
        sys.exit(f"{file}: neither d_skel nor mixout; name the matrix with --variable")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--variable", help="the matrix to take: samples x degrees of freedom")
    parser.add_argument("--rate", type=float, default=100.0, help="its samples per second")
    options = parser.parse_args()
    for path in options.paths:
        for file in sorted(path.rglob("*.mat")) if path.is_dir() else [path]:
            for recording in recordings(file, options.variable, options.rate):
                print(json.dumps({key: value for key, value in recording.items() if value is not None}))


main()
