#!/usr/bin/env python3
"""The choice of two programs on the same films, beside references: what a change of `src/resolve` does to pictures.

    python3 suites/unseen.py scenes unseen && python3 suites/unseen.py references unseen
    python3 tests/bench/choice.py unseen 256x192 16,64 OLD NEW ["OPTIONS OF RENDER"]

OLD renders a film of each scene of the folder, .pbrt, .xml, .glb and .gltf, that has a reference NAME-WIDTH.exr, and both programs resolve it. A line
for each film: FLIP, mean relative error and relMSE without the worst 0.1 %, new over old; pepper, old and new; the energy of the new
picture over that of the reference. Pepper is the share of the pixels more than 3 % off the median of the 5x5 around them, of those where the
median of the reference differs by less than 15 % within 7x7. Needs numpy and OpenEXR.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "suites"))
import error_map


def around(plane, radius):
    padded = np.pad(plane, radius, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, (2 * radius + 1,) * 2)


def median(plane):
    return np.median(around(plane, 2), (2, 3))


def pepper(picture, reference):
    grey = picture.mean(-1)
    near = median(grey)
    smooth = median(median(reference.mean(-1)))
    shades = around(smooth, 3)
    even = np.ptp(shades, (2, 3)) < 0.15 * smooth
    return np.mean((np.abs(grey - near) > 0.03 * near)[even])


def main(folder, size, counts, old, new, options=""):
    error_map.PROGRAM = new
    for samples in counts.split(","):
        rows = []
        for scene in sorted(path for path in Path(folder).iterdir() if path.suffix in (".pbrt", ".xml", ".glb", ".gltf")):
            reference = scene.with_name(f"{scene.stem}-{size.split('x')[0]}.exr")
            if not reference.exists():
                continue
            with tempfile.TemporaryDirectory() as place:
                film, pictures = Path(place) / "film.ckpt", [Path(place) / f"{name}.exr" for name in ("old", "new")]
                command = [old, "render", scene, "--size", size, "--spp", samples, "--seed", "3", "--max-vertices", "14"]
                command += [*options.split(), "--checkpoint", film, "-o", pictures[0]]
                subprocess.run(command, check=True, capture_output=True)
                for program, picture in zip((old, new), pictures):
                    subprocess.run([program, "resolve", film, "-o", picture], check=True, capture_output=True)
                metrics = [error_map.measured(picture, reference) for picture in pictures]
                images, (truth, _) = [error_map.read(picture)[0] for picture in pictures], error_map.read(reference)
            names = [next(n for n in metrics[0] if n.startswith(start)) for start in ("FLIP", "mean relative", "relMSE trimmed")]
            ratios = [metrics[1][n] / metrics[0][n] for n in names]
            rows.append([*ratios, *(100 * pepper(image, truth) for image in images), metrics[1]["energy ratio"]])
            print(f"{scene.stem}, {samples}:", line(rows[-1]), flush=True)
        rows = np.array(rows)
        mean = [*np.exp(np.log(rows[:, :3]).mean(0)), *rows[:, 3:5].mean(0), rows[:, 5].mean()]
        print(f"{len(rows)} scenes, {samples}: {line(mean)}; FLIP {rows[:, 0].min():.3f} to {rows[:, 0].max():.3f}")


def line(row):
    flip, error, square, before, after, energy = row
    return f"FLIP {flip:.3f}, error {error:.3f}, relMSE {square:.3f}, pepper {before:.2f} to {after:.2f} %, energy {energy:.3f}"


if __name__ == "__main__":
    main(*sys.argv[1:]) if len(sys.argv) in (6, 7) else sys.exit(__doc__)
