#!/usr/bin/env python3
"""Two builds of the program on one scene at equal CPU time, without a reference: half of the difference of two seeds is the error.

    pip install numpy OpenEXR
    python3 tests/bench/two_programs.py usual/opsr changed/opsr scene.glb [options of a render, such as --size 512x512 --spp 6]
    python3 tests/bench/two_programs.py usual/opsr changed/opsr scene.glb --reference r.exr [options of a render]

Prints the CPU time of the second over the first, and its errors over those of the first at equal CPU time: relMSE of the raw picture and
of the one that is shown, average error of both. Their epsilon is a hundredth of the squared mean radiance, and a thirtieth of the mean.
Light that neither seed meets is in no error. With a reference, the errors of the pictures that are shown by `opsr compare`, over those of the
first at equal numbers of samples. Not part of the automatic tests.
"""

import argparse
import pathlib
import re
import resource
import subprocess
import tempfile

import numpy as np
import OpenEXR

SEEDS = (1, 2)


def pictures(path):
    """The raw picture and the one that is shown, height x width x 3."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return [np.stack([channels[name + c].pixels for c in "RGB"], -1).astype(np.float64) for name in ("level0.", "")]


#: Rows of `opsr compare`.
MEASURES = ("FLIP", "mean relative error", "MAPE", "relMSE trimmed", "energy ratio")


def used():
    """CPU seconds of all processes that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def compared(program, reference, picture):
    """Errors of a picture by `opsr compare`."""
    table = subprocess.run([program, "compare", reference, picture], check=True, capture_output=True, text=True).stdout
    return [float(re.search(rf"^{name} +(\S+)", table, re.MULTILINE)[1]) for name in MEASURES]


def measured(program, scene, options, reference):
    """CPU seconds, errors by a reference, then relMSE and average error of the raw picture and of the one that is shown."""
    found, by_reference = [], []
    seconds = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for seed in SEEDS:
            out = pathlib.Path(folder) / f"{seed}.exr"
            words = [program, "render", scene, "--integrator", "vcm", *options, "--seed", str(seed), "--aov", "each-level"]
            seconds -= used()
            subprocess.run([*words, "--progress", "none", "-o", out], check=True, stderr=subprocess.DEVNULL)
            seconds += used()
            found.append(pictures(out))
            if reference:
                by_reference.append(compared(program, reference, out))
    errors = []
    for a, b in zip(*found):
        middle, difference = (a + b) / 2, a - b
        mean = middle.mean()
        errors.append((difference**2 / 2 / (middle**2 + 0.01 * mean**2)).mean())
        share = np.abs(difference).sum(-1) / (middle.sum(-1) + mean / 10)
        errors.append(np.minimum(1, share).mean() / 2**0.5)
    return seconds, np.mean(by_reference, 0) if reference else None, *errors


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs=2)
    parser.add_argument("scene")
    parser.add_argument("--reference")
    args, options = parser.parse_known_args()
    runs = [measured(program, args.scene, options, args.reference) for program in args.programs]
    (time, known, *usual), (changed_time, changed_known, *changed) = runs
    ratio = changed_time / time
    print(f"CPU time {ratio:.2f}")
    if args.reference:
        print(", ".join(f"{name} {ratio:.3f}" for name, ratio in zip(MEASURES, changed_known / known)))
    for i, name in enumerate(["relMSE, raw", "average error, raw", "relMSE, shown", "average error, shown"]):
        # Squared errors fall as the time, others as its root.
        print(f"{name} {changed[i] / usual[i] * (ratio if i % 2 == 0 else ratio**0.5):.2f}")


if __name__ == "__main__":
    main()
