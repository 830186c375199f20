"""Writes probabilistic.json: mixtures, regressions and probabilistic primitives, by code independent of the crate.

    pip install numpy==2.4.6 scipy==1.17.1 scikit-learn==1.9.1 movement_primitives==0.9.1 pytransform3d==3.17.0
    python generate_probabilistic.py

GMM: scikit-learn; GMR and KMP: the formulas, written out with numpy's inv; ProMP conditioning: movement_primitives
(BSD-3-Clause); ProMP likelihood: scipy's multivariate normal; polynomials: scikit-learn.
"""

import json
from pathlib import Path

import numpy as np
from movement_primitives.promp import ProMP
from scipy.stats import multivariate_normal
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.mixture import GaussianMixture
from sklearn.preprocessing import PolynomialFeatures

rng = np.random.default_rng(11)


def gmm():
    parts = [rng.normal(size=(60, 3)) @ np.array(a) + m for a, m in [
        ([[0.3, 0.1, 0], [0, 0.2, 0.1], [0, 0, 0.4]], [0, 0, 1]),
        ([[0.2, 0, -0.1], [0, 0.5, 0.2], [0, 0, 0.2]], [3, 1, 0]),
        ([[0.4, 0.2, 0.1], [0, 0.3, 0], [0, 0, 0.3]], [1, 4, -2])]]
    x = np.round(np.concatenate(parts), 4)
    start_means = np.array([[0.5, 0.5, 0.5], [2.5, 1.5, 0.0], [1.0, 3.0, -1.0]])
    floor = 1e-5 * x.var(axis=0, ddof=0).mean()
    model = GaussianMixture(3, covariance_type="full", tol=1e-12, reg_covar=floor, max_iter=500, means_init=start_means,
                            weights_init=np.ones(3) / 3, precisions_init=np.stack([np.eye(3)] * 3)).fit(x)
    # regression of the last two coordinates on the first
    queries, predictions = [-0.5, 0.7, 1.5, 3.2], []
    for q in queries:
        h, m, s = [], [], []
        for pi, mu, cov in zip(model.weights_, model.means_, model.covariances_):
            h.append(pi * multivariate_normal.pdf(q, mu[0], cov[0, 0]))
            m.append(mu[1:] + cov[1:, 0] / cov[0, 0] * (q - mu[0]))
            s.append(cov[1:, 1:] - np.outer(cov[1:, 0], cov[0, 1:]) / cov[0, 0])
        h = np.array(h) / np.sum(h)
        mean = sum(a * b for a, b in zip(h, m))
        cov = sum(a * (c + np.outer(b, b)) for a, b, c in zip(h, m, s)) - np.outer(mean, mean)
        predictions.append({"x": q, "mean": mean.tolist(), "covariance": cov.tolist()})
    return {"samples": x.tolist(), "start_means": start_means.tolist(), "floor": 1e-5, "weights": model.weights_.tolist(),
            "means": model.means_.tolist(), "covariances": model.covariances_.tolist(),
            "log_likelihood": float(model.score(x) * len(x)), "bic": float(model.bic(x)), "predictions": predictions}


def kmp():
    n, o, length, l1, l2 = 12, 2, 0.1, 1.0, 60.0
    s = np.linspace(0, 1, n)
    mu = np.stack([np.sin(3 * s), s**2], axis=1)
    cov = np.stack([np.diag([0.02 + 0.05 * t, 0.03]) + 0.005 for t in s])
    k = np.kron(np.exp(-((s[:, None] - s) ** 2) / length), np.eye(o))
    big = np.zeros((n * o, n * o))
    for i in range(n):
        big[i * o:(i + 1) * o, i * o:(i + 1) * o] = cov[i]
    answers = []
    for q in [0.03, 0.5, 1.2]:
        row = np.kron(np.exp(-((q - s) ** 2) / length), np.eye(o))
        mean = row @ np.linalg.inv(k + l1 * big) @ mu.ravel()
        variance = n / l2 * (np.eye(o) - row @ np.linalg.inv(k + l2 * big) @ row.T)
        answers.append({"s": q, "mean": mean.tolist(), "covariance": variance.tolist()})
    return {"length": length, "inputs": s.tolist(), "means": mu.tolist(), "covariances": cov.tolist(), "answers": answers}


