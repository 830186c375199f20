"""Writes movements.json: rhythmic, striking and coupled movements, by code independent of the crate.

    pip install numpy==2.4.6 scipy==1.17.1
    python generate_movements.py

The published equations are integrated by scipy's DOP853 (rtol 1e-12); rhythmic weights come from numpy's lstsq.
"""

import json
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

DAMPING, DECAY, OVERLAP = 25.0, -np.log(0.01), 0.8
STIFFNESS = DAMPING**2 / 4


def shape(weights, s):
    """sum(psi w) / sum(psi) over the phase."""
    n = len(weights)
    c = np.exp(-DECAY * np.arange(n) / (n - 1))
    h = -np.log(OVERLAP) / np.diff(c) ** 2
    h = np.append(h, h[-1])
    psi = np.exp(-h * (s - c) ** 2)
    return psi @ weights / psi.sum()


def solve(rates, state, ends, max_step=np.inf):
    out, t0 = [], 0.0
    for t1 in ends:
        if t1 > t0:
            state = solve_ivp(rates, (t0, t1), state, method="DOP853", rtol=1e-12, atol=1e-13, max_step=max_step).y[:, -1]
        t0 = t1
        out.append(state)
    return out


def rhythmic():
    n, dims, period, width = 9, 2, 0.8, 9.0
    rng = np.random.default_rng(3)
    weights, g, r = rng.normal(size=(n, dims)) * 60, np.array([0.3, -1.0]), 1.4
    tau, c = period / (2 * np.pi), 2 * np.pi * np.arange(n) / n
    y0, v0, phi0 = np.array([0.5, 0.1]), np.array([-1.0, 2.0]), 1.1

    def rates(t, x):
        y, v = np.split(x, 2)
        psi = np.exp(width * (np.cos(phi0 + t / tau - c) - 1))
        f = r * (psi @ weights) / psi.sum()
        return np.concatenate([v, (STIFFNESS * (g - y) - DAMPING * tau * v + f) / tau**2])

    ends = [0.05, 0.2, 0.5, 0.8, 1.3, 2.4]
    samples = [{"t": t, "y": x[:dims].tolist(), "v": x[dims:].tolist()} for t, x in zip(ends, solve(rates, np.concatenate([y0, v0]), ends))]
    # one period to be fitted, and the numpy result
    m, k = 200, 20
    phi = 2 * np.pi * np.arange(m) / m
    y = np.stack([np.sin(phi) + 0.3 * np.cos(3 * phi), 0.5 + 0.2 * np.cos(phi) ** 3], axis=1)
    step = 2 * np.pi / m
    rate = (np.roll(y, -1, 0) - np.roll(y, 1, 0)) / (2 * step)
    acc = (np.roll(y, -1, 0) - 2 * y + np.roll(y, 1, 0)) / step**2
    base = 0.5 * (y.min(0) + y.max(0))
    target = acc - STIFFNESS * (base - y) + DAMPING * rate
    cc = 2 * np.pi * np.arange(k) / k
    psi = np.exp(k * (np.cos(phi[:, None] - cc) - 1))
    features = psi / psi.sum(1, keepdims=True)
    fitted = np.linalg.lstsq(features, target, rcond=None)[0]
    return {"period": period, "width": width, "phase": phi0, "amplitude": r, "baseline": g.tolist(), "weights": weights.tolist(),
            "start": y0.tolist(), "velocity": v0.tolist(), "samples": samples,
            "fit": {"positions": y.tolist(), "baseline": base.tolist(), "weights": fitted.tolist(),
                    "locally_weighted": (psi.T @ target / psi.sum(0)[:, None]).tolist()}}


def quintic(y0, r0, a0, y1, r1):
    rows, right = [], []
    for t, order, value in [(0, 0, y0), (0, 1, r0), (0, 2, a0), (1, 0, y1), (1, 1, r1), (1, 2, 0)]:
        rows.append([np.polyder(np.poly1d(np.eye(6)[5 - k]), order)(t) for k in range(6)])
        right.append(value)
    return np.poly1d(np.linalg.solve(np.array(rows, float), np.array(right, float))[::-1])


def striking():
    duration, start, velocity = 1.3, np.array([0.1, 0.4]), np.array([0.5, -0.2])
    goal, final = np.array([0.8, -0.3]), np.array([2.0, -1.5])
    weights = np.random.default_rng(5).normal(size=(8, 2)) * 100
    curves = [quintic(y, v * duration, 0, g, f * duration) for y, v, g, f in zip(start, velocity, goal, final)]
    last = np.exp(-DECAY)

    def rates(t, x):
        y, v = np.split(x, 2)
        p = t / duration
        if p < 1:
            g, g1, g2 = (np.array([np.polyder(c, k)(p) for c in curves]) for k in range(3))
            s = np.exp(-DECAY * p)
            f = (s - last) / (1 - last) * shape(weights, s)
        else:
            g, g1, g2, f = goal + final * (t - duration), final * duration, 0.0, 0.0
        return np.concatenate([v, (STIFFNESS * (g - y) + DAMPING * (g1 - duration * v) + g2 + f) / duration**2])

    ends = [0.1, 0.5, 1.0, 1.3, 1.5]
    states = solve(rates, np.concatenate([start, velocity]), ends)
    return {"duration": duration, "start": start.tolist(), "velocity": velocity.tolist(), "goal": goal.tolist(),
            "final_velocity": final.tolist(), "weights": weights.tolist(),
            "samples": [{"t": t, "y": x[:2].tolist(), "v": x[2:].tolist()} for t, x in zip(ends, states)]}


def coupled():
    """Classic and goal-safe, past a point obstacle (Hoffmann 2009), while a constant error slows the phase."""
    duration, start, goal = 1.5, np.zeros(3), np.array([1.0, 0.2, 0.1])
    obstacle, gamma, beta, phase_rate = np.array([0.5, 0.15, 0.02]), 300.0, 20 / np.pi, 0.6
    weights = np.random.default_rng(9).normal(size=(8, 3)) * 40

    def coupling(y, v):
        to = obstacle - y
        axis = np.cross(to, v)
        n = np.linalg.norm(axis)
        if n <= 1e-12 * np.linalg.norm(to) * np.linalg.norm(v):
            return np.zeros(3)
        phi = np.arctan2(n, to @ v)
        return gamma * np.cross(axis / n, v) * phi * np.exp(-beta * phi)

    result = {"duration": duration, "goal": goal.tolist(), "obstacle": obstacle.tolist(), "gamma": gamma,
              "phase_rate": phase_rate, "weights": weights.tolist()}
    ends = [0.2, 0.6, 1.0, 1.5, 2.2]
    for name in ["classic", "goal_safe"]:
        scale = 1.0 if name == "classic" else 1 / STIFFNESS

        def rates(t, x):
            y, v = np.split(x, 2)
            s = np.exp(-DECAY * phase_rate * t / duration)
            f = s * shape(weights * scale, s)
            pull = STIFFNESS * (goal - y) + f if name == "classic" else STIFFNESS * (goal - y - (goal - start) * s + f)
            return np.concatenate([v, (pull - DAMPING * duration * v) / duration**2 + coupling(y, v)])

        states = solve(rates, np.concatenate([start, np.zeros(3)]), ends)
        result[name] = [{"t": t, "y": x[:3].tolist(), "v": x[3:].tolist()} for t, x in zip(ends, states)]
    return result


golden = {"rhythmic": rhythmic(), "striking": striking(), "coupled": coupled()}
Path(__file__).with_name("movements.json").write_text(json.dumps(golden) + "\n")
