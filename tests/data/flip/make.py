"""Expected FLIP values for tests/it/metric.rs, from the authors' own implementation.

    python3 -m venv venv && venv/bin/pip install flip-evaluator==1.7 numpy
    venv/bin/python make.py > expected.json

The pictures are made of integers by the formulas below, which the test repeats, so that none need be stored:
every value is a multiple of 1/256 and exact in single precision.
"""

import json

import flip_evaluator
import numpy as np

WIDTH, HEIGHT = 48, 40


def mix(x, y, c, seed):
    """A hash of a channel's place: 32 bits."""
    h = (x * 0x8DA6B343 ^ y * 0xD8163841 ^ c * 0xCB1AB31F ^ seed * 0x165667B1) & 0xFFFFFFFF
    h = (h ^ h >> 15) * 0x2C1B3C6D & 0xFFFFFFFF
    h = (h ^ h >> 12) * 0x297A2D39 & 0xFFFFFFFF
    return h ^ h >> 15


def ramp(x, y, c):
    return (x * 5 + y * 3 + c * 40) % 256


def board(x, y, c):
    return (230 if (x // 8 + y // 8) % 2 == 0 else 30) - 10 * c


def firefly(x, y, c):
    return 255 * (1 + c) if mix(x, y, 0, 3) % 61 == 0 else 0


# Name: (reference, test), each a function of (x, y, channel) in units of 1/256.
LDR = {
    "same": (ramp, ramp),
    "noise": (ramp, lambda x, y, c: min(max(ramp(x, y, c) + mix(x, y, c, 1) % 97 - 48, 0), 256)),
    "edges": (board, lambda x, y, c: board(x + 1, y, c)),
    "black": (lambda x, y, c: 0, lambda x, y, c: min(firefly(x, y, c), 256)),
    "hue": (lambda x, y, c: 256 * (c == 1), lambda x, y, c: 256 * (c == 2)),
}
HDR = {
    "noise": (
        lambda x, y, c: (1 + ramp(x, y, c)) << (x // 8) * 2,
        lambda x, y, c: ((1 + ramp(x, y, c)) * (mix(x, y, c, 2) % 256) >> 7) << (x // 8) * 2,
    ),
    "edges": (lambda x, y, c: board(x, y, c) ** 2, lambda x, y, c: board(x, y + 1, c) ** 2 + 40 * x),
    "spot": (
        lambda x, y, c: 4096 if x < 4 and y < 4 else 0,
        lambda x, y, c: (3584 if x < 4 and y < 4 else 0) + firefly(x, y, c),
    ),
}


def picture(f):
    values = [[[f(x, y, c) for c in range(3)] for x in range(WIDTH)] for y in range(HEIGHT)]
    return (np.array(values, dtype=np.float64) / 256).astype(np.float32)


def expected(kind, reference, test):
    settings = {"ppd": 67.0}
    error, mean, used = flip_evaluator.evaluate(
        picture(reference), picture(test), kind, inputsRGB=True, applyMagma=False, parameters=settings
    )
    out = {"mean": float(mean)}
    if kind == "HDR":
        out |= {k: float(used[k]) for k in ("startExposure", "stopExposure", "numExposures")}
    # Every seventh pixel of every fifth row: enough to place the map, few enough to read.
    out["map"] = [round(float(v), 7) for v in np.asarray(error)[::5, ::7].reshape(-1)]
    return out


def main():
    out = {"ldr": {n: expected("LDR", *p) for n, p in LDR.items()}}
    out["hdr"] = {n: expected("HDR", *p) for n, p in HDR.items()}
    print(json.dumps(out, indent=1))


main()
