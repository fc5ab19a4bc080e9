#!/usr/bin/env python3
"""Two builds of the program on one scene at equal CPU time, without a reference: half of the difference of two seeds is the error.

    pip install numpy OpenEXR
    python3 tests/bench/two_programs.py usual/opsr changed/opsr scene.glb [options of a render, such as --size 512x512 --spp 6]

Prints the CPU time of the second over the first, and its errors over those of the first at equal CPU time: relMSE of the raw picture and
of the one that is shown, average error of both. Their epsilon is a hundredth of the squared mean radiance, and a thirtieth of the mean.
Light that neither seed meets is in no error. Not part of the automatic tests.
"""

import argparse
import pathlib
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


def measured(program, scene, options):
    """CPU seconds, then relMSE and average error of the raw picture and of the one that is shown."""
    found = []
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        for seed in SEEDS:
            out = pathlib.Path(folder) / f"{seed}.exr"
            words = [program, "render", scene, "--integrator", "vcm", *options, "--seed", str(seed), "--aov", "each-level"]
            subprocess.run([*words, "--progress", "none", "-o", out], check=True, stderr=subprocess.DEVNULL)
            found.append(pictures(out))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    errors = []
    for a, b in zip(*found):
        middle, difference = (a + b) / 2, a - b
        mean = middle.mean()
        errors.append((difference**2 / 2 / (middle**2 + 0.01 * mean**2)).mean())
        share = np.abs(difference).sum(-1) / (middle.sum(-1) + mean / 10)
        errors.append(np.minimum(1, share).mean() / 2**0.5)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, *errors


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs=2)
    parser.add_argument("scene")
    args, options = parser.parse_known_args()
    (time, *usual), (changed_time, *changed) = (measured(program, args.scene, options) for program in args.programs)
    ratio = changed_time / time
    print(f"CPU time {ratio:.2f}")
    for i, name in enumerate(["relMSE, raw", "average error, raw", "relMSE, shown", "average error, shown"]):
        # Squared errors fall as the time, others as its root.
        print(f"{name} {changed[i] / usual[i] * (ratio if i % 2 == 0 else ratio**0.5):.2f}")


if __name__ == "__main__":
    main()
