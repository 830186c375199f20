#!/usr/bin/env python3
"""Writes two greyscale images with every PNG filter, and their pixels: heights_8.png, heights_16.png and heights.json next to this script.

    python3 components/worlds/tests/worlds/golden/height_pictures.py
"""

import json
import pathlib
import struct
import zlib

HERE = pathlib.Path(__file__).resolve().parent
WIDTH, HEIGHT = 9, 11


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def paeth(a, b, c):
    p = a + b - c
    return min((a, b, c), key=lambda value: (abs(p - value), (a, b, c).index(value)))


def picture(pixels, depth):
    size = depth // 8
    above, rows = bytes(WIDTH * size), b""
    for number, line in enumerate(pixels):
        row = b"".join(pixel.to_bytes(size, "big") for pixel in line)
        filter = number % 5
        out = bytearray()
        for i, value in enumerate(row):
            a = row[i - size] if i >= size else 0
            b, c = above[i], above[i - size] if i >= size else 0
            guess = [0, a, b, (a + b) // 2, paeth(a, b, c)][filter]
            out.append((value - guess) % 256)
        rows += bytes([filter]) + bytes(out)
        above = row
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, depth, 0, 0, 0, 0)
    packed = zlib.compress(rows, 9)
    # the pixels in two chunks, and an optional chunk that readers may ignore
    data = chunk(b"tEXt", b"Comment\0heights") + chunk(b"IDAT", packed[:20]) + chunk(b"IDAT", packed[20:])
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + data + chunk(b"IEND", b"")


result = {}
for depth in (8, 16):
    most = 2**depth - 1
    pixels = [[(37 * column * column + 101 * row * (column + 3) + (most // 7) * row) % (most + 1) for column in range(WIDTH)] for row in range(HEIGHT)]
    (HERE / f"heights_{depth}.png").write_bytes(picture(pixels, depth))
    result[str(depth)] = pixels
(HERE / "heights.json").write_text(json.dumps(result) + "\n")
