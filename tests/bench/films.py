#!/usr/bin/env python3
"""Films: frames averaged along their surfaces beside the same frames alone, against references.

    films.py OPSR OUT [--spp N] [--frames N] [--every N] [--size WxH] [--references N] [--only FILM] [--method METHOD]

Frames that lie in OUT already are averaged again, so that a changed program can be compared. The last column of ratios is relMSE without
the worst 0.1 % of the pixels.

Writes the animated scenes, the frames and `films.json` below OUT and prints a table: for each film and method the mean over three
frames in its middle of MAPE, relMSE, FLIP and energy, and the flicker between them. With `--every N` the first two of every N frames
are measured in their place. OPSR is the program; its Python package, numpy and
OpenEXR must be installed. References are `vcm` with raw means.

Flicker is the mean squared relative change of the error from one frame to the next along the surfaces that stand still, without the
worst 0.1 % of the pixels.
"""
import argparse
import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR

import opsr

SCENES = Path(__file__).resolve().parents[2] / "training_scenes"


class Glb:
    """A binary glTF file to which animations are added."""

    def __init__(self, path):
        data = Path(path).read_bytes()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20 : 20 + length])
        start = 20 + length
        self.binary = bytearray(data[start + 8 : start + 8 + struct.unpack_from("<I", data, start)[0]])

    def numbers(self, values, kind, dtype=np.float32):
        """Adds an accessor and gives its number."""
        values = np.asarray(values, dtype).reshape(-1, {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[kind])
        self.binary += b"\0" * (-len(self.binary) % 4)
        views = self.json["bufferViews"]
        views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes})
        self.binary += values.tobytes()
        accessor = {"bufferView": len(views) - 1, "componentType": {4: 5126, 1: 5121, 2: 5123}[values.itemsize], "count": len(values), "type": kind}
        accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def positions(self, mesh):
        """Corners of the only primitive of a mesh."""
        accessor = self.json["accessors"][self.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"]]
        view = self.json["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return np.frombuffer(bytes(self.binary), np.float32, 3 * accessor["count"], start).reshape(-1, 3)

    def animate(self, node, path, times, values, kind):
        sampler = {"input": self.numbers(times, "SCALAR"), "output": self.numbers(values, kind)}
        channel = {"sampler": 0, "target": {"node": node, "path": path}}
        self.json.setdefault("animations", []).append({"samplers": [sampler], "channels": [channel]})

    def camera(self):
        """Number of the node of the camera, and its matrix; the node gets translation and rotation in its place."""
        nodes = self.json["nodes"]
        node = next(i for i, n in enumerate(nodes) if "camera" in n)
        return node, np.array(nodes[node].pop("matrix")).reshape(4, 4).T

    def write(self, path):
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.json["buffers"][0]["byteLength"] = len(self.binary)
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text
        body += struct.pack("<II", len(self.binary), 0x004E4942) + self.binary
        Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def quaternion(m):
    """Quaternion x, y, z, w of a rotation."""
    w = np.sqrt(max(0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    return np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 4 * w * w]) / (4 * w)


def turn(glb, times, degrees, distance):
    """The camera turns about a point ahead of it."""
    node, start = glb.camera()
    target = start[:3, 3] - distance * start[:3, 2]
    places, turns = [], []
    for k in range(len(times)):
        c, s = np.cos(np.radians(degrees * k)), np.sin(np.radians(degrees * k))
        about = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        places.append(about @ (start[:3, 3] - target) + target)
        turns.append(quaternion(about @ start[:3, :3]))
    glb.animate(node, "translation", times, places, "VEC3")
    glb.animate(node, "rotation", times, turns, "VEC4")


def travel(glb, times, step):
    node, start = glb.camera()
    glb.json["nodes"][node]["rotation"] = quaternion(start[:3, :3]).tolist()
    glb.animate(node, "translation", times, [start[:3, 3] + k * np.array(step) for k in range(len(times))], "VEC3")


def slide(glb, times, mesh, step):
    node = next(i for i, n in enumerate(glb.json["nodes"]) if n.get("mesh") == mesh)
    glb.animate(node, "translation", times, [k * np.array(step) for k in range(len(times))], "VEC3")


def waves(glb, times, mesh, height):
    """Water that moves: a morph target of waves."""
    node = next(i for i, n in enumerate(glb.json["nodes"]) if n.get("mesh") == mesh)
    x, _, z = glb.positions(mesh).T
    lift = height * (np.sin(9 * x + 4 * z) + np.sin(-5 * x + 11 * z))
    # The rim stays where it is.
    lift *= np.minimum(1, 8 * np.minimum.reduce([x - x.min(), x.max() - x, z - z.min(), z.max() - z]) / np.ptp(x))
    target = {"POSITION": glb.numbers(np.stack([0 * x, lift, 0 * x], 1), "VEC3")}
    glb.json["meshes"][mesh]["primitives"][0]["targets"] = [target]
    glb.animate(node, "weights", times, np.sin(0.3 * np.arange(len(times))), "SCALAR")


def bend(glb, times):
    """A figure of two joints bends, and the copper ring of the box follows its upper one."""
    x, z, sides = -0.42, 0.42, 32
    heights = np.linspace(0, 1.1, 45)
    # Feet, a waist, a chest and a head.
    radii = np.interp(heights, [0, 0.03, 0.4, 0.65, 0.8, 0.87, 0.97, 1.07, 1.1], [0.14, 0.14, 0.08, 0.13, 0.1, 0.05, 0.1, 0.07, 0.01])
    angles = 2 * np.pi * np.arange(sides) / sides
    slopes = np.gradient(radii, heights)
    ring = lambda r, y: np.stack([x + r * np.cos(angles), np.full(sides, y), z + r * np.sin(angles)], 1)
    points = np.concatenate([ring(r, y) for r, y in zip(radii, heights)])
    normals = np.concatenate([np.stack([np.cos(angles), np.full(sides, -s), np.sin(angles)], 1) / np.hypot(1, s) for s in slopes])
    k, s = np.mgrid[0 : len(heights) - 1, 0:sides]
    a, b = k * sides + s, k * sides + (s + 1) % sides
    faces = np.stack([a, a + sides, b, b, a + sides, b + sides], -1)
    upper = np.clip((points[:, 1] - 0.3) / 0.3, 0, 1)
    upper = upper * upper * (3 - 2 * upper)
    attributes = {"POSITION": glb.numbers(points, "VEC3"), "NORMAL": glb.numbers(normals, "VEC3")}
    attributes["JOINTS_0"] = glb.numbers(np.tile([0, 1, 0, 0], (len(points), 1)), "VEC4", np.uint8)
    attributes["WEIGHTS_0"] = glb.numbers(np.stack([1 - upper, upper, 0 * upper, 0 * upper], 1), "VEC4")
    nodes, roots, meshes = (glb.json[key] for key in ("nodes", "scenes", "meshes"))
    roots = roots[0]["nodes"]
    copper = next(i for i, n in enumerate(nodes) if n.get("mesh") == 7)
    white = meshes[0]["primitives"][0]["material"]
    meshes.append({"primitives": [{"attributes": attributes, "indices": glb.numbers(faces, "SCALAR", np.uint16), "material": white}]})
    joint = len(nodes)
    nodes += [{"translation": [x, 0, z], "children": [joint + 1]}, {"translation": [0, 0.45, 0], "children": [copper]}]
    nodes.append({"mesh": len(meshes) - 1, "skin": 0})
    nodes[copper]["translation"] = [-x, 0.1, -z]
    roots.remove(copper)
    roots += [joint, joint + 2]
    binds = [np.eye(4), np.eye(4)]
    for bind, y in zip(binds, (0, 0.45)):
        bind[3, :3] = -x, -y, -z
    glb.json["skins"] = [{"joints": [joint, joint + 1], "inverseBindMatrices": glb.numbers(binds, "MAT4")}]
    half = np.radians(12) * np.sin(0.2 * np.arange(len(times))) / 2
    glb.animate(joint + 1, "rotation", times, np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], 1), "VEC4")


