"""Writes dmp.json: reference movements and weights from code independent of the crate.

    pip install numpy==2.4.6 scipy==1.17.1 movement_primitives==0.9.1 pytransform3d==3.17.0
    python generate.py

The equations of the three variants are integrated by scipy's DOP853 (rtol 1e-13), the forcing term and the ridge weights
come from movement_primitives (BSD-3-Clause), rotations from scipy.
"""

import json
from pathlib import Path

import numpy as np
from movement_primitives.dmp._dmp import ridge_regression
from movement_primitives.dmp._forcing_term import ForcingTerm
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

DECAY = -np.log(0.01)
DAMPING = 25.0
STIFFNESS = DAMPING**2 / 4
KERNELS = 8
OVERLAP = 0.8


def forcing_term(weights):
    """weights: kernels x dimensions; the movement takes one second."""
    term = ForcingTerm(weights.shape[1], weights.shape[0], 1.0, 0.0, OVERLAP, DECAY)
    term.weights_ = weights.T
    return term


def phase(p):
    return np.exp(-DECAY * p)


def shape(term, p):
    """The weighted, normalised kernels without the gate, at one progress."""
    return term.forcing_term(np.array([phase(p)]))[:, 0] / phase(p)


def finite_gate(p):
    last = phase(1.0)
    return (phase(p) - last) / (1 - last) if p < 1 else 0.0


def quintic(start, rate, acceleration, goal):
    """Coefficients by the linear system of the six boundary conditions."""
    rows, right = [], []
    for t, order, value in [(0, 0, start), (0, 1, rate), (0, 2, acceleration), (1, 0, goal), (1, 1, 0), (1, 2, 0)]:
        rows.append([np.polyder(np.poly1d(np.eye(6)[5 - k]), order)(t) for k in range(6)])
        right.append(value)
    return np.poly1d(np.linalg.solve(np.array(rows, float), np.array(right, float))[::-1])


