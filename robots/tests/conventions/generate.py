#!/usr/bin/env python3
"""Writes the same motions of rover.urdf in the coordinates of Pinocchio and of MuJoCo to vectors.json next to this script.

    python3 -m venv /tmp/both && /tmp/both/bin/pip install pin==4.1.0 mujoco==4.0.0
    /tmp/both/bin/python robots/tests/conventions/generate.py

A motion is independent of the program: the pose and velocity of the body in the world, and every joint by name. `body` has
the position, the rotation matrix, and the velocity of the body's origin and its angular velocity in world axes. The script
converts it to each program's coordinates, queries the motion of its links (`links`: position, rotation matrix, linear velocity
of the origin, angular velocity, all in world axes), and stops unless both programs agree.
`joints` is each program's own order. Accelerations: `a` is each program's derivative of its own velocity; Pinocchio's is the
spatial acceleration in body axes, MuJoCo's the classical acceleration in world axes with the angular part in body axes. `tau` is
each program's inverse dynamics for its `a` without gravity, which also checks the dual of the velocity. `difference` and
`interpolated` are Pinocchio's, from a case's `q` to the next case's: the velocity, and the configuration at 0.3 of the distance.

`planar`: a single planar joint, which MuJoCo does not have. Pinocchio puts it in the x-y plane regardless of its axis.
"""

import json
import pathlib
import sys

import mujoco
import numpy as np
import pinocchio as pin

HERE = pathlib.Path(__file__).resolve().parent
URDF = HERE / "rover.urdf"
LINKS = ["body", "arm", "hand", "wheel"]
CASES = 6
SEED = 4

PLANAR = """<robot name="plate"><link name="world"/><link name="plate"><inertial><origin xyz="0.05 0.02 0.1"/>
<mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
<joint name="slide" type="planar"><parent link="world"/><child link="plate"/><origin xyz="1 2 3" rpy="0.3 -0.2 0.5"/>
<axis xyz="0 0 1"/></joint></robot>"""


def plain(array):
    return np.asarray(array, dtype=float).tolist()


def motions():
    random = np.random.default_rng(SEED)
    for number in range(CASES):
        quaternion = random.normal(size=4)
        rotation = pin.Quaternion(quaternion / np.linalg.norm(quaternion)).toRotationMatrix()
        yield {
            "body": {
                "p": random.uniform(-1, 1, 3),
                "R": rotation,
                "linear": random.uniform(-2, 2, 3),
                "angular": random.uniform(-3, 3, 3),
                # Classical acceleration of the origin, and angular acceleration.
                "linear_rate": random.uniform(-4, 4, 3),
                "angular_rate": random.uniform(-4, 4, 3),
            },
            "joints": {
                "arm_joint": random.uniform(-2, 2, 3),
                "hand_joint": random.uniform(-0.2, 0.2, 3),
                # Including the ends of the turn.
                "wheel_joint": np.array([[3.1, -3.1, 0.0][number] if number < 3 else random.uniform(-3, 3), 2.0, -1.0]),
            },
        }


def in_pinocchio(model, motion):
    data = model.createData()
    q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    body = motion["body"]
    R = body["R"]
    w = R.T @ body["angular"]
    q[:3] = body["p"]
    q[3:7] = pin.Quaternion(R).coeffs()
    v[:3], v[3:6] = R.T @ body["linear"], w
    # Classical minus w x v: the spatial acceleration.
    a[:3] = R.T @ body["linear_rate"] - np.cross(w, v[:3])
    a[3:6] = R.T @ body["angular_rate"]
    for name, (position, rate, rate_of_rate) in motion["joints"].items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(position), np.sin(position)] if joint.nq == 2 else [position]
        v[joint.idx_v], a[joint.idx_v] = rate, rate_of_rate
    pin.forwardKinematics(model, data, q, v)
    pin.updateFramePlacements(model, data)
    links = {}
    for name in LINKS:
        index = model.getFrameId(name)
        velocity = pin.getFrameVelocity(model, data, index, pin.LOCAL_WORLD_ALIGNED)
        pose = data.oMf[index]
        links[name] = {"p": pose.translation, "R": pose.rotation, "linear": velocity.linear, "angular": velocity.angular}
    return {"q": q, "v": v, "a": a, "tau": pin.rnea(model, data, q, v, a)}, links


