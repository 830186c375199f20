"""Values of random frames as cantools decodes them: python golden.py > golden.txt"""

import pathlib
import random

import cantools

random.seed(7)
here = pathlib.Path(__file__).parent
pages = {"Switched": [0, 1, 0x10, 0x21], "Ranged": [0, 3, 4, 5, 9, 200, 255]}
for name in ["odrive", "kinds"]:
    for message in cantools.database.load_file(here / f"{name}.dbc", strict=False).messages:
        for _ in range(12):
            data = bytearray(random.randrange(256) for _ in range(message.length))
            if message.name in pages:
                data[0] = random.choice(pages[message.name])
            values = message.decode(bytes(data), decode_choices=False)
            words = [f"{signal}={float(value)!r}" for signal, value in sorted(values.items())]
            form = "x" if message.is_extended_frame else "s"
            print(name, f"{form}{message.frame_id:x}", data.hex(), message.name, *words)
