#!/usr/bin/env python3
"""Scans in MuJoCo, timed: asked over standard input by `cargo bench --bench rays`.

    rays.py RANGE

Reads a line of MJCF, then three lines `WORD REPEATS ORIGINS DIRECTIONS`, and prints "ready"; then answers `time WORD` by the
microseconds per scan of REPEATS scans, and `distances WORD` by the distances, -1 where nothing is met.

Rays from one point are one call of mj_multiRay. The scan `heights` has an origin for each ray, which that function does not
take: it is 187 rangefinders of the model, evaluated in one call of mj_sensorPos.
"""

import os
import sys
import time

import mujoco
import numpy as np

reach = float(sys.argv[1])
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

model = mujoco.MjModel.from_xml_string(sys.stdin.readline())
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)


class Rays:
    def __init__(self, numbers):
        half = len(numbers) // 2
        self.origin, self.count = numbers[:3].copy(), half // 3
        self.directions = numbers[half:].copy()
        self.ids = np.zeros(self.count, np.int32)
        self.found = np.zeros(self.count)

    def cast(self):
        mujoco.mj_multiRay(model, data, self.origin, self.directions, None, True, -1, self.ids, self.found, None,
                           self.count, reach)

    def distances(self):
        return np.where(self.found > reach, -1.0, self.found)


class Rangefinders:
    def cast(self):
        mujoco.mj_sensorPos(model, data)

    def distances(self):
        return np.where(data.sensordata > reach, -1.0, data.sensordata)


scans, repeats = {}, {}
for _ in range(3):
    word, count, *numbers = sys.stdin.readline().split()
    repeats[word] = int(count)
    scans[word] = Rangefinders() if word == "heights" else Rays(np.array(numbers, float))
print("ready", file=answers, flush=True)
for line in sys.stdin:
    question, word = line.split()
    scan = scans[word]
    if question == "time":
        start = time.perf_counter_ns()
        for _ in range(repeats[word]):
            scan.cast()
        print((time.perf_counter_ns() - start) / 1e3 / repeats[word], file=answers, flush=True)
    else:
        print(*(repr(float(number)) for number in scan.distances()), file=answers, flush=True)