def in_mujoco(model, motion):
    data = mujoco.MjData(model)
    body = motion["body"]
    data.qpos[:3] = body["p"]
    mujoco.mju_mat2Quat(data.qpos[3:7], body["R"].flatten())
    data.qvel[:3], data.qvel[3:6] = body["linear"], body["R"].T @ body["angular"]
    a = np.zeros(model.nv)
    a[:3], a[3:6] = body["linear_rate"], body["R"].T @ body["angular_rate"]
    for name, (position, rate, rate_of_rate) in motion["joints"].items():
        joint = model.joint(name)
        data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]], a[joint.dofadr[0]] = position, rate, rate_of_rate
    qpos, qvel = data.qpos.copy(), data.qvel.copy()
    mujoco.mj_forward(model, data)
    links = {}
    for name in LINKS:
        index = model.body(name).id
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, index, velocity, 0)
        links[name] = {
            "p": data.xpos[index].copy(),
            "R": data.xmat[index].reshape(3, 3).copy(),
            "linear": velocity[3:],
            "angular": velocity[:3],
        }
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return {"qpos": qpos, "qvel": qvel, "qacc": a, "tau": M @ a + data.qfrc_bias}, links


def planar():
    model = pin.buildModelFromXML(PLANAR)
    model.gravity.linear = np.zeros(3)
    data = model.createData()
    frame = model.getFrameId("plate")
    random = np.random.default_rng(SEED)
    cases = []
    for angle in [0.4, -2.5, 3.0]:
        q = np.array([*random.uniform(-1, 1, 2), np.cos(angle), np.sin(angle)])
        v = random.uniform(-2, 2, 3)
        pin.forwardKinematics(model, data, q, v)
        pin.updateFramePlacements(model, data)
        velocity = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        cases.append({
            "q": plain(q),
            "v": plain(v),
            "p": plain(data.oMf[frame].translation),
            "R": plain(data.oMf[frame].rotation),
            "linear": plain(velocity.linear),
            "angular": plain(velocity.angular),
        })
    return {"urdf": PLANAR, "cases": cases}


def main():
    theirs = pin.buildModelFromUrdf(str(URDF))
    theirs.gravity.linear = np.zeros(3)
    other = mujoco.MjModel.from_xml_path(str(URDF))
    other.opt.gravity[:] = 0
    other.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    other.dof_damping[:] = 0
    cases = []
    for motion in motions():
        pinocchio, links = in_pinocchio(theirs, motion)
        mujocos, again = in_mujoco(other, motion)
        body = {key: motion["body"][key] for key in ["p", "R", "linear", "angular"]}
        for name in LINKS:
            for key, value in links[name].items():
                if np.abs(value - again[name][key]).max() > 1e-10:
                    sys.exit(f"{name} {key}: Pinocchio {value}, MuJoCo {again[name][key]}")
        for key, value in body.items():
            if np.abs(value - links["body"][key]).max() > 1e-10:
                sys.exit(f"body {key}: meant {value}, is {links['body'][key]}")
        cases.append({
            "pinocchio": {key: plain(value) for key, value in pinocchio.items()},
            "mujoco": {key: plain(value) for key, value in mujocos.items()},
            "links": {name: {key: plain(value) for key, value in link.items()} for name, link in links.items()},
            "positions": {name: plain(values)[0] for name, values in motion["joints"].items()},
        })
    for case, after in zip(cases, cases[1:] + cases[:1]):
        q, to = (np.array(entry["pinocchio"]["q"]) for entry in (case, after))
        case["pinocchio"]["difference"] = plain(pin.difference(theirs, q, to))
        case["pinocchio"]["interpolated"] = plain(pin.interpolate(theirs, q, to, 0.3))
    document = {
        "source": {"pinocchio": pin.__version__, "mujoco": mujoco.__version__, "seed": SEED},
        "joints": {
            "pinocchio": list(theirs.names)[2:],
            "mujoco": [other.joint(index).name for index in range(other.njnt)][1:],
        },
        "cases": cases,
        "planar": planar(),
    }
    out = HERE / "vectors.json"
    out.write_text(json.dumps(document, separators=(",", ":")) + "\n")
    print(f"{out}: {len(cases)} cases, {out.stat().st_size} bytes, joints {document['joints']}")


if __name__ == "__main__":
    main()
