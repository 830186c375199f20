"""Writes oscillators.json: pattern generators integrated by code independent of the crate.

    pip install numpy==2.4.6 scipy==1.17.1
    python generate_oscillators.py

The published equations, term by term (lags as a matrix), by scipy's DOP853 (rtol 1e-11).
"""

import json
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

ENDS = [0.1, 0.5, 1.0, 2.0, 3.5]


def solve(rates, state, max_step=np.inf):
    out = solve_ivp(rates, (0, ENDS[-1]), state, method="DOP853", rtol=1e-11, atol=1e-12, t_eval=ENDS, max_step=max_step)
    return out.y.T


def network():
    n, d, nu = 4, 20.0, 1.3
    k = d * d / 4
    amp, off = np.array([0.5, 0.4, 0.3, 0.6]), np.array([0.1, -0.1, 0.2, 0.0])
    theta = np.array([0.0, np.pi, 1.5 * np.pi, 0.5 * np.pi])
    w = 4.0 * (np.ones((n, n)) - np.eye(n))
    lag = theta[None, :] - theta[:, None]
    start = np.array([0.2, 2.0, 5.0, 3.0])

    def rates(t, x):
        phi, a, da, o, do = np.split(x, 5)
        dphi = 2 * np.pi * nu + (a[None, :] * w * np.sin(phi[None, :] - phi[:, None] - lag)).sum(1)
        return np.concatenate([dphi, da, k * (amp - a) - d * da, do, k * (off - o) - d * do])

    states = solve(rates, np.concatenate([start, np.zeros(2 * n), off, np.zeros(n)]))
    outputs, speeds = [], []
    for x in states:
        phi, a, da, o, do = np.split(x, 5)
        dphi = rates(0, x)[:n]
        outputs.append((o + a * np.cos(phi)).tolist())
        speeds.append((do + da * np.cos(phi) - a * np.sin(phi) * dphi).tolist())
    return {"frequency": nu, "amplitude": amp.tolist(), "offset": off.tolist(), "theta": theta.tolist(), "weight": 4.0,
            "start": start.tolist(), "phases": (states[:, :n] % (2 * np.pi)).tolist(), "outputs": outputs, "velocities": speeds}


def hopf():
    theta = np.array([0.0, 2.0, 4.0])
    mu, gamma, st, sw, b, k = 0.49, 10.0, 5.0, 9.0, 20.0, 2.0
    start = np.array([0.7, 0.1, -0.3, 0.2, 0.6, -0.4])  # x0 y0 x1 y1 x2 y2

    def rates(t, s):
        z = s[0::2] + 1j * s[1::2]
        y = z.imag / np.sqrt(mu)
        omega = st / (np.exp(-b * y) + 1) + sw / (np.exp(b * y) + 1)
        dz = gamma * (mu - np.abs(z) ** 2) * z + 1j * omega * z
        for i in range(3):
            for j in range(3):
                if i != j:
                    dz[i] += k * (np.exp(1j * (theta[i] - theta[j])) * z[j] - z[i])
        out = np.empty(6)
        out[0::2], out[1::2] = dz.real, dz.imag
        return out

    return {"theta": theta.tolist(), "amplitude": float(np.sqrt(mu)), "convergence": gamma, "stance_speed": st, "swing_speed": sw,
            "sharpness": b, "coupling": k, "start": start.tolist(), "states": solve(rates, start, 0.01).tolist()}


def matsuoka():
    t1, t2, beta, c, w = 0.25, 0.5, 2.5, 1.0, 2.2
    weights = np.array([[0, w], [w, 0]])

    def rates(t, s):
        u, v = s[:2], s[2:]
        y = np.maximum(0, u)
        feedback = np.array([0.1 * np.sin(3 * t), 0.0])
        return np.concatenate([(-u - beta * v - weights @ y + c + feedback) / t1, (y - v) / t2])

    start = np.array([0.3, -0.2, 0.1, 0.0])
    states = solve(rates, start, 0.005)
    # the frequency without feedback, from upward zero crossings of u0 - u1 once it has settled
    free = solve_ivp(lambda t, s: np.concatenate([(-s[:2] - beta * s[2:] - weights @ np.maximum(0, s[:2]) + c) / t1,
                                                  (np.maximum(0, s[:2]) - s[2:]) / t2]),
                     (0, 60), start, method="DOP853", rtol=1e-9, atol=1e-10, max_step=0.01,
                     events=lambda t, s: s[0] - s[1])
    crossings = free.t_events[0][free.t_events[0] > 30]
    return {"w": w, "start": start.tolist(), "states": states.tolist(), "frequency": float(1 / (2 * np.mean(np.diff(crossings))))}


def kuramoto():
    n = 5
    rng = np.random.default_rng(2)
    omega, k, theta = rng.normal(6, 1, n), rng.uniform(0, 2, (n, n)), rng.uniform(0, 6, n)
    np.fill_diagonal(k, 0)
    start = rng.uniform(0, 6, n)
    lag = theta[None, :] - theta[:, None]
    rates = lambda t, p: omega + (k * np.sin(p[None, :] - p[:, None] - lag)).sum(1)
    return {"omega": omega.tolist(), "couplings": k.tolist(), "theta": theta.tolist(), "start": start.tolist(),
            "phases": (solve(rates, start) % (2 * np.pi)).tolist()}


golden = {"ends": ENDS, "network": network(), "hopf": hopf(), "matsuoka": matsuoka(), "kuramoto": kuramoto()}
Path(__file__).with_name("oscillators.json").write_text(json.dumps(golden) + "\n")