def promp():
    n, d = 8, 2
    mp = ProMP(n_dims=d, n_weights_per_dim=n)
    a = rng.normal(size=(n * d, n * d)) * 0.3
    mean, cov = rng.normal(size=n * d), a @ a.T + 0.05 * np.eye(n * d)
    mp.from_weight_distribution(mean, cov)
    t = np.linspace(0, 1, 7)
    bent = mp.condition_position(np.array([0.4, -0.7]), y_cov=np.diag([1e-3, 2e-3]), t=0.35, t_max=1.0)
    result = {"mean": mean.tolist(), "covariance": cov.tolist(), "phases": t.tolist(),
              "positions": mp.mean_trajectory(t).tolist(), "variances": mp.var_trajectory(t).tolist(),
              "bent_mean": bent.weight_mean.tolist(), "bent_covariance": bent.weight_cov.tolist()}
    # the likelihood that expectation maximisation increases, by scipy: noisy samples of movements of one distribution
    shown, steps = [], 25
    ts = np.linspace(0, 1, steps)
    for _ in range(12):
        w = rng.multivariate_normal(mean, cov)
        y = mp.trajectory_from_weights(ts, w)
        shown.append(np.round(y + 0.05 * rng.normal(size=y.shape), 5))
    result["shown"] = [y.tolist() for y in shown]
    c = np.linspace(0, 1, n)
    h = -1.0 / (8.0 * n**2 * np.log(0.7))
    phi = np.exp(-((ts[:, None] - c) ** 2) / (2 * h))
    phi /= phi.sum(1, keepdims=True)
    big = np.kron(np.eye(d), phi)
    y = np.stack([s.T.ravel() for s in shown])

    def likelihood(m, s, noise):
        return multivariate_normal.logpdf(y, big @ m, big @ s @ big.T + noise * np.eye(len(big))).sum()

    # expectation maximisation, term by term, from the same ridge start and with the same jitter
    gram, carried = big.T @ big, y @ big
    w = np.linalg.solve(gram + 1e-6 * np.eye(n * d), carried.T).T


    def shrunk(s, k):
        """Posterior mode under an inverse-Wishart prior of scale k times the blocks of the dimensions."""
        blocks = s * np.kron(np.eye(d), np.ones((n, n)))
        return (k * blocks + len(y) * s) / (k + len(y))

    def improved(k):
        m, s = w.mean(0), shrunk(np.cov(w.T), k)
        s += np.eye(n * d) * 1e-4 * np.trace(s) / (n * d)
        noise = ((y - w @ big.T) ** 2).sum() / y.size
        trace = [likelihood(m, s, noise)]
        for _ in range(20):
            p = np.linalg.inv(s)
            post = np.linalg.inv(gram / noise + p)
            ms = (carried / noise + p @ m) @ post
            m = ms.mean(0)
            s = shrunk(post + (ms - m).T @ (ms - m) / len(ms), k)
            s += np.eye(n * d) * 1e-6 * np.trace(s) / (n * d)
            noise = (((y - ms @ big.T) ** 2).sum() + len(ms) * np.trace(gram @ post)) / y.size
            trace.append(likelihood(m, s, noise))
        return m, s, noise, trace

    m, s, noise, trace = improved(0.0)
    result.update({"em_mean": m.tolist(), "em_noise": noise, "em_covariance": s.tolist(), "em_likelihood": trace})
    m, s, noise, _ = improved(3.0)
    result.update({"shrunk_mean": m.tolist(), "shrunk_noise": noise, "shrunk_covariance": s.tolist()})
    return result


def polynomial():
    x = rng.uniform(-1, 1, size=(40, 2))
    y = np.stack([1 + x[:, 0] - 2 * x[:, 1] ** 2 + 0.1 * rng.normal(size=40), np.sin(x[:, 0] * x[:, 1])], axis=1)
    cubic = PolynomialFeatures(3, include_bias=False).fit_transform(x)
    linear, ridge = LinearRegression().fit(cubic, y), Ridge(alpha=0.1).fit(x, y)
    # scikit-learn centres, which leaves the constant out of the penalty
    return {"x": x.tolist(), "y": y.tolist(), "cubic": np.vstack([linear.intercept_, linear.coef_.T]).tolist(),
            "linear_ridge": np.vstack([ridge.intercept_, ridge.coef_.T]).tolist()}


golden = {"gmm": gmm(), "kmp": kmp(), "promp": promp(), "polynomial": polynomial()}
Path(__file__).with_name("probabilistic.json").write_text(json.dumps(golden) + "\n")
