"""A node of the caterpillar: `node.py source|relay|sink COUNT [RESULT]`. The last sink writes its samples (ns) to RESULT.

Used where the Rust program beside it is not built.
"""

import json
import sys
import time

import pyarrow
from dora import Node

WARM_UP = 100


def main():
    role = sys.argv[1]
    count = int(sys.argv[2])
    result = sys.argv[3] if len(sys.argv) > 3 else None
    node = Node()
    samples = []
    sent = 0
    for event in node:
        if event["type"] != "INPUT":
            continue
        if role == "source":
            # 512 bytes, like the relays of motorium.
            node.send_output("out", pyarrow.array([time.monotonic_ns()] * 64, type=pyarrow.uint64()))
            sent += 1
            if sent == count + WARM_UP:
                break
        elif role == "relay":
            node.send_output("out", event["value"])
        elif result is not None:
            samples.append(time.monotonic_ns() - event["value"][0].as_py())
    if result is not None:
        with open(result, "w", encoding="utf-8") as file:
            json.dump(samples[WARM_UP:], file)


main()
