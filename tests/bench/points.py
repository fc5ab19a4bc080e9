#!/usr/bin/env python3
"""Sobol points beside independent ones, for estimators with light paths.

    python3 suites/unseen.py scenes unseen
    python3 tests/bench/points.py OPSR unseen [INTEGRATORS] [SAMPLES] [SEEDS] [SCENES]

Renders ten scenes of 96x72 pixels by each integrator with both kinds of points, raw and as they are shown, and prints the errors with
Sobol points over those with independent ones. References are raw vcm with 800 independent samples and are kept in the folder. Lists are
separated by commas; the default is vcm,bdpt with 16,64 samples and two seeds.
"""

import json
import math
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
TRAINING = os.path.join(HERE, "..", "..", "training_scenes")
SCENES = {
    **{n: f"{TRAINING}/{n}.glb" for n in "figurines swimming_pool cornell_glossy bulb_lamp rings basins".split()},
    **{n: f"{n}.pbrt" for n in "chandelier coffee_maker desk_lamp hall".split()},
}
METRICS = ["relMSE trimmed", "mean relative error", "FLIP"]


def render(opsr, file, out, *options):
    command = [opsr, "render", file, "--size", "96x72", "-o", out, *map(str, options)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def errors(opsr, picture, reference):
    numbers = picture + ".json"
    command = [opsr, "compare", picture, reference, "--json", numbers]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    with open(numbers) as file:
        found = {m["name"]: m["value"] for m in json.load(file)["entries"][0]["metrics"]}
    return [found[name] for name in METRICS]


def main(opsr, folder, integrators="vcm,bdpt", samples="16,64", seeds="2", scenes=",".join(SCENES)):
    print("integrator samples scene: raw", *METRICS, "| shown", *METRICS)
    for integrator in integrators.split(","):
        for spp in samples.split(","):
            rows = []
            for name in scenes.split(","):
                file = os.path.join(folder, SCENES[name])
                reference = f"{folder}/{name}-96.exr"
                if not os.path.exists(reference):
                    render(opsr, file, reference, "--integrator", "vcm", "--spp", 800, "--seed", 777,
                           "--resolve", "raw", "--set", "sampler=independent")
                row = []
                for how in (["--resolve", "raw"], []):
                    sums = {}
                    for kind in ("independent", "sobol"):
                        each = []
                        for seed in range(1, int(seeds) + 1):
                            out = f"{folder}/points.exr"
                            render(opsr, file, out, "--integrator", integrator, "--spp", spp, "--seed", seed,
                                   "--set", f"sampler={kind}", *how)
                            each.append(errors(opsr, out, reference))
                        sums[kind] = [sum(column) for column in zip(*each)]
                    row += [s / i for s, i in zip(sums["sobol"], sums["independent"])]
                rows.append(row)
                print(integrator, spp, name, *(f"{x:.3f}" for x in row), flush=True)
            means = [math.exp(sum(map(math.log, column)) / len(column)) for column in zip(*rows)]
            print(integrator, spp, "MEAN", *(f"{x:.3f}" for x in means), flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