def movement(variant, weights, start, velocity, goal, duration, seconds):
    term = forcing_term(weights)
    curves = [quintic(y, v * duration, 0.0, g) for y, v, g in zip(start, velocity, goal)]

    def acceleration(t, y, v):
        p = t / duration
        if variant == "classic":
            f = phase(p) * shape(term, p)
            return (STIFFNESS * (goal - y) - DAMPING * duration * v + f) / duration**2
        if variant == "goal_safe":
            f = phase(p) * shape(term, p)
            pull = goal - y - (goal - start) * phase(p) + f
            return (STIFFNESS * pull - DAMPING * duration * v) / duration**2
        if p < 1:
            g, g1, g2 = (np.array([np.polyder(c, k)(p) for c in curves]) for k in range(3))
        else:
            g, g1, g2 = goal, np.zeros_like(goal), np.zeros_like(goal)
        f = finite_gate(p) * shape(term, p)
        return (STIFFNESS * (g - y) + DAMPING * (g1 - duration * v) + g2 + f) / duration**2

    def rates(t, state):
        y, v = np.split(state, 2)
        return np.concatenate([v, acceleration(t, y, v)])

    # the gate has a kink at the end: never step over it
    state, t0, samples = np.concatenate([start, velocity]), 0.0, []
    for t1 in sorted({*seconds, duration}):
        state = solve_ivp(rates, (t0, t1), state, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        t0 = t1
        if t1 in seconds:
            y, v = np.split(state, 2)
            samples.append({"t": t1, "y": y.tolist(), "v": v.tolist(), "a": acceleration(t1, y, v).tolist()})
    return samples


def fit():
    samples = 101
    t = np.linspace(0, 1, samples)
    y = np.stack([np.sin(2.0 * t) + 0.3 * t**2, np.cos(3.0 * t)], axis=1)
    v = np.stack([2 * np.cos(2.0 * t) + 0.6 * t, -3 * np.sin(3.0 * t)], axis=1)
    a = np.stack([-4 * np.sin(2.0 * t) + 0.6, -9 * np.cos(3.0 * t)], axis=1)
    goal, start = y[-1], y[0]
    design = forcing_term(np.zeros((KERNELS, 2))).design_matrix(t)
    s = phase(t)[:, None]
    classic = a - STIFFNESS * (goal - y) + DAMPING * v
    goal_safe = classic / STIFFNESS + (goal - start) * s
    lam = 1e-4
    psi = np.stack([np.exp(-h * (s[:, 0] - c) ** 2) for c, h in zip(
        forcing_term(np.zeros((KERNELS, 2))).centers, forcing_term(np.zeros((KERNELS, 2))).widths)])
    lwr = (psi * s[:, 0]) @ classic / ((psi * s[:, 0] ** 2).sum(axis=1))[:, None]
    return {
        "lambda": lam, "positions": y.tolist(), "velocities": v.tolist(), "accelerations": a.tolist(),
        "classic": ridge_regression(design, classic, lam).T.tolist(),
        "goal_safe": ridge_regression(design, goal_safe, lam).T.tolist(),
        "classic_locally_weighted": lwr.tolist(),
    }


def orientation(weights):
    start = Rotation.from_rotvec([0.3, -0.4, 0.2])
    goal = Rotation.from_rotvec([-1.2, 0.9, 1.4])
    duration = 1.6
    seconds = [0.1, 0.4, 0.8, 1.2, 1.6, 2.0]
    error = (goal * start.inv()).as_rotvec()
    h = 1e-3
    wanted = sorted({round(t + k * h, 9) for t in seconds for k in range(-3, 4)})
    path = movement("classic", weights, error, np.zeros(3), np.zeros(3), duration, wanted)
    rotations = {round(s["t"], 9): Rotation.from_rotvec(-np.array(s["y"])) * goal for s in path}
    samples = []
    for t in seconds:
        at = lambda k: (rotations[round(t + k * h, 9)] * rotations[round(t, 9)].inv()).as_rotvec()
        # sixth-order central difference of the rotation about its value at t
        omega = sum(c * (at(k) - at(-k)) for k, c in [(1, 3 / 4), (2, -3 / 20), (3, 1 / 60)]) / h
        samples.append({"t": t, "q_xyzw": rotations[round(t, 9)].as_quat(canonical=True).tolist(), "omega": omega.tolist()})
    return {"start_xyzw": start.as_quat().tolist(), "goal_xyzw": goal.as_quat().tolist(), "duration": duration,
            "weights": weights.tolist(), "samples": samples}


def main():
    generator = np.random.default_rng(7)
    weights = generator.normal(size=(KERNELS, 2)) * 120
    start, velocity, goal = np.array([0.2, -0.5]), np.array([0.4, -0.1]), np.array([0.9, -0.6])
    duration, seconds = 1.7, [0.05, 0.3, 0.8, 1.2, 1.7, 1.9, 2.6]
    movements = {}
    for variant, factor in [("classic", 1.0), ("goal_safe", 1 / STIFFNESS), ("quintic_goal", 1.0)]:
        movements[variant] = {"weights": (weights * factor).tolist(),
                              "samples": movement(variant, weights * factor, start, velocity, goal, duration, seconds)}
    features = [{"p": p, "values": (forcing_term(np.eye(KERNELS)).forcing_term(np.array([phase(p)]))[:, 0]).tolist()}
                for p in [0.0, 0.13, 0.5, 0.99, 1.0, 1.4]]
    golden = {"start": start.tolist(), "velocity": velocity.tolist(), "goal": goal.tolist(), "duration": duration,
              "movements": movements, "features": features, "fit": fit(),
              "orientation": orientation(generator.normal(size=(KERNELS, 3)) * 60)}
    Path(__file__).with_name("dmp.json").write_text(json.dumps(golden) + "\n")


main()
