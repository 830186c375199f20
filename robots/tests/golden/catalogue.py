#!/usr/bin/env python3
"""Writes golden vectors of Pinocchio for every robot of the catalogue, in catalogue/ next to this script.

    python3 -m venv /tmp/pin && /tmp/pin/bin/pip install pin==4.1.0
    /tmp/pin/bin/python robots/tests/golden/catalogue.py              # all robots
    /tmp/pin/bin/python robots/tests/golden/catalogue.py biped ur5e   # only these robots

Units SI, radians; world z up. Spatial vectors and the rows of Jacobians: linear first, then angular. The order of every
joint-space vector is Pinocchio's, listed in `joints`; `joint_positions` has every joint by name. A continuous joint has two
entries of q, cosine and sine; a floating base seven, the quaternion as x y z w. Mimic joints are independent joints.

`M_upper`: upper triangle of the mass matrix, row by row. `rnea = M a + nle`; `fext` is a wrench on a frame, in its axes, with
`rnea_fext = rnea - J' f`. `J_lwa`, `J_local`, `J_world`: Jacobians with the point and the axes of LOCAL_WORLD_ALIGNED, LOCAL
and WORLD. `a_classical_lwa = J_lwa a + Jdot_v_lwa`. `Ag`, `hg`, `dhg`, `Agdot_v`: centroidal momentum map, momentum, its rate,
its rate at a = 0. `q_integrated`, `q_difference`: integrate(q, v dt), and difference(q, q_integrated).
"""

import json
import pathlib
import sys
import tomllib

import numpy as np
import pinocchio as pin

GRAVITY = [0.0, 0.0, -9.81]
DT = 0.01

HERE = pathlib.Path(__file__).resolve().parent
CATALOGUE = HERE.parents[1] / "catalogue"


def plain(array):
    return np.asarray(array, dtype=float).tolist()


def rows(matrix, nv):
    """Returns the rows of a matrix, even if a single column is returned as a vector."""
    return plain(np.asarray(matrix).reshape(-1, nv))


def configurations(model, floating, random, count):
    """Returns the middle of the ranges, their ends, and random configurations."""
    scalars = [joint for joint in list(model.joints)[1:] if joint.nv == 1]

    def bounds(joint):
        if joint.nq == 2:
            return -2.0, 2.0
        return max(model.lowerPositionLimit[joint.idx_q], -2.0), min(model.upperPositionLimit[joint.idx_q], 2.0)

    for number in range(count):
        q = pin.neutral(model)
        if floating and number > 0:
            q[:3] = random.uniform(-1, 1, 3)
            quaternion = random.normal(size=4)
            q[3:7] = quaternion / np.linalg.norm(quaternion)
        for joint in scalars:
            low, high = bounds(joint)
            angle = {0: (low + high) / 2, 1: high}.get(number, random.uniform(low, high))
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
            else:
                q[joint.idx_q] = angle
        yield q


def positions(model, q):
    found = {}
    for name, joint in list(zip(model.names, model.joints))[1:]:
        if joint.nv == 1:
            found[name] = float(q[joint.idx_q] if joint.nq == 1 else np.arctan2(q[joint.idx_q + 1], q[joint.idx_q]))
    return found


def six(motion):
    return plain(motion.vector)


def frames(model, q, v, a, chosen):
    moving, still = model.createData(), model.createData()
    pin.forwardKinematics(model, moving, q, v, a)
    pin.forwardKinematics(model, still, q, v, 0 * a)
    for data in (moving, still):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
    found = {}
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY or frame.name == "universe":
            continue
        index = model.getFrameId(frame.name, pin.FrameType.BODY)
        pose = moving.oMf[index]
        entry = {"p": plain(pose.translation), "R": plain(pose.rotation)}
        if frame.name in chosen:
            lwa = pin.LOCAL_WORLD_ALIGNED
            for key, reference in (("lwa", lwa), ("local", pin.LOCAL), ("world", pin.WORLD)):
                if frame.name == chosen[0] or key == "lwa":
                    entry[f"J_{key}"] = rows(pin.getFrameJacobian(model, moving, index, reference), model.nv)
                entry[f"v_{key}"] = six(pin.getFrameVelocity(model, moving, index, reference))
            entry["a_classical_lwa"] = six(pin.getFrameClassicalAcceleration(model, moving, index, lwa))
            entry["a_spatial_local"] = six(pin.getFrameAcceleration(model, moving, index, pin.LOCAL))
            entry["Jdot_v_lwa"] = six(pin.getFrameClassicalAcceleration(model, still, index, lwa))
        found[frame.name] = entry
    return found


