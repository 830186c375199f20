#!/usr/bin/env python3
"""Writes the MJCF trap files, one rule of the format each, and MuJoCo's own values for them.

    python3 -m venv /tmp/mujoco && /tmp/mujoco/bin/pip install mujoco==4.0.0
    /tmp/mujoco/bin/python robots/tests/mujoco/traps.py              # writes traps.json
    /tmp/mujoco/bin/python robots/tests/mujoco/traps.py --files OUT  # writes the files

The folder `trap_files` has the files: robots with at most a few joints. `traps.json` contains, for each: its text, the names
of MuJoCo's joints (including a free joint), limits, damping, dry friction, and for two states the upper triangle of
the mass matrix row by row, the bias forces and the poses (position, quaternion w x y z) of bodies and sites.
`couplings` are the joint equalities that are active at the start: follower, leader, multiplier, offset, factors of
higher order. A file that MuJoCo itself rejects has `error` instead.

Units SI, radians. Quantities and frames are as in generate.py. Damping and friction are compared here, so they are
listed before they are removed from the file. Damping is the diagonal by which MuJoCo multiplies the velocity.
"""

import json
import pathlib
import sys
import tempfile

import mujoco
import numpy as np

from generate import load, state
from trap_files import TRAPS, ASSETS

HERE = pathlib.Path(__file__).resolve().parent
STATES = 2
DIGITS = 14


def rounded(values):
    return [float(f"{x:.{DIGITS}g}") for x in np.ravel(values)]


def name(model, kind, index):
    return mujoco.mj_id2name(model, kind, index)


def damping(path):
    """Returns the passive damping force per velocity of each degree of freedom; includes actuators, excludes tendons."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.tendon_damping[:] = 0
    data = mujoco.MjData(model)
    out = []
    for dof in range(model.nv):
        mujoco.mj_resetData(model, data)
        data.qvel[dof] = 1.0
        mujoco.mj_forward(model, data)
        out.append(-data.qfrc_damper[dof])
    return out


def couplings(model):
    out = []
    off = mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    if model.opt.disableflags & int(off):
        return out
    for index in range(model.neq):
        if model.eq_type[index] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[index]:
            continue
        first, second = model.eq_obj1id[index], model.eq_obj2id[index]
        if second < 0:
            out.append([name(model, mujoco.mjtObj.mjOBJ_JOINT, first), None])
            continue
        a = model.eq_data[index]
        y0, x0 = (model.qpos0[model.jnt_qposadr[joint]] for joint in (first, second))
        names = [name(model, mujoco.mjtObj.mjOBJ_JOINT, joint) for joint in (first, second)]
        out.append(names + rounded([a[1], y0 + a[0] - a[1] * x0]) + rounded(a[2:5]))
    return out


def case(model, random):
    data = mujoco.MjData(model)
    q, v, _ = state(model, random)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    frames = {}
    for kind, count, position, matrix in [
        (mujoco.mjtObj.mjOBJ_BODY, model.nbody, data.xpos, data.xmat),
        (mujoco.mjtObj.mjOBJ_SITE, model.nsite, data.site_xpos, data.site_xmat),
    ]:
        for index in range(1 if kind == mujoco.mjtObj.mjOBJ_BODY else 0, count):
            label = name(model, kind, index)
            if label and label not in frames:
                quaternion = np.zeros(4)
                mujoco.mju_mat2Quat(quaternion, matrix[index])
                frames[label] = rounded(position[index]) + rounded(quaternion)
    return {
        "qpos": data.qpos.tolist(),
        "qvel": data.qvel.tolist(),
        "M": rounded(M[np.triu_indices(model.nv)]),
        "bias": rounded(data.qfrc_bias),
        "frames": frames,
    }


def vectors(path):
    try:
        model = load(path)
    except ValueError as error:
        return {"error": str(error).splitlines()[0]}
    random = np.random.default_rng(1)
    friction = mujoco.MjModel.from_xml_path(str(path)).dof_frictionloss
    joints = []
    for joint in range(model.njnt):
        entry = {"name": name(model, mujoco.mjtObj.mjOBJ_JOINT, joint)}
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            entry["free"] = True
        if model.jnt_limited[joint]:
            entry["range"] = rounded(model.jnt_range[joint])
        if model.jnt_actfrclimited[joint]:
            entry["effort"] = rounded(model.jnt_actfrcrange[joint])
        joints.append(entry)
    cases = [case(model, random) for _ in range(STATES)]
    if not all(np.isfinite(case[what]).all() for case in cases for what in ("M", "bias")):
        return {"error": "its values are not finite"}
    return {
        "joints": joints,
        "damping": rounded(damping(path)),
        "friction": rounded(friction),
        "couplings": couplings(mujoco.MjModel.from_xml_path(str(path))),
        "cases": cases,
    }


def write(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for asset, text in ASSETS.items():
        (folder / asset).write_text(text)
    for label, text in TRAPS.items():
        (folder / f"{label}.xml").write_text(text)


def main():
    if sys.argv[1:2] == ["--files"]:
        return write(pathlib.Path(sys.argv[2]))
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write(folder)
        found = [{"file": label, "text": TRAPS[label], **vectors(folder / f"{label}.xml")} for label in TRAPS]
    document = {"mujoco": mujoco.__version__, "files": found}
    text = json.dumps(document, separators=(",", ":")).replace('{"file"', '\n{"file"') + "\n"
    (HERE / "traps.json").write_text(text)
    refused = {entry["file"]: entry["error"] for entry in found if "error" in entry}
    print(f"{len(found)} files, {len(text)} bytes; MuJoCo refuses {len(refused)}:")
    for file, error in refused.items():
        print(f"  {file}: {error}")


if __name__ == "__main__":
    main()
