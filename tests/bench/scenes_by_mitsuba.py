"""References of the scenes of tests/data/scenes by Mitsuba 3: means of tiles of 8 x 8 pixels, with standard errors.

    pip install mitsuba numpy
    python tests/bench/scenes_by_mitsuba.py [--spp 1024] [--rounds 16] [scene.xml ...]

Writes references.json beside the scenes, and with --pictures FOLDER a PNG of each. Needs LLVM; else --variant scalar_rgb.
`--maps` writes the images that the scenes use once more.
"""

import argparse
import json
import pathlib

import mitsuba as mi
import numpy as np

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "data" / "scenes"
TILE = 8


def maps():
    """Images of the scenes."""
    n = 64
    y, x = (np.mgrid[0:n, 0:n] + 0.5) / n
    heights = 0.5 + 0.25 * np.sin(2 * np.pi * x) * np.cos(4 * np.pi * y)
    png = lambda a, name: mi.Bitmap((255 * a + 0.5).astype(np.uint8)).write(str(FOLDER / name))
    png(np.repeat((0.1 + 0.25 * heights)[..., None], 3, 2), "waves.png")
    colours = np.stack([x, 1 - y, 0.5 + 0.5 * np.sin(9 * x)], -1)
    png(colours, "colours.png")
    slope = np.stack([0.3 * np.sin(2 * np.pi * x), 0.3 * np.cos(2 * np.pi * y), np.ones_like(x)], -1)
    png(0.5 + 0.5 * slope / np.linalg.norm(slope, axis=-1, keepdims=True), "normals.png")
    y, x = np.mgrid[0:16, 0:32]
    sky = np.stack([0.2 + 0.02 * x, 0.3 + 0.02 * y, 0.6 - 0.01 * x], -1).astype(np.float32)
    sky[3:5, 6:8] = [9, 8, 6]
    mi.Bitmap(sky).write(str(FOLDER / "sky.exr"))
    mi.Bitmap(octahedron(sky)).write(str(FOLDER / "sky_square.exr"))


def octahedron(sky, n=256):
    """A map of Mitsuba's as pbrt has it: equal areas on an octahedron (Clarberg 2008)."""
    y, x = (np.mgrid[0:n, 0:n] + 0.5) / n * 2 - 1
    u, v = np.abs(x), np.abs(y)
    d = 1 - (u + v)
    r = 1 - np.abs(d)
    phi = np.where(r == 0, 1, (v - u) / np.where(r == 0, 1, r) + 1) * np.pi / 4
    z = np.copysign(1 - r * r, d)
    flat = r * np.sqrt(np.maximum(0, 2 - r * r))
    w = np.stack([np.copysign(np.cos(phi), x) * flat, np.copysign(np.sin(phi), y) * flat, z], -1)
    # Looked up as Mitsuba does.
    h, k = sky.shape[:2]
    across = (np.arctan2(w[..., 0], -w[..., 2]) / (2 * np.pi)) % 1 * k - 0.5
    down = np.arccos(np.clip(w[..., 1], -1, 1)) / np.pi * (h - 1)
    i, j = np.floor(across).astype(int), np.minimum(np.floor(down).astype(int), h - 2)
    a, b = (across - i)[..., None], (down - j)[..., None]
    at = lambda i, j: sky[j, i % k]
    rows = [at(i, j + s) * (1 - a) + at(i + 1, j + s) * a for s in (0, 1)]
    return (rows[0] * (1 - b) + rows[1] * b).astype(np.float32)


def tiles(picture):
    h, w, _ = picture.shape
    return picture.reshape(h // TILE, TILE, w // TILE, TILE, 3).mean((1, 3)).reshape(-1, 3)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=pathlib.Path)
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=16)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--pictures", type=pathlib.Path)
    parser.add_argument("--maps", action="store_true")
    args = parser.parse_args()
    mi.set_variant(args.variant)
    if args.maps:
        maps()
    out = FOLDER / "references.json"
    found = json.loads(out.read_text()) if out.exists() else {}
    names = ["room", "glass", "lamps", "old", "mapped", "pool", "media", "water", "steps", "cloud"]
    for path in args.scenes or [FOLDER / f"{name}.xml" for name in names]:
        scene = mi.load_file(str(path))
        rounds, mean = [], 0
        for seed in range(args.rounds):
            picture = np.array(mi.render(scene, spp=args.spp, seed=seed))[..., :3].astype(np.float64)
            mean = mean + picture / args.rounds
            rounds.append(tiles(picture))
        rounds = np.array(rounds)
        error = rounds.std(0, ddof=1) / np.sqrt(args.rounds)
        clean = lambda a: [[float(f"{v:.6g}") for v in row] for row in a]
        found[path.stem] = {
            "size": [mean.shape[1], mean.shape[0]],
            "samples": args.spp * args.rounds,
            "tiles": clean(rounds.mean(0)),
            "errors": clean(error),
        }
        if args.pictures:
            args.pictures.mkdir(parents=True, exist_ok=True)
            mi.util.write_bitmap(str(args.pictures / f"{path.stem}.png"), mean.astype(np.float32), write_async=False)
        print(path.stem, mean.mean((0, 1)), "largest error", error.max())
    text = json.dumps(dict(sorted(found.items())))
    out.write_text(text.replace('}, "', '},\n"') + "\n")


if __name__ == "__main__":
    main()
