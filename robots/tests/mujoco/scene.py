"""Writes MuJoCo's values for scene/scene.xml, a file with the features of MuJoCo Menagerie's, to scene.json.

pip install mujoco; python scene.py
"""

import json
import pathlib

import mujoco
import numpy as np

here = pathlib.Path(__file__).parent
model = mujoco.MjModel.from_xml_path(str(here / "scene" / "scene.xml"))
data = mujoco.MjData(model)
keys = {}
for key in range(model.nkey):
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    site = data.site("grip")
    keys[model.key(key).name] = {
        "qpos": data.qpos.tolist(),
        "M": mass[np.tril_indices(model.nv)].tolist(),
        "bias": data.qfrc_bias.tolist(),
        "site": site.xpos.tolist(),
    }
drives = {}
for index in range(model.nu):
    if model.actuator_trntype[index] == mujoco.mjtTrn.mjTRN_JOINT:
        squared = model.actuator_gear[index, 0] ** 2
        joint = model.joint(model.actuator_trnid[index, 0])
        drives[joint.name] = {
            "kp": model.actuator_gainprm[index, 0] * squared,
            "kd": -model.actuator_biasprm[index, 2] * squared,
            "effort": model.actuator_forcerange[index, 1] * abs(model.actuator_gear[index, 0]),
        }
document = {"mujoco": mujoco.__version__, "keys": keys, "drives": drives}
(here / "scene.json").write_text(json.dumps(document) + "\n")
print(json.dumps(document)[:1200])
