#!/usr/bin/env python3
"""Writes a small actuator network and its outputs computed with numpy: actuator_network.safetensors and .json next to this script.

    python3 robots/tests/golden/actuator_network.py

Six inputs (position errors now, 10 ms and 20 ms ago, then the velocities at the same times), two hidden layers of eight, softsign
between the layers, one output. Measurements are 2 ms apart; times before the first measurement use the first measurement.
"""

import json
import pathlib
import struct

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
random = np.random.default_rng(2019)
sizes = [6, 8, 8, 1]
tensors = {}
for index, (inputs, outputs) in enumerate(zip(sizes, sizes[1:])):
    tensors[f"{2 * index}.weight"] = random.normal(0.0, 0.6, (outputs, inputs)).astype("<f4")
    tensors[f"{2 * index}.bias"] = random.normal(0.0, 0.3, outputs).astype("<f4")

header, data = {"__metadata__": {"format": "pt"}}, b""
for name, tensor in tensors.items():
    numbers = tensor.tobytes()
    header[name] = {"dtype": "F32", "shape": list(tensor.shape), "data_offsets": [len(data), len(data) + len(numbers)]}
    data += numbers
text = json.dumps(header).encode()
text += b" " * (-len(text) % 8)
(HERE / "actuator_network.safetensors").write_bytes(struct.pack("<Q", len(text)) + text + data)


def effort(inputs):
    x = inputs
    for index in range(3):
        x = tensors[f"{2 * index}.weight"].astype(float) @ x + tensors[f"{2 * index}.bias"].astype(float)
        if index < 2:
            x = x / (1.0 + np.abs(x))
    return x[0]


count = 60
time = 0.002 * np.arange(count)
error, velocity = 0.3 * np.cos(9.0 * time) + 0.1, 4.0 * np.sin(17.0 * time + 0.4)
before = lambda values, step, steps: values[max(step - steps, 0)]
position_scale, velocity_scale, effort_scale = 2.0, 0.25, 20.0
efforts = [
    effort_scale
    * effort(
        np.array(
            [position_scale * before(error, step, steps) for steps in (0, 5, 10)]
            + [velocity_scale * before(velocity, step, steps) for steps in (0, 5, 10)]
        )
    )
    for step in range(count)
]
result = {"error": error.tolist(), "velocity": velocity.tolist(), "effort": efforts}
(HERE / "actuator_network.json").write_text(json.dumps(result) + "\n")
