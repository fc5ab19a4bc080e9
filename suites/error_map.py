#!/usr/bin/env python3
"""What renders state of their error, beside the truth: the number, and the map of the layer `error`.

    python3 suites/unseen.py scenes unseen && python3 suites/unseen.py references unseen
    OPSR=target/release/opsr python3 suites/error_map.py unseen 64x48 8,32,128 [METHOD,...]
    OPSR=target/release/opsr python3 suites/error_map.py scenes 48x36 8,16,64,256

A scene without a reference gets one, raw vcm with 2,048 samples. A line for each method and number of samples, over the scenes of the
folder, .pbrt and .glb: the geometric mean of FLIP; stated over true error, least, median, most, and how many are within 0.67 to 1.5;
Spearman's rank correlation of the map with the true error of pixels and of tiles of 8 pixels; the share of the tiles whose map is within
0.67 to 1.5 of their true error; the mean of the map over the number, least and most; the scenes that lack light by a witness, its least
share, and in brackets the true one. What the reference errs is taken from the true error of a picture, as variances are; pictures that err
less than twice as much are left out of `stated`. Needs numpy and OpenEXR.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR

PROGRAM = os.environ.get("OPSR", "target/release/opsr")
SEED = os.environ.get("SEED", "9")
METHODS = {
    "no option": [],
    "vcm": ["--integrator", "vcm"],
    "path": ["--integrator", "path"],
    "levels": ["--integrator", "path", "--opsr-table", "beta-0.001"],
    "raw path": ["--integrator", "path", "--resolve", "raw"],
    "raw vcm": ["--integrator", "vcm", "--resolve", "raw"],
}
TILE = 8


def read(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: np.array(channel.pixels, float) for name, channel in file.channels().items()}
    return np.stack([channels[c] for c in "RGB"], -1), channels.get("error")


def tiles(plane):
    height, width = (n - n % TILE for n in plane.shape)
    return plane[:height, :width].reshape(height // TILE, TILE, width // TILE, TILE).mean((1, 3))


def rank_correlation(a, b):
    ranks = [np.argsort(np.argsort(x.ravel(), kind="stable")) for x in (a, b)]
    return np.corrcoef(*ranks)[0, 1]


def measured(picture, reference):
    report = str(picture) + ".compare.json"
    subprocess.run([PROGRAM, "compare", picture, reference, "--json", report], check=True, capture_output=True)
    return {m["name"]: m["value"] for m in json.loads(Path(report).read_text())["entries"][0]["metrics"]}


def render(scene, picture, size, samples, seed, options):
    stats = Path(f"{picture}.json")
    command = [PROGRAM, "render", scene, "--size", size, "--spp", samples, "--seed", seed, "--max-vertices", "14", "--progress", "none"]
    subprocess.run([*command, *options, "--stats", stats, "-o", picture], check=True, capture_output=True)
    return json.loads(stats.read_text())


def main(folder, size, counts, methods=",".join(METHODS)):
    scenes = sorted(path for path in Path(folder).iterdir() if path.suffix in (".pbrt", ".glb"))
    for name in methods.split(","):
        for samples in counts.split(","):
            flips, stated, ranks, within, means, missing = [], [], [], [], [], []
            for scene in scenes:
                reference = scene.with_name(f"{scene.stem}-{size.split('x')[0]}.exr")
                if not reference.exists():
                    render(scene, reference, size, "2048", "77", METHODS["raw vcm"])
                with tempfile.TemporaryDirectory() as place:
                    picture = Path(place) / "a.exr"
                    stats = render(scene, picture, size, samples, SEED, METHODS[name])
                    metrics = measured(picture, reference)
                    said, lacks = stats["mean_relative_error"], stats["light_missing"]
                    if lacks:
                        missing.append(f"{scene.stem} {lacks['share']:.2f} ({1 - metrics['energy ratio']:.2f})")
                    flips.append(metrics["FLIP"])
                    (image, error), (truth, _) = read(picture), read(reference)
                own = json.loads(Path(f"{reference}.json").read_text())["mean_relative_error"]
                true = metrics["mean relative error"]
                if said is None or error is None:
                    continue
                if own < 0.5 * true:
                    stated.append(said / np.sqrt(true**2 - own**2))
                actual = np.minimum(1, abs(image - truth).sum(-1) / (truth.sum(-1) + truth.mean() / 10))
                ranks.append((rank_correlation(actual, error), rank_correlation(tiles(actual), tiles(error))))
                ratio = tiles(error) / np.maximum(tiles(actual), 1e-9)
                means.append(error.mean() / said)
                within.append(np.mean((ratio > 1 / 1.5) & (ratio < 1.5)))
            line = f"{name}, {samples} samples: FLIP {np.exp(np.mean(np.log(flips))):.4f}"
            if stated:
                inside = sum(1 / 1.5 < x < 1.5 for x in stated)
                pixels, of_tiles = np.mean(ranks, 0)
                line += f"; stated over true {min(stated):.2f}, {np.median(stated):.2f}, {max(stated):.2f}, {inside} of {len(stated)} within"
                line += f"; rank of pixels {pixels:.2f}, of tiles {of_tiles:.2f}; tiles within {np.mean(within):.2f}"
                line += f"; map over number {min(means):.3f} to {max(means):.3f}"
            if missing:
                line += f"; light missing: {', '.join(missing)}"
            print(line, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:]) if len(sys.argv) in (4, 5) else sys.exit(__doc__)
