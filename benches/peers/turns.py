"""Answers a measuring program: reads the name of a work a line, and prints the nanoseconds of processor time of one
call."""

import sys
import time


def serve(packages):
    """Serves the works of the package that the program names; `packages` has a function for each, which
    returns the works by name, or these and functions of words that return numbers, by name: the line
    `values NAME WORDS` is answered with them."""
    found = packages[sys.argv[1]]()
    works, values = found if isinstance(found, tuple) else (found, {})
    print(" ".join(works), flush=True)
    for line in sys.stdin:
        kind, *words = line.split()
        if kind == "values":
            print(" ".join(repr(float(number)) for number in values[words[0]](*words[1:])), flush=True)
            continue
        work = works[line.strip()]
        calls = max(1, int(0.001 / max(_seconds(work, 1), 1e-7)))
        print(_seconds(work, calls) * 1e9, flush=True)


def _seconds(work, calls):
    start = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - start) / calls
