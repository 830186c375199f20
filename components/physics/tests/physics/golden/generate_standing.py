#!/usr/bin/env python3
"""Writes how robots of the catalogue come to stand in MuJoCo, which shares no code with this crate.

    python3 -m venv /tmp/mujoco && /tmp/mujoco/bin/pip install mujoco==4.0.0
    /tmp/mujoco/bin/python components/physics/tests/golden/generate_standing.py      # writes standing.json beside it

Each robot starts at rest in its home pose, every joint held there by the gains of its profile within its effort limit, on
a plane with a friction coefficient of 0.8. Contacts are as stiff as MuJoCo allows at this step (solref 1 ms, elliptic
cone, impratio 100), self-collision is off. Recorded: position and orientation of the base (quaternion w x y z) at some
times, and at the last the efforts of the joints. SI units.
"""

import json
import pathlib
import tomllib

import mujoco
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
CATALOGUE = HERE.parents[3] / "robots" / "catalogue"
ROBOTS = ["quadruped", "hexapod", "centaur"]
TIMES = [0.05, 0.1, 0.2, 0.5, 2.0]
STEP = 1e-4


def load(name):
    """The robot's URDF with a free base and a floor."""
    text = (CATALOGUE / name / f"{name}.urdf").read_text()
    root = text.split('<link name="', 1)[1].split('"', 1)[0]
    extra = (
        '<mujoco><compiler fusestatic="false" discardvisual="true" strippath="false"/></mujoco>'
        "</robot>"
    )
    spec = mujoco.MjSpec.from_string(text.replace("</robot>", extra))
    spec.body(root).add_freejoint(name="the_root")
    for geom in spec.geoms:
        geom.contype, geom.conaffinity = 1, 2
        geom.friction[0] = 0.8
    floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=2, conaffinity=1)
    floor.friction[0] = 0.8
    model = spec.compile()
    model.opt.timestep = STEP
    model.opt.gravity[:] = [0, 0, -9.81]
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    model.opt.impratio = 100
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.geom_condim[:] = 3
    model.geom_solref[:] = [1e-3, 1]
    model.geom_solimp[:] = [0.99, 0.999, 1e-4, 0.5, 2]
    return model


def stand(name):
    model = load(name)
    data = mujoco.MjData(model)
    profile = tomllib.loads((CATALOGUE / name / f"{name}.toml").read_text())
    home = profile["home"]
    base = profile["base_poses"][home]
    roll, pitch, yaw = base.get("rpy", [0, 0, 0])
    assert roll == pitch == yaw == 0
    root = model.joint("the_root")
    data.qpos[root.qposadr[0] :][:7] = [*base["position"], 1, 0, 0, 0]
    joints = [model.joint(joint) for joint in profile["joints"]]
    q = np.array([joint.qposadr[0] for joint in joints])
    v = np.array([joint.dofadr[0] for joint in joints])
    goal = np.array(profile["poses"][home])
    data.qpos[q] = goal
    kp, kd = np.array(profile["gains"]["kp"]), np.array(profile["gains"]["kd"])
    limits = {}
    import xml.etree.ElementTree as tree

    for joint in tree.fromstring((CATALOGUE / name / f"{name}.urdf").read_text()).iter("joint"):
        limit = joint.find("limit")
        limits[joint.get("name")] = float(limit.get("effort")) if limit is not None else np.inf
    limit = np.array([limits[joint] for joint in profile["joints"]])
    samples = []
    for step in range(1, round(TIMES[-1] / STEP) + 1):
        tau = np.clip(kp * (goal - data.qpos[q]) - kd * data.qvel[v], -limit, limit)
        data.qfrc_applied[v] = tau
        mujoco.mj_step(model, data)
        if any(step == round(time / STEP) for time in TIMES):
            samples.append({"time": step * STEP, "base": data.qpos[root.qposadr[0] :][:7].tolist()})
    return {"robot": name, "samples": samples, "joints": profile["joints"], "efforts": tau.tolist()}


if __name__ == "__main__":
    document = {"mujoco": mujoco.__version__, "robots": [stand(name) for name in ROBOTS]}
    out = HERE / "standing.json"
    out.write_text(json.dumps(document, separators=(",", ":")).replace('{"robot"', '\n{"robot"') + "\n")
    for robot in document["robots"]:
        print(robot["robot"], [round(sample["base"][2], 5) for sample in robot["samples"]], np.round(robot["efforts"], 3))