def case(model, q, v, a, tau, chosen, wrench):
    data = model.createData()
    zero = np.zeros(model.nv)
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    entry = {"q": plain(q), "joint_positions": positions(model, q), "v": plain(v), "a": plain(a), "tau": plain(tau)}
    entry["M_upper"] = plain(M[np.triu_indices(model.nv)])
    entry["gravity"] = plain(pin.computeGeneralizedGravity(model, data, q))
    nle = pin.nonLinearEffects(model, data, q, v)
    rnea = pin.rnea(model, data, q, v, a)
    entry |= {"nle": plain(nle), "rnea": plain(rnea), "aba": plain(pin.aba(model, data, q, v, tau))}
    index = model.getFrameId(chosen[0], pin.FrameType.BODY)
    J = np.reshape(pin.computeFrameJacobian(model, model.createData(), q, index, pin.LOCAL), (6, model.nv))
    entry["fext"] = {"frame": chosen[0], "wrench_local": plain(wrench)}
    entry["rnea_fext"] = plain(rnea - J.T @ wrench)
    entry["aba_fext"] = plain(np.linalg.solve(M, tau - nle + J.T @ wrench))
    entry["frames"] = frames(model, q, v, a, chosen)
    data = model.createData()
    pin.centerOfMass(model, data, q, v, a)
    entry |= {"com": plain(data.com[0]), "vcom": plain(data.vcom[0]), "acom": plain(data.acom[0])}
    entry["J_com"] = rows(pin.jacobianCenterOfMass(model, data, q), model.nv)
    entry["Ag"] = rows(pin.computeCentroidalMap(model, data, q), model.nv)
    entry["hg"] = six(pin.computeCentroidalMomentum(model, data, q, v))
    pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
    entry["dhg"] = six(data.dhg)
    pin.computeCentroidalMomentumTimeVariation(model, data, q, v, zero)
    entry["Agdot_v"] = six(data.dhg)
    entry["kinetic_energy"] = float(pin.computeKineticEnergy(model, data, q, v))
    entry["potential_energy"] = float(pin.computePotentialEnergy(model, data, q))
    after = pin.integrate(model, q, v * DT)
    entry |= {"q_integrated": plain(after), "q_difference": plain(pin.difference(model, q, after))}
    for what, ours, theirs in (
        ("M a + nle", M @ a + nle, rnea),
        ("M aba + nle", M @ np.array(entry["aba"]) + nle, tau),
        ("energy", v @ M @ v / 2, entry["kinetic_energy"]),
    ):
        scale = max(1.0, np.abs(theirs).max())
        assert np.abs(np.asarray(ours) - theirs).max() < 1e-9 * scale, f"{model.name}: {what}"
    return entry


def limits(model):
    found = {}
    for name, joint in list(zip(model.names, model.joints))[1:]:
        if joint.nv == 1 and joint.nq == 1:
            arrays = model.lowerPositionLimit, model.upperPositionLimit
            found[name] = [float(array[joint.idx_q]) for array in arrays]
            found[name] += [float(array[joint.idx_v]) for array in (model.velocityLimit, model.effortLimit)]
    return found


def document(name, model, floating, chosen, count):
    """Returns golden vectors of `count` states of a model, with Jacobians of the frames `chosen`."""
    model.gravity.linear = np.array(GRAVITY)
    random = np.random.default_rng(sum(name.encode()))
    cases = []
    for q in configurations(model, floating, random, count):
        v, a, tau = (random.uniform(-bound, bound, model.nv) for bound in (2.0, 5.0, 20.0))
        cases.append(case(model, q, v, a, tau, chosen, random.uniform(-10, 10, 6)))
    joints = [
        {"name": label, "idx_q": joint.idx_q, "nq": joint.nq, "idx_v": joint.idx_v, "nv": joint.nv}
        for label, joint in list(zip(model.names, model.joints))[1:]
    ]
    return {
        "format": 1,
        "robot": name,
        "source": {"pinocchio": pin.__version__},
        "floating_base": floating,
        "mimic": "ignored: mimic joints are independent",
        "nq": model.nq,
        "nv": model.nv,
        "total_mass": pin.computeTotalMass(model),
        "gravity": GRAVITY,
        "dt": DT,
        "joints": joints,
        "limits": limits(model),
        "jacobian_frames": chosen,
        "cases": cases,
    }


def catalogue_document(name):
    urdf = CATALOGUE / name / f"{name}.urdf"
    profile = tomllib.loads((CATALOGUE / name / f"{name}.toml").read_text())
    floating = profile.get("base") == "floating"
    model = pin.buildModelFromUrdf(str(urdf), *([pin.JointModelFreeFlyer()] if floating else []))
    chosen = [end["frame"] for part in ("end_effectors", "feet", "rotors") for end in profile.get(part, {}).values()]
    # The frames farthest from the base first; two suffice.
    chosen = (chosen or [[frame.name for frame in model.frames if frame.type == pin.FrameType.BODY][-1]])[:2]
    return document(name, model, floating, chosen, 4 if model.nv <= 9 else 2)


def main():
    names = sys.argv[1:] or sorted(path.name for path in CATALOGUE.iterdir() if path.is_dir())
    for name in names:
        out = HERE / "catalogue" / f"{name}.json"
        out.write_text(json.dumps(catalogue_document(name), separators=(",", ":")) + "\n")
        print(f"{out.name}: {out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
