"""Writes library.json: decompositions of a motion library by numpy and scipy.

    pip install numpy==2.4.6 scipy==1.17.1
    python library.py
    python library.py train.jsonl    (prints the spectrum of recorded letters, and writes nothing)

Movements, forces (scipy.signal: the same sampled spring, inverted as a filter), singular values, projections onto the
leading eigenforces, splits, merges, the recursive mean and covariance, and what the eigenforces make of one movement.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy import linalg, signal
from scipy.interpolate import CubicSpline

SAMPLES, DOFS, MOVEMENTS, DAMPING = 48, 3, 14, 25.0
H = 1 / (SAMPLES - 1)
K = DAMPING**2 / 4



def spectrum_of_letters(file, along_lines, samples=200):
    """Shares of the variance of the first five eigenforces; every fifth recording of each letter is held out."""
    h, k = 1 / (samples - 1), DAMPING**2 / 4
    seen, columns = {}, []
    for line in open(file):
        letter = json.loads(line)
        seen[letter["label"]] = seen.get(letter["label"], 0) + 1
        if seen[letter["label"]] % 5 == 0:
            continue
        path = np.cumsum([letter["vx"], letter["vy"]], axis=1) / 200
        at = np.arange(path.shape[1])
        wanted = np.linspace(0, at[-1], samples)
        if along_lines:
            path = np.array([np.interp(wanted, at, y) for y in path])
        elif len(at) != samples:
            path = CubicSpline(at, path, axis=1, bc_type="natural")(wanted)
        v = np.diff(path, prepend=2 * path[:, :1] - path[:, 1:2], axis=1) / h
        a = np.diff(v, axis=1) / h
        columns.append((a - k * (path[:, -1:] - path[:, :-1]) + DAMPING * v[:, :-1]).ravel())
    variances = linalg.svdvals(np.array(columns).T) ** 2
    return len(columns), variances[:5] / variances.sum()


if sys.argv[1:]:
    np.set_printoptions(precision=9)
    for name, along_lines in (("splines", False), ("lines", True)):
        print(name, *spectrum_of_letters(sys.argv[1], along_lines))
    sys.exit()

rng = np.random.default_rng(5)
time = np.linspace(0, 1, SAMPLES)
paths = np.empty((MOVEMENTS, DOFS, SAMPLES))
for m in range(MOVEMENTS):
    for d in range(DOFS):
        a = rng.normal(size=5)
        paths[m, d] = a[0] + a[1] * time + 0.5 * sum(a[2 + k] / (k + 1) * np.sin((k + 1) * np.pi * time + m) for k in range(3))
paths = np.round(paths, 6)


def forces(path):
    v = np.diff(path, prepend=path[0] - (path[1] - path[0])) / H
    a = np.diff(v) / H
    return a - K * (path[-1] - path[:-1]) + DAMPING * v[:-1]


def response(f):
    """y_{k+1} - 2 y_k + y_{k-1} = h^2 (f_k - K y_k) - h D (y_k - y_{k-1}), as a filter."""
    return signal.lfilter([H * H], [1, -2 + H * H * K + H * DAMPING, 1 - H * DAMPING], f)


F = np.array([np.concatenate([forces(p) for p in movement]) for movement in paths]).T
P = np.array([np.concatenate([response(f) for f in np.split(column, DOFS)]) for column in F.T]).T
M = SAMPLES - 1


def svd(matrix):
    return linalg.svd(matrix, full_matrices=False, lapack_driver="gesvd")


def approximation(matrix, column, n):
    u = svd(matrix)[0][:, :n]
    return u @ (u.T @ column)


U, S, Vt = svd(F)
arms = np.r_[0:M, 2 * M : 3 * M]
position = approximation(P, P[:, 3], 4)
centred = np.cov(F[:M])
out = {
    "samples": SAMPLES,
    "damping": DAMPING,
    "paths": paths.tolist(),
    "forces_of_3": F[:, 3].tolist(),
    "response_of_3": P[:, 3].tolist(),
    "singular": S.tolist(),
    "singular_position": svd(P)[1].tolist(),
    "approximation_of_3_by_4": approximation(F, F[:, 3], 4).tolist(),
    "position_approximation_of_3_by_4": position.tolist(),
    "singular_of_dofs_0_2": svd(F[arms])[1].tolist(),
    "approximation_of_dofs_0_2_by_4": approximation(F[arms], F[arms, 3], 4).tolist(),
    "singular_of_first_9": svd(F[:, :9])[1].tolist(),
    "forgetting_0_9": svd(F[:, 8:9] * 0 + F[:, :9] @ np.diag(0.9 ** np.arange(8, -1, -1)))[1].tolist(),
    "variances_of_dof_0": np.linalg.eigvalsh(centred)[::-1][:10].tolist(),
    "mean_of_dof_0": F[:M].mean(axis=1).tolist(),
}
Path(__file__).with_name("library.json").write_text(json.dumps(out))
