"""Writes MuJoCo's values for world.xml to world.json: a height field, a body with several geoms, and connected bodies.

pip install mujoco; python world.py
"""

import json
import pathlib

import mujoco
import numpy as np

here = pathlib.Path(__file__).parent
model = mujoco.MjModel.from_xml_path(str(here / "world.xml"))
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)

# Heights of the field, by rays from above.
random = np.random.default_rng(7)
places, heights = [], []
group = np.ones(6, dtype=np.uint8)
for _ in range(60):
    local = random.uniform([-1.9, -1.4], [1.9, 1.4])
    turn = np.deg2rad(30.0)
    x = 3 + np.cos(turn) * local[0] - np.sin(turn) * local[1]
    y = 1 + np.sin(turn) * local[0] + np.cos(turn) * local[1]
    geom = np.array([-1], dtype=np.int32)
    distance = mujoco.mj_ray(model, data, np.array([x, y, 5.0]), np.array([0.0, 0.0, -1.0]), group, 1, -1, geom)
    assert model.geom(geom[0]).name == "field"
    places.append([x, y])
    heights.append(5.0 - distance)

# Inertia of the body with several geoms about its origin, in its axes: the angular block of the mass matrix of its free joint.
mass = np.zeros((model.nv, model.nv))
for column in range(model.nv):
    mujoco.mj_mulM(model, data, mass[column], np.eye(model.nv)[column])
hammer = model.body("hammer").id
pose = data.xmat[hammer].reshape(3, 3)
document = {
    "mujoco": mujoco.__version__,
    "places": places,
    "heights": heights,
    "mass": mass[0, 0],
    "centre": (pose.T @ (data.subtree_com[hammer] - data.xpos[hammer])).tolist(),
    "inertia": mass[3:6, 3:6].flatten().tolist(),
}
(here / "world.json").write_text(json.dumps(document) + "\n")
print(json.dumps(document)[:600])
