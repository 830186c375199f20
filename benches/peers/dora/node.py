"""A node of the caterpillar: `node.py source|relay|sink [RESULT]`. The last sink writes its samples (ns) to RESULT."""

import json
import sys
import time

import pyarrow
from dora import Node

COUNT = 1_000
WARM_UP = 100


def main():
    role = sys.argv[1]
    result = sys.argv[2] if len(sys.argv) > 2 else None
    node = Node()
    samples = []
    sent = 0
    for event in node:
        if event["type"] != "INPUT":
            continue
        if role == "source":
            # 512 bytes, as the relays of motorium.
            node.send_output("out", pyarrow.array([time.monotonic_ns()] * 64, type=pyarrow.uint64()))
            sent += 1
            if sent == COUNT + WARM_UP:
                break
        elif role == "relay":
            node.send_output("out", event["value"])
        elif result is not None:
            samples.append(time.monotonic_ns() - event["value"][0].as_py())
    if result is not None:
        with open(result, "w", encoding="utf-8") as file:
            json.dump(samples[WARM_UP:], file)


main()
