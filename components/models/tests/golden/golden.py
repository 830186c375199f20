"""Golden numbers of Gaussian processes, latent spaces and hidden Markov models, from GPy, scikit-learn and hmmlearn.

python -m venv venv && venv/bin/pip install numpy scipy scikit-learn GPy hmmlearn && venv/bin/python golden.py
"""

import json
import pathlib

import GPy
import numpy as np
from hmmlearn.hmm import GaussianHMM
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process import kernels as sk

HERE = pathlib.Path(__file__).parent


def write(name, value):
    (HERE / name).write_text(json.dumps(value, default=lambda a: np.asarray(a).tolist()) + "\n")


def data(n, q, d, phase):
    i = np.arange(n)[:, None]
    x = np.sin(0.7 * i + 1.9 * np.arange(q) + phase) * (1 + 0.3 * np.arange(q))
    y = np.sin(x @ np.cos(np.arange(q * d).reshape(q, d))) + 0.1 * np.cos(3.1 * i + np.arange(d))
    return x, y


def gaussian_processes():
    x, y = data(25, 2, 2, 0.4)
    query = np.array([[0.1, -0.3], [0.9, 0.7]])
    k = GPy.kern
    cases = {
        "rbf": k.RBF(2, 1.7, [0.8, 1.3], ARD=True),
        "matern32": k.Matern32(2, 1.7, [0.8, 1.3], ARD=True),
        "matern52": k.Matern52(2, 1.7, [0.8, 1.3], ARD=True),
        "isotropic": k.Matern52(2, 0.9, 0.6),
        "periodic": k.StdPeriodic(2, 1.2, period=2.3, lengthscale=[0.9, 1.1], ARD1=False, ARD2=True),
        "linear": k.Linear(2, [0.5, 0.8], ARD=True) + k.Bias(2, 0.3),
        "white": k.RBF(2, 1.1, 0.7) + k.White(2, 0.2),
        "product": k.RBF(2, 1.1, [0.7, 0.9], ARD=True) * k.Linear(2, [0.5, 0.8], ARD=True) + k.Matern32(2, 0.4, 1.5),
    }
    out = {"x": x, "y": y, "query": query, "noise": 0.05, "cases": {}}
    for name, kernel in cases.items():
        model = GPy.models.GPRegression(x, y, kernel, noise_var=0.05)
        mean, variance = model.predict(query)
        # GPy's StdPeriodic stores variance, period, length scales; ours variance, length scales, period
        value = np.array(model.param_array)
        slope = -np.array(model._log_likelihood_gradients()) * value
        order = np.arange(len(value))
        if name == "periodic":
            order = [0, 2, 3, 1, 4]
        out["cases"][name] = {
            "parameters": np.log(value)[order],
            "energy": -float(model.log_likelihood()),
            "gradient": slope[order],
            "mean": mean,
            "variance": variance[:, 0],
        }
    kernel = sk.ConstantKernel(1.0) * sk.Matern([1.0, 1.0], nu=2.5) + sk.WhiteKernel(0.1)
    fit = GaussianProcessRegressor(kernel, alpha=1e-8, n_restarts_optimizer=5, random_state=0).fit(x, y[:, 0])
    mean, deviation = fit.predict(query, return_std=True)
    out["fitted"] = {
        "energy": -fit.log_marginal_likelihood_value_,
        "parameters": np.array([fit.kernel_.theta[i] for i in range(4)]),
        "mean": mean,
        "variance": deviation**2,
    }
    write("gp.json", out)


def latent():
    x, y = data(30, 2, 5, 0.9)
    kernel = GPy.kern.RBF(2, 1.4, [0.7, 1.2], ARD=True)
    model = GPy.models.GPLVM(y, 2, X=x.copy(), kernel=kernel)
    model.likelihood.variance = 0.03
    value = np.array(model.param_array)
    n = x.size
    slope = -np.array(model._log_likelihood_gradients())
    write(
        "gplvm.json",
        {
            "x": x,
            "y": y,
            "parameters": np.log(value[n:]),
            "energy": -float(model.log_likelihood()),
            "by_points": slope[:n].reshape(x.shape),
            "by_parameters": slope[n:] * value[n:],
        },
    )


def markov():
    rng = np.random.default_rng(3)
    state, rows = 0, []
    centres = np.array([[0.0, 0.0], [2.0, 1.0], [-1.0, 3.0]])
    for _ in range(120):
        if rng.random() < 0.1:
            state = (state + 1) % 3
        rows.append(centres[state] + 0.6 * rng.standard_normal(2))
    y = np.round(np.array(rows), 6)
    lengths = [70, 50]
    out = {"y": y, "lengths": lengths}
    start = np.array([0.5, 0.3, 0.2])
    move = np.array([[0.8, 0.1, 0.1], [0.2, 0.7, 0.1], [0.1, 0.2, 0.7]])
    for kind in ["diag", "full"]:
        model = GaussianHMM(3, kind, init_params="", n_iter=15, tol=-1, covars_prior=0 if kind == "full" else 0,
                            covars_weight=1, means_weight=0)
        model.startprob_, model.transmat_ = start, move
        model.means_ = centres + np.array([0.4, -0.3])
        model.covars_ = np.ones((3, 2)) if kind == "diag" else np.array([np.eye(2)] * 3)
        first = model.score(y, lengths)
        path = model.predict(y, lengths)
        model.fit(y, lengths)
        out[kind] = {
            "score": first,
            "path": path,
            "fitted_score": model.score(y, lengths),
            "fitted_means": model.means_,
            "fitted_covariances": model.covars_,
            "fitted_transitions": model.transmat_,
            "fitted_start": model.startprob_,
            "fitted_path": model.predict(y, lengths),
        }
    write("hmm.json", out)


for make in [gaussian_processes, latent, markov]:
    make()
