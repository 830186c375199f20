"""Times movement_primitives and pydmps: reads a name a line, answers with the nanoseconds of
processor time of one call.

    pip install -r benches/peers/primitives.txt
"""

import numpy as np

from turns import serve

DIMENSIONS, KERNELS, SAMPLES = 14, 50, 200


def positions():
    p = np.linspace(0, 1, SAMPLES)[:, None]
    d = np.arange(1, DIMENSIONS + 1)
    return np.linspace(0, 1, SAMPLES), np.sin(d * np.pi * p / 4) + p**2


def movement_primitives():
    from movement_primitives.dmp import DMP
    from movement_primitives.promp import ProMP

    t, y = positions()
    dt = 1.0 / (SAMPLES - 1)

    def make():
        return DMP(n_dims=DIMENSIONS, execution_time=1.0, dt=dt, n_weights_per_dim=KERNELS)

    dmp = make()
    dmp.imitate(t, y)
    dmp.configure(start_y=np.zeros(DIMENSIONS), goal_y=np.ones(DIMENSIONS))
    state = {"y": np.zeros(DIMENSIONS), "v": np.zeros(DIMENSIONS), "left": 0}

    def step():
        if state["left"] == 0:
            dmp.reset()
            state.update(y=np.zeros(DIMENSIONS), v=np.zeros(DIMENSIONS), left=SAMPLES - 2)
        state["left"] -= 1
        state["y"], state["v"] = dmp.step(state["y"], state["v"])

    def fit():
        make().imitate(t, y)

    def rollout():
        dmp.open_loop(step_function="euler-cython")

    p = np.linspace(0, 1, 101)
    shown = np.stack([
        np.stack([
            np.sin(np.pi * (p + 0.2 * d)) * (1 + 0.1 * np.sin(n * 7 + d * 3 + 1)) + 0.05 * np.sin(n * 7 + d * 3 + 1) * p
            for d in range(2)], axis=1) for n in range(10)])
    times = np.tile(p, (10, 1))

    def em():
        promp = ProMP(n_dims=2, n_weights_per_dim=20)
        promp.imitate(times, shown)
        return promp

    promp = em()

    def condition():
        promp.condition_position(np.array([0.9, 0.8]), y_cov=np.eye(2) * 1e-6, t=0.5, t_max=1.0)

    return {"step_classic": step, "fit_classic": fit, "rollout_classic": rollout, "promp_em": em, "promp_condition": condition}


def pydmps():
    from pydmps.dmp_discrete import DMPs_discrete

    _, y = positions()

    def make():
        return DMPs_discrete(n_dmps=DIMENSIONS, n_bfs=KERNELS, dt=1.0 / SAMPLES)

    dmp = make()
    dmp.imitate_path(y_des=y.T.copy())
    state = {"left": 0}

    def step():
        if state["left"] == 0:
            dmp.reset_state()
            state["left"] = SAMPLES
        state["left"] -= 1
        dmp.step()

    def fit():
        make().imitate_path(y_des=y.T.copy())

    return {"step_classic": step, "fit_classic": fit, "rollout_classic": dmp.rollout}


serve({"movement_primitives": movement_primitives, "pydmps": pydmps})
