#!/usr/bin/env python3
"""Compressed glTF files beside the files that they were made of.

    compressed.py OPSR OUT TOOLS MODEL.glb ...

Writes variants of each model below OUT, renders them with raw means and prints a table: bytes, seconds to load (`opsr info`, the least of
three), mean absolute relative error over the model's own render, and FLIP. The first row of each model is
its own render with another seed: what is below that is noise. TOOLS is a folder in which `npm install @gltf-transform/cli gltfpack
ktx2-encoder` was run.
"""
import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

KTX = """
import { NodeIO } from "@gltf-transform/core";
import { ALL_EXTENSIONS } from "@gltf-transform/extensions";
import { ktx2 } from "ktx2-encoder/gltf-transform";
import sharp from "sharp";
const [, , source, target, uastc] = process.argv;
const imageDecoder = async (buffer) => {
  const { data, info } = await sharp(buffer).ensureAlpha().raw().toBuffer({ resolveWithObject: true });
  return { data: new Uint8Array(data), width: info.width, height: info.height };
};
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS);
const document = await io.read(source);
await document.transform(ktx2({ isUASTC: uastc === "uastc", generateMipmap: false, imageDecoder }));
await io.write(target, document);
"""


def run(*command, cwd=None):
    done = subprocess.run([str(c) for c in command], cwd=cwd, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: {done.stdout}{done.stderr}")
    return done.stdout


def variants(model, out, tools):
    """Writes the variants of a model; pairs of their names and paths."""
    tool = tools / "node_modules/.bin/gltf-transform"
    pack = tools / "node_modules/.bin/gltfpack"
    script = tools / "opsr_ktx.mjs"
    script.write_text(KTX)
    ways = {
        "draco": lambda to: run(tool, "draco", model, to),
        "draco, sequential": lambda to: run(tool, "draco", model, to, "--method", "sequential"),
        "meshopt": lambda to: run(tool, "meshopt", model, to),
        "gltfpack -cc": lambda to: run(pack, "-i", model, "-o", to, "-cc", "-kn", "-km"),
        "gltfpack -cz -ce khr": lambda to: run(pack, "-i", model, "-o", to, "-cz", "-ce", "khr", "-vpf", "-kn", "-km"),
        "ktx2, etc1s": lambda to: run("node", script, model, to, "etc1s", cwd=tools),
        "ktx2, uastc": lambda to: run("node", script, model, to, "uastc", cwd=tools),
    }
    textured = b'"images"' in model.read_bytes()
    for name, make in ways.items():
        if name.startswith("ktx2") and not textured:
            continue
        path = out / f"{model.stem}_{name.replace(', ', '_').replace(' ', '')}.glb"
        if not path.exists():
            make(path)
        yield name, path


def seconds(opsr, path):
    def once():
        start = time.perf_counter()
        run(opsr, "info", path)
        return time.perf_counter() - start

    return min(once() for _ in range(3))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("opsr", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("tools", type=Path)
    parser.add_argument("models", type=Path, nargs="+")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", default="192x144")
    args = parser.parse_args()
    out, tools, opsr = args.out.resolve(), args.tools.resolve(), args.opsr.resolve()
    out.mkdir(parents=True, exist_ok=True)

    def render(path, picture, seed):
        if not picture.exists():
            how = ["--integrator", "path", "--resolve", "raw", "--size", args.size, "--spp", args.spp]
            run(opsr, "render", path, *how, "--seed", seed, "-o", picture)

    def errors(picture, reference):
        numbers = out / "numbers.json"
        run(opsr, "compare", picture, reference, "--json", numbers)
        metrics = json.loads(numbers.read_text())["entries"][0]["metrics"]
        return {metric["name"]: metric["value"] for metric in metrics}

    print("| model | variant | bytes | load, s | MAPE | FLIP |\n|---|---|---|---|---|---|")
    for model in args.models:
        model = model.resolve()
        own, other = out / f"{model.stem}.exr", out / f"{model.stem}_other_seed.exr"
        render(model, own, 1)
        render(model, other, 2)
        rows = [("itself, another seed", model, other)]
        for name, path in variants(model, out, tools):
            picture = path.with_suffix(".exr")
            render(path, picture, 1)
            rows.append((name, path, picture))
        for name, path, picture in rows:
            found = errors(picture, own)
            size, load = path.stat().st_size, seconds(opsr, path)
            print(f"| {model.stem} | {name} | {size} | {load:.3f} | {found['MAPE']:.4f} | {found['FLIP']:.4f} |", flush=True)


if __name__ == "__main__":
    main()
