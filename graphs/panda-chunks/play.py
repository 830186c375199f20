"""A policy that returns chunks of actions late: it plays a recorded demonstration, there and back.

    pip install "iceoryx2==0.10.*"
    motorium schema python > motorium_types.py
    PYTHONPATH=. python3 graphs/panda-chunks/play.py [SECONDS]
"""

import json
import random
import sys
import time
from pathlib import Path

from motorium_types import ActionChunk, JointState, join, service

JOINTS = 7
PERIOD = 40_000_000  # ns, of the demonstration
ACTIONS = 25
CHUNK_EVERY = 0.4  # s
DELAY = (0.05, 0.3)  # s, of the inference

recording = Path(__file__).parent.parent / "imitate" / "demonstration.jsonl"
lines = [json.loads(line) for line in recording.read_text().splitlines()]
poses = [line["value"]["position"][:JOINTS] for line in lines]
poses += poses[::-1]

node = join("panda-chunks")
states = service(node, "out/panda/joint_state", JointState).subscriber_builder().create()
chunks = service(node, "in/panda/chunk", ActionChunk).publisher_builder().create()
end = time.monotonic() + float(sys.argv[1] if len(sys.argv) > 1 else 15.0)
rng = random.Random(1)
start, sequence = None, 0
while time.monotonic() < end:
    observed = None
    while sample := states.receive():
        observed = sample.user_header().contents.state_time
    if observed is None:
        time.sleep(0.005)
        continue
    start = start or observed
    first = (observed - start) // PERIOD
    # the action for the last period of the demonstration before the observation
    due = start + first * PERIOD
    indices = [(first + step) % len(poses) for step in range(ACTIONS)]
    values = [angle for index in indices for angle in poses[index]]
    delay = rng.uniform(*DELAY)
    time.sleep(delay)
    sequence += 1
    chunks.send_copy(
        ActionChunk(
            count=len(values), time=due, period=PERIOD, width=JOINTS, sequence=sequence, value=tuple(values)
        )
    )
    print(sequence, f"{delay * 1e3:.0f} ms", flush=True)
    time.sleep(max(CHUNK_EVERY - delay, 0.0))
