"""Times DAQP on a file of recorded quadratic programs: for each line read, answers with the median time of a
solve over the file, in microseconds, as DAQP measures itself.

    pip install -r benches/peers/control.txt
"""

import json
import statistics
import sys

import daqp
import numpy as np


def problem(numbers):
    n = len(numbers["q"])
    lower = [np.array(numbers.get("lb", [-1e30] * n), dtype=float)]
    upper = [np.array(numbers.get("ub", [1e30] * n), dtype=float)]
    sense = [np.zeros(n, dtype=np.int32)]
    a = []
    if numbers.get("A"):
        a.append(np.array(numbers["A"], dtype=float))
        lower.append(np.array(numbers["b"], dtype=float))
        upper.append(np.array(numbers["b"], dtype=float))
        sense.append(np.full(len(numbers["b"]), 5, dtype=np.int32))
    if numbers.get("G"):
        g = np.array(numbers["G"], dtype=float)
        a.append(g)
        lower.append(np.array(numbers.get("lg", [-1e30] * len(g)), dtype=float))
        upper.append(np.array(numbers.get("ug", [1e30] * len(g)), dtype=float))
        sense.append(np.zeros(len(g), dtype=np.int32))
    matrix = np.vstack(a) if a else np.zeros((0, n))
    return (
        np.ascontiguousarray(numbers["P"], dtype=float),
        np.array(numbers["q"], dtype=float),
        np.ascontiguousarray(matrix),
        np.clip(np.concatenate(upper), -1e30, 1e30),
        np.clip(np.concatenate(lower), -1e30, 1e30),
        np.concatenate(sense),
    )


def main():
    data = json.load(open(sys.argv[1]))
    problems = [problem(numbers) for numbers in (data if isinstance(data, list) else [data])]
    for _ in sys.stdin:
        times = []
        for p in problems:
            _, _, flag, info = daqp.solve(*p)
            if flag < 1:
                raise SystemExit(f"DAQP: exit flag {flag}")
            times.append((info["solve_time"] + info.get("setup_time", 0.0)) * 1e6)
        print(statistics.median(times), flush=True)


main()
