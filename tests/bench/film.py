#!/usr/bin/env python3
"""Flicker of a film of 24 frames, in which a ball of glass moves through a caustic box: plain path tracing, a table at one level,
levels, and levels with the denoiser, with one seed for all frames and with one each.

    pip install numpy OpenEXR pyoidn
    cargo build --release
    python3 tests/bench/film.py target/release/opsr [--size 40] [--spp 64] [--seeds 2] [--frames FOLDER]

The error of a frame is its picture less a reference, 96 iterations of vcm. *Flicker* is the variance over the frames of the error of a
pixel, *surplus* the variance of the picture less that of the reference (below 0 where motion is blurred), *still* the squared
mean error over the frames, less what flicker adds to it. All over the squared reference plus 0.01, mean over channels and pixels
but the worst 0.1 %. The reference's noise is in them. `--frames` keeps the pictures as PNG. Not part of the automatic tests.
"""

import argparse
import json
import pathlib
import struct
import subprocess
import tempfile

import numpy as np
import OpenEXR

FRAMES = 24
SEED = 1000
TABLE = ["--opsr-table", "beta-0.001"]
METHODS = {
    "plain": ["--resolve", "raw"],
    "table, one level": [*TABLE, "--resolve", "raw"],
    "levels": TABLE,
    "levels, denoised": [*TABLE, "--denoise"],
}


def animated(path, name, seconds, start, end):
    """Moves the mesh whose material has this name, from one place to another."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    gltf = json.loads(data[20 : 20 + length])
    body = bytearray(data[28 + length :])
    keys = struct.pack("<8f", 0, seconds, *start, *end)
    offset = len(body)
    body += keys
    gltf["buffers"][0]["byteLength"] = len(body)
    views, accessors = gltf["bufferViews"], gltf["accessors"]
    views += [{"buffer": 0, "byteOffset": offset, "byteLength": 8}, {"buffer": 0, "byteOffset": offset + 8, "byteLength": 24}]
    accessors += [
        {"bufferView": len(views) - 2, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [seconds]},
        {"bufferView": len(views) - 1, "componentType": 5126, "count": 2, "type": "VEC3"},
    ]
    material = [m.get("name") for m in gltf["materials"]].index(name)
    of = lambda node: "mesh" in node and gltf["meshes"][node["mesh"]]["primitives"][0]["material"] == material
    node = [of(n) for n in gltf["nodes"]].index(True)
    sampler = {"input": len(accessors) - 2, "output": len(accessors) - 1}
    channel = {"sampler": 0, "target": {"node": node, "path": "translation"}}
    gltf["animations"] = [{"samplers": [sampler], "channels": [channel]}]
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def read(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.stack([file.channels()[c].pixels.astype(float) for c in "RGB"], -1)


def mean(values):
    """Over channels and pixels but the worst 0.1 %."""
    values = np.sort(values.mean(-1).ravel())
    return values[: len(values) - round(0.001 * len(values))].mean()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--size", type=int, default=40)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--frames", type=pathlib.Path)
    args = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp())
    kept = args.frames or folder
    kept.mkdir(parents=True, exist_ok=True)
    subprocess.run([args.program, "scenes", "write", "caustic-box", "--out", folder], check=True, stdout=subprocess.DEVNULL)
    scene = folder / "caustic-box.glb"
    animated(scene, "glass", 1.0, (-0.15, 0, 0), (0.15, 0, 0))

    def film(name, seeds, *options):
        pictures = []
        for frame, seed in enumerate(seeds):
            path = kept / f"{name} {frame:02}.exr"
            common = ["--size", f"{args.size}x{args.size}", "--max-vertices", "12", "--at", f"{frame}@24", "--seed", str(seed)]
            outputs = ["--progress", "none", "-o", path, "-o", path.with_suffix(".png")]
            subprocess.run([args.program, "render", scene, *common, *options, *outputs], check=True, stderr=subprocess.DEVNULL)
            pictures.append(read(path))
        return np.array(pictures)

    reference = film("reference", range(FRAMES), "--integrator", "vcm", "--spp", "96")
    scale = (reference**2).mean(0) + 0.01
    print(f"{'':18} {'seeds':9} {'flicker':>16} {'surplus':>16} {'still':>16}")
    for method, options in METHODS.items():
        for seeds in ("one", "one each"):
            rows = []
            for k in range(args.seeds):
                first = SEED * (k + 1)
                numbers = [first] * FRAMES if seeds == "one" else range(first, first + FRAMES)
                pictures = film(f"{method}, {seeds}, {k}", numbers, "--spp", str(args.spp), *options)
                error = pictures - reference
                noise = error.var(0, ddof=1)
                surplus = pictures.var(0, ddof=1) - reference.var(0, ddof=1)
                # With one seed for all frames their errors are not independent, and nothing can be taken off.
                still = error.mean(0) ** 2 - (noise / FRAMES if seeds == "one each" else 0)
                rows.append([mean(x / scale) for x in (noise, surplus, still)])
            columns = [f"{x:.4f} ± {d:.4f}" for x, d in zip(np.mean(rows, 0), np.std(rows, 0))]
            print(f"{method:18} {seeds:9} " + " ".join(f"{c:>16}" for c in columns), flush=True)


if __name__ == "__main__":
    main()
