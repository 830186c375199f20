"""Drives a robot by the keys w, s (ahead, back), a, d (left, right) and r, f (up, down): drive.py rover|panda|quadruped."""
import os, select, socket, struct, sys, time, tty

KEYS = {b"w": (1, 0, 0), b"s": (-1, 0, 0), b"a": (0, 1, 0), b"d": (0, -1, 0), b"r": (0, 0, 1), b"f": (0, 0, -1)}
robot, key, pressed = sys.argv[1], b"", 0.0
hand = [0.3, 0.0, 0.5]  # position of the Panda's hand, m
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
if os.isatty(0):
    tty.setcbreak(0)
while not time.sleep(0.02):
    while select.select([0], [], [], 0)[0]:
        key, pressed = os.read(0, 1) or sys.exit(), time.monotonic()
    if key not in KEYS or time.monotonic() - pressed > 0.4:
        continue  # released: the robot stops when the datagrams do
    ahead, left, up = KEYS[key]
    if robot == "panda":  # 0.1 m/s, pointing down
        hand = [x + 0.002 * step for x, step in zip(hand, (ahead, left, up))]
        data = struct.pack("<13d2Q", *hand, 1, 0, 0, 0, *[0] * 6, 0, 0)
    else:  # 0.3 m/s and 0.6 rad/s
        data = struct.pack("<6d", 0.3 * ahead, 0, 0, 0, 0, 0.6 * left)
    sock.sendto(data, ("127.0.0.1", 7400))
