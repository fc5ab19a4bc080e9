#!/usr/bin/env python3
"""Cost of a sample by method, scene and size; memory; the first picture.

    python3 suites/cost.py [OPSR] [TURNS]

A cost is the CPU time of further samples, so that loading, building and writing do not count, over that of plain paths in the same
turn, all of them raw; medians of the turns. Memory is the peak of a picture of 1024x1024 pixels over that of 64x64, in bytes a pixel.
Nothing else should run beside it.
"""

import os
import statistics
import subprocess
import sys
import tempfile

SCENES = ["cornell_glossy", "swimming_pool", "figurines"]
RAW = ["--resolve", "raw"]
METHODS = {
    "path": ["--integrator", "path", *RAW],
    "one level": ["--opsr-table", "beta-0.001", *RAW],
    "bdpt": ["--integrator", "bdpt", *RAW],
    "vcm": ["--integrator", "vcm", *RAW],
}
# Pictures as a user sees them, beside raw ones.
SHOWN = {
    "path, raw": METHODS["path"],
    "path": ["--integrator", "path"],
    "levels": ["--opsr-table", "beta-0.001"],
    "vcm, raw": METHODS["vcm"],
    "no option": [],
}
# Samples beyond the first that are timed.
SIZES = {"128x128": 64, "256x256": 16, "512x512": 4, "1024x1024": 2}
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "target/release/opsr"
TURNS = int(sys.argv[2]) if len(sys.argv) > 2 else 3


def run(scene, *options):
    """CPU seconds and peak bytes of a render."""
    with tempfile.TemporaryDirectory() as folder:
        picture = os.path.join(folder, "a.exr")
        command = [PROGRAM, "render", f"training_scenes/{scene}.glb", "--progress", "none", "-o", picture, *options]
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        assert status == 0, command
        return usage.ru_utime + usage.ru_stime, 1024 * usage.ru_maxrss


def cost(scene, size, samples, options):
    times = [run(scene, "--size", size, "--spp", str(spp), *options)[0] for spp in (1 + samples, 1)]
    return (times[0] - times[1]) / samples


def row(name, values, form):
    print(f"| {name} | " + " | ".join(form.format(v) for v in values) + " |", flush=True)


def main():
    print("| scene, size | plain paths, ns a path | " + " | ".join(list(METHODS)[1:]) + " |")
    print("|---|" + "---|" * len(METHODS))
    for scene in SCENES:
        for size, samples in SIZES.items():
            turns = [[cost(scene, size, samples, options) for options in METHODS.values()] for _ in range(TURNS)]
            pixels = int(size.split("x")[0]) ** 2
            base = statistics.median(turn[0] for turn in turns) / pixels * 1e9
            ratios = [statistics.median(turn[k] / turn[0] for turn in turns) for k in range(1, len(METHODS))]
            row(f"`{scene}`, {size}", [f"{base:.0f}", *(f"{r:.2f}" for r in ratios)], "{}")
    print("\n| `swimming_pool` | " + " | ".join(SHOWN) + " |")
    print("|---|" + "---|" * len(SHOWN))
    peak = [[run("swimming_pool", "--size", size, "--spp", "4", *o)[1] for o in SHOWN.values()] for size in ("1024x1024", "64x64")]
    row("bytes a pixel", [(a - b) / (1024**2 - 64**2) for a, b in zip(*peak)], "{:.0f}")
    first = [run("swimming_pool", "--size", "1920x1080", "--spp", "1", *o)[0] for o in SHOWN.values()]
    row("one sample at 1920x1080, CPU-seconds", first, "{:.1f}")


if __name__ == "__main__":
    main()
