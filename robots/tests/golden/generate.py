#!/usr/bin/env python3
"""Writes golden vectors of Pinocchio for a robot of the catalogue.

    python3 -m venv /tmp/pin && /tmp/pin/bin/pip install pin==4.1.0
    /tmp/pin/bin/python robots/tests/golden/generate.py        # writes panda.json next to this script

Units SI, radians; world z up. Spatial vectors and Jacobian rows: linear first, then angular. `M_upper`: upper triangle of
the mass matrix, row by row. `joint_positions` and every joint-space vector are in the order of `joints`.

Mimic joints follow their master. Pinocchio computes with all joints independent; with the constant matrix G of
v_all = G v, everything follows from virtual work: J = J_all G, tau = G' tau_all, M = G' M_all G, and aba solves M a = tau - nle.
The script stops unless Pinocchio's own reduction (`mimic=True`) gives the same result.
"""

import json
import pathlib
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

ROBOT = "panda"
JACOBIAN_FRAMES = ["panda_link4", "panda_hand_tcp", "panda_rightfinger"]
GRAVITY = [0.0, 0.0, -9.81]
CASES = 8
SEED = 1

HERE = pathlib.Path(__file__).resolve().parent
URDF = HERE.parents[1] / "catalogue" / ROBOT / f"{ROBOT}.urdf"

REFERENCES = {
    "lwa": pin.LOCAL_WORLD_ALIGNED,
    "local": pin.LOCAL,
    "world": pin.WORLD,
}


def mimics(urdf):
    """Returns {joint: (master, multiplier, offset)} of the file; the catalogue has no chains."""
    found = {}
    for joint in ET.parse(urdf).getroot().iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            found[joint.get("name")] = (
                mimic.get("joint"),
                float(mimic.get("multiplier", 1)),
                float(mimic.get("offset", 0)),
            )
    return found


def reduction(model, follows):
    """Returns the independent joint names, and G and offset with q_all = G q + offset."""
    names = [name for name in model.names[1:] if name not in follows]
    G = np.zeros((model.nv, len(names)))
    offset = np.zeros(model.nv)
    for name in model.names[1:]:
        row = model.joints[model.getJointId(name)].idx_v
        master, multiplier, shift = follows.get(name, (name, 1.0, 0.0))
        G[row, names.index(master)] = multiplier
        offset[row] = shift
    return names, G, offset


def symmetric(upper):
    return np.triu(upper) + np.triu(upper, 1).T


def case(model, G, offset, q, v, a, tau):
    data = model.createData()
    q_all, v_all, a_all = G @ q + offset, G @ v, G @ a
    zero = np.zeros(model.nv)
    M = G.T @ symmetric(pin.crba(model, data, q_all)) @ G
    nle = G.T @ pin.rnea(model, data, q_all, v_all, zero)
    frames = {}
    pin.forwardKinematics(model, data, q_all, v_all)
    pin.computeJointJacobians(model, data, q_all)
    pin.updateFramePlacements(model, data)
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY or frame.name == "universe":
            continue
        index = model.getFrameId(frame.name, pin.FrameType.BODY)
        pose = data.oMf[index]
        entry = {"p": pose.translation.tolist(), "R": pose.rotation.tolist()}
        if frame.name in JACOBIAN_FRAMES:
            for key, reference in REFERENCES.items():
                J = pin.getFrameJacobian(model, data, index, reference)
                entry[f"J_{key}"] = (J @ G).tolist()
                entry[f"v_{key}"] = pin.getFrameVelocity(model, data, index, reference).vector.tolist()
        frames[frame.name] = entry
    return {
        "q": q.tolist(),
        "v": v.tolist(),
        "a": a.tolist(),
        "tau": tau.tolist(),
        "M_upper": M[np.triu_indices(len(q))].tolist(),
        "gravity": (G.T @ pin.computeGeneralizedGravity(model, data, q_all)).tolist(),
        "nle": nle.tolist(),
        "rnea": (G.T @ pin.rnea(model, data, q_all, v_all, a_all)).tolist(),
        "aba": np.linalg.solve(M, tau - nle).tolist(),
        "frames": frames,
    }


def check_against_pinocchios_mimic(urdf, names, cases):
    model = pin.buildModelFromUrdf(str(urdf), mimic=True)
    model.gravity.linear = np.array(GRAVITY)
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in names]
    spread = np.zeros((model.nv, len(names)))
    spread[order, range(len(names))] = 1.0
    for number, entry in enumerate(cases):
        q, v, a = (spread @ np.array(entry[key]) for key in "qva")
        M = symmetric(pin.crba(model, data, q))
        n = len(names)
        expected = np.zeros((n, n))
        expected[np.triu_indices(n)] = entry["M_upper"]
        for what, ours, theirs in [
            ("M", symmetric(expected), spread.T @ M @ spread),
            ("rnea", np.array(entry["rnea"]), spread.T @ pin.rnea(model, data, q, v, a)),
        ]:
            error = np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1e-300)
            if error > 1e-12:
                sys.exit(f"case {number}: {what} differs from Pinocchio's mimic=True by {error:.1e}")


def main():
    model = pin.buildModelFromUrdf(str(URDF))
    model.gravity.linear = np.array(GRAVITY)
    names, G, offset = reduction(model, mimics(URDF))
    rows = [model.joints[model.getJointId(name)].idx_q for name in names]
    lower, upper = model.lowerPositionLimit[rows], model.upperPositionLimit[rows]
    random = np.random.default_rng(SEED)
    n = len(names)
    cases = []
    for number in range(CASES):
        q = {0: (lower + upper) / 2, 1: lower, 2: upper}.get(number)
        if q is None:
            q = random.uniform(lower, upper)
        draws = [random.uniform(-bound, bound, n) for bound in (2.0, 5.0, 20.0)]
        v, a, tau = [np.zeros(n)] * 3 if number == 0 else draws
        cases.append(case(model, G, offset, q, v, a, tau))
    check_against_pinocchios_mimic(URDF, names, cases)
    document = {
        "robot": ROBOT,
        "source": {"pinocchio": pin.__version__, "seed": SEED},
        "mimic": "mimic joints follow their master",
        "joints": names,
        "gravity": GRAVITY,
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "velocity_limit": model.velocityLimit[rows].tolist(),
        "effort_limit": model.effortLimit[rows].tolist(),
        "cases": cases,
    }
    out = HERE / f"{ROBOT}.json"
    out.write_text(json.dumps(document, separators=(",", ":")) + "\n")
    print(f"{out}: {len(cases)} cases, {n} joints, {out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
