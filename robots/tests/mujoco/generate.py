#!/usr/bin/env python3
"""Writes vectors of MuJoCo, which shares no code with Pinocchio or with this crate, for the files next to this script.

    python3 -m venv /tmp/mujoco && /tmp/mujoco/bin/pip install mujoco==4.0.0
    /tmp/mujoco/bin/python robots/tests/mujoco/generate.py       # writes vectors.json next to this script
    /tmp/mujoco/bin/python robots/tests/mujoco/generate.py OUT.json FILE.xml ...   # the same for other files

Units SI, radians; gravity (0, 0, -9.81). qpos, qvel and the joint-space vectors are MuJoCo's own: the quaternion
w x y z, the linear velocity of a free body in world axes, its angular velocity in body axes. MuJoCo's acceleration of a
free body is the derivative of these six numbers, i.e. the classical acceleration in world axes. All joints of a URDF are
independent: MuJoCo converts mimic joints to soft constraints, which are disabled here.

Forces that motorium leaves to simulators are removed from the file: damping, friction, springs, limits and contacts.
Armature is kept, because both include it. `M` is qM in full; `bias` is qfrc_bias; `inverse` is M a + bias. Positions of bodies and
sites are followed by their orientation as a quaternion w x y z.
"""

import json
import pathlib
import sys

import mujoco
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
CASES = 6
SEED = 1


def load(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.gravity[:] = [0.0, 0.0, -9.81]
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_CONSTRAINT | flags.mjDSBL_LIMIT
    model.dof_damping[:] = 0
    model.dof_frictionloss[:] = 0
    model.jnt_stiffness[:] = 0
    return model


def state(model, random):
    v = random.uniform(-2, 2, model.nv)
    q = model.qpos0.copy()
    mujoco.mj_integratePos(model, q, random.uniform(-1.5, 1.5, model.nv), 1.0)
    return q, v, random.uniform(-5, 5, model.nv)


def case(model, random):
    data = mujoco.MjData(model)
    q, v, a = state(model, random)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    frames = {}
    for kind, count, position, matrix in [
        (mujoco.mjtObj.mjOBJ_BODY, model.nbody, data.xpos, data.xmat),
        (mujoco.mjtObj.mjOBJ_SITE, model.nsite, data.site_xpos, data.site_xmat),
    ]:
        for index in range(count):
            name = mujoco.mj_id2name(model, kind, index)
            if name and name not in frames:
                quaternion = np.zeros(4)
                mujoco.mju_mat2Quat(quaternion, matrix[index])
                frames[name] = position[index].tolist() + quaternion.tolist()
    return {
        "qpos": data.qpos.tolist(),
        "qvel": data.qvel.tolist(),
        "a": a.tolist(),
        "M": M.tolist(),
        "bias": data.qfrc_bias.tolist(),
        "inverse": (M @ a + data.qfrc_bias).tolist(),
        "frames": frames,
    }


def vectors(path):
    model = load(path)
    random = np.random.default_rng(SEED)
    joints = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
    return {"file": path.name, "joints": joints, "cases": [case(model, random) for _ in range(CASES)]}


def main():
    if len(sys.argv) > 1:
        out, files = pathlib.Path(sys.argv[1]), [pathlib.Path(name) for name in sys.argv[2:]]
    else:
        out = HERE / "vectors.json"
        files = sorted(HERE.glob("*.xml"))
        files += [HERE.parent / "fixtures" / "branching.urdf", HERE.parents[1] / "catalogue" / "panda" / "panda.urdf"]
    document = {"mujoco": mujoco.__version__, "robots": [vectors(path) for path in files]}
    out.write_text(json.dumps(document, indent=None, separators=(",", ":")).replace('{"file"', '\n{"file"') + "\n")
    print(f"{out}: {[robot['file'] for robot in document['robots']]}")


if __name__ == "__main__":
    main()
