"""Times cma and bayesian-optimization: reads a name a line, answers with the nanoseconds of processor time
of one call.

    pip install -r benches/peers/learning.txt
"""

import numpy as np

from turns import serve

GENERATIONS, POINTS, DIMENSIONS = 200, 35, 6


def cma():
    import cma as package

    def search(n):
        scales = 10.0 ** (6.0 * np.arange(n) / (n - 1))
        state = {"search": None, "generation": GENERATIONS, "seed": 0}

        def iteration():
            if state["generation"] == GENERATIONS:
                state["seed"] += 1
                options = {"seed": state["seed"], "verbose": -9}
                state.update(search=package.CMAEvolutionStrategy(n * [1.0], 1.0, options), generation=0)
            state["generation"] += 1
            points = state["search"].ask()
            state["search"].tell(points, [float(scales @ (x * x)) for x in points])

        return iteration

    return {"cma_10": search(10), "cma_50": search(50)}


def bayesian_optimization():
    from bayes_opt import BayesianOptimization, acquisition

    def value(x):
        return -np.sum((x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2)

    names = [f"x{i}" for i in range(DIMENSIONS)]
    search = BayesianOptimization(
        f=None,
        pbounds={name: (-2.0, 2.0) for name in names},
        acquisition_function=acquisition.ExpectedImprovement(xi=0.01),
        random_state=1,
        verbose=0,
    )
    for point in np.random.default_rng(1).uniform(-2.0, 2.0, (POINTS, DIMENSIONS)):
        search.register(params=dict(zip(names, point)), target=float(value(point)))

    return {"bayesian_6_at_35": search.suggest}


serve({"cma": cma, "bayesian-optimization": bayesian_optimization})
