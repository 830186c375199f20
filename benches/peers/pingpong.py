"""One side of a round trip over a peer: `pingpong.py PEER BYTES ROUNDS SECONDS ping|pong`. Ping prints half round trips,
ns: so many, or as many as there are in these seconds.
"""

import json
import sys
import threading
import time

WARM_UP = 200


class Lcm:
    def __init__(self, send, receive, heard):
        import lcm

        self.lcm = lcm.LCM("udpm://239.255.76.67:7667?ttl=0")
        self.send_on = send
        self.lcm.subscribe(receive, lambda _, data: heard(data))
        threading.Thread(target=self.handle, daemon=True).start()

    def handle(self):
        while True:
            self.lcm.handle()

    def send(self, data):
        self.lcm.publish(self.send_on, data)


class Zenoh:
    def __init__(self, send, receive, heard):
        import zenoh

        self.session = zenoh.open(zenoh.Config())
        self.publisher = self.session.declare_publisher(send)
        self.subscriber = self.session.declare_subscriber(receive, lambda sample: heard(bytes(sample.payload)))

    def send(self, data):
        self.publisher.put(data)


class ZenohShared(Zenoh):
    """Payloads in buffers of shared memory; the other side reads them in place."""

    def __init__(self, send, receive, heard):
        from zenoh.shm import BlockOn, GarbageCollect, ShmProvider

        self.provider = ShmProvider.default_backend(1 << 20)
        self.policy = BlockOn(GarbageCollect())
        super().__init__(send, receive, heard)

    def send(self, data):
        buffer = self.provider.alloc(len(data), policy=self.policy)
        buffer[:] = data
        self.publisher.put(buffer)


class CycloneDds:
    def __init__(self, send, receive, heard):
        from dataclasses import dataclass

        from cyclonedds.core import Listener
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.idl import IdlStruct
        from cyclonedds.idl.types import sequence, uint8
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        @dataclass
        class Payload(IdlStruct, typename="Payload"):
            data: sequence[uint8]

        class Heard(Listener):
            def on_data_available(self, reader):
                for sample in reader.take(N=8):
                    heard(bytes(sample.data))

        self.type = Payload
        self.participant = DomainParticipant(0)
        self.writer = DataWriter(self.participant, Topic(self.participant, send, Payload))
        self.reader = DataReader(self.participant, Topic(self.participant, receive, Payload), listener=Heard())

    def send(self, data):
        self.writer.write(self.type(data=list(data)))


PEERS = {"lcm": Lcm, "zenoh": Zenoh, "zenoh.shm": ZenohShared, "cyclonedds": CycloneDds}


def pong(peer):
    link = None

    def answer(data):
        # The first message may arrive before the return path exists; ping repeats it until it receives an
        # answer.
        if link is not None:
            link.send(data)

    link = peer("motorium_bench_back", "motorium_bench_there", answer)
    while True:
        time.sleep(1)


def ping(peer, size, rounds, seconds):
    back = threading.Event()
    link = peer("motorium_bench_there", "motorium_bench_back", lambda _: back.set())
    data = bytes(size)
    # Until the other side is discovered.
    for _ in range(200):
        link.send(data)
        if back.wait(0.1):
            break
    else:
        sys.exit("the other side was not found")
    time.sleep(0.5)
    samples = []
    end = time.monotonic() + seconds
    for i in range(WARM_UP + rounds):
        back.clear()
        start = time.perf_counter_ns()
        link.send(data)
        if not back.wait(2):
            sys.exit(f"no answer to message {i}")
        if i >= WARM_UP:
            samples.append((time.perf_counter_ns() - start) // 2)
        if time.monotonic() > end:
            break
    print(json.dumps(samples))


if __name__ == "__main__":
    name, size, rounds, seconds, side = sys.argv[1:]
    pong(PEERS[name]) if side == "pong" else ping(PEERS[name], int(size), int(rounds), float(seconds))