FILMS = {
    "turning camera": ("figurines", lambda glb, times: turn(glb, times, 0.6, 3.0)),
    "travelling camera": ("swimming_pool", lambda glb, times: travel(glb, times, (-0.02, 0.0, -0.01))),
    "moving glass": ("cornell_caustics", lambda glb, times: slide(glb, times, 6, (-0.015, 0.0, 0.01))),
    "moving lamp": ("cornell_caustics", lambda glb, times: slide(glb, times, 5, (0.03, 0.0, 0.0))),
    "moving water": ("swimming_pool", lambda glb, times: waves(glb, times, 9, 0.004)),
}
# Films that nothing was tuned on.
FILMS |= {
    "disco, turning": ("disco", lambda glb, times: turn(glb, times, 0.5, 2.0)),
    "rings, one rises": ("rings", lambda glb, times: slide(glb, times, 8, (0.0, 0.012, 0.0))),
    "bulb, travelling": ("bulb_lamp", lambda glb, times: travel(glb, times, (0.015, 0.01, 0.0))),
}
FILMS |= {"skinned figure": ("cornell_caustics", bend)}
METHODS = {"no option": [], "levels": ["--opsr-table", "beta-0.001"]}


def run(*args):
    done = subprocess.run([str(a) for a in args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{args}: {done.stderr}")
    return done.stderr


def read(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: c.pixels for name, c in file.channels().items()}
    stack = lambda names: np.stack([channels[n] for n in names], -1).astype(np.float64)
    return stack("RGB"), stack(["position.X", "position.Y", "position.Z"]), channels


def flicker(errors, references, places):
    """Between two frames: errors, references, positions of both. Each pixel is compared with the nearest one that shows its place."""
    (e0, e1), (_, r1), (p0, p1) = errors, references, places
    h, w = e0.shape[:2]
    best, found = np.full((h, w), np.inf), np.zeros((h, w, 3))
    reach = 12
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            y, x = np.mgrid[0:h, 0:w]
            y, x = y + dy, x + dx
            inside = (y >= 0) & (y < h) & (x >= 0) & (x < w)
            y, x = y.clip(0, h - 1), x.clip(0, w - 1)
            distance = np.where(inside, np.linalg.norm(p0[y, x] - p1, axis=-1), np.inf)
            better = distance < best
            best, found = np.where(better, distance, best), np.where(better[..., None], e0[y, x], found)
    side = np.minimum(np.linalg.norm(np.diff(p1, axis=0, append=p1[-1:]), axis=-1), np.linalg.norm(np.diff(p1, axis=1, append=p1[:, -1:]), axis=-1))
    seen = best <= np.maximum(side, np.median(side))
    change = ((e1 - found) ** 2 / (r1**2 + 0.01 * r1.mean() ** 2)).mean(-1)[seen]
    return np.sort(change)[: int(0.999 * len(change))].mean()


def measure(numbers, pictures, references, places):
    rows = [opsr.compare(np.float32(a), np.float32(b)) for a, b in zip(pictures, references)]
    mean = {k: float(np.mean([r[k] for r in rows])) for k in ("MAPE", "relMSE", "relMSE trimmed", "FLIP", "energy ratio", "mean relative error")}
    worst = max(r["FLIP"] for r in rows)
    errors = [a - b for a, b in zip(pictures, references)]
    pairs = [i for i in range(len(pictures) - 1) if numbers[i + 1] == numbers[i] + 1]
    mean["flicker"] = float(np.mean([flicker(errors[i : i + 2], references[i : i + 2], places[i : i + 2]) for i in pairs]))
    return mean | {"FLIP of frames": [r["FLIP"] for r in rows], "worst FLIP": worst}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("opsr")
    parser.add_argument("out", type=Path)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--frames", type=int, default=11)
    parser.add_argument("--size", default="128x96")
    parser.add_argument("--references", type=int, default=300)
    parser.add_argument("--only", action="append", choices=list(FILMS))
    parser.add_argument("--method", action="append", choices=list(METHODS))
    parser.add_argument("--every", type=int)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    results = {}
    middle = [args.frames // 2 + k for k in (-1, 0, 1)]
    if args.every:
        middle = [k for k in range(args.frames) if k % args.every < 2]
    for film in args.only or FILMS:
        scene, move = FILMS[film]
        key = film.replace(", ", "_").replace(" ", "_")
        glb = Glb(SCENES / f"{scene}.glb")
        move(glb, np.arange(args.frames) / 24)
        path = args.out / f"{key}.glb"
        glb.write(path)
        size = ["--size", args.size, "--reproducible", "--progress", "none"]
        truth = []
        for k in middle:
            out = args.out / f"{key}_truth_{k}.exr"
            if not out.exists():
                how = ["--integrator", "vcm", "--resolve", "raw", "--spp", args.references, "--seed", 1000 + k]
                run(args.opsr, "render", path, *size, *how, "--at", f"{k}@24", "--aov", "position", "-o", out)
            truth.append(read(out))
        references, places = [t[0] for t in truth], [t[1] for t in truth]
        for method in args.method or METHODS:
            options = METHODS[method]
            folder = args.out / f"{key}_{method.replace(' ', '_')}_{args.spp}"
            folder.mkdir(exist_ok=True)
            if not (folder / "alone" / f"{args.frames - 1:06}.exr").exists():
                frames = ["--frames", f"0..{args.frames - 1}", "--spp", args.spp, "--aov", "position", "--checkpoint", folder / "alone"]
                run(args.opsr, "render", path, *size, *options, *frames, "-o", folder / "####.exr")
            # Frames of an earlier run are averaged by this program.
            run(args.opsr, "film", path, folder / "alone" / "######.exr", "-o", folder / "####.exr")
            alone = measure(middle, [read(folder / "alone" / f"{k:06}.exr")[0] for k in middle], references, places)
            averaged = measure(middle, [read(folder / f"{k:04}.exr")[0] for k in middle], references, places)
            window = np.mean([read(folder / f"{k:04}.exr")[2]["window"] for k in middle])
            stated = lambda file: float(json.loads(OpenEXR.File(str(file)).header()["opsr"])["mean_relative_error"])
            alone["stated"] = float(np.mean([stated(folder / "alone" / f"{k:06}.exr") for k in middle]))
            averaged["stated"] = float(np.mean([stated(folder / f"{k:04}.exr") for k in middle]))
            results[f"{film}, {method}"] = {"alone": alone, "averaged": averaged, "window": float(window)}
            worst = max(a / b for a, b in zip(averaged["FLIP of frames"], alone["FLIP of frames"]))
            print(f"{film}, {method}: window {window:.2f}, worst frame {worst:.3f}")
            for name, m in (("alone", alone), ("averaged", averaged)):
                print(f"  {name:9} MAPE {m['MAPE']:.3f}  relMSE {m['relMSE']:.4f}  FLIP {m['FLIP']:.4f}  flicker {m['flicker']:.4f}  energy {m['energy ratio']:.4f}  error {m['mean relative error']:.4f}, stated {m['stated']:.4f}")
            ratio = [averaged[k] / alone[k] for k in ("MAPE", "relMSE", "FLIP", "flicker", "energy ratio", "relMSE trimmed")]
            print("  ratio     " + "  ".join(f"{r:.3f}" for r in ratio), flush=True)
    (args.out / "films.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
