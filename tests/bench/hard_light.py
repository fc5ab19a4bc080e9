#!/usr/bin/env python3
"""Error at equal CPU time in two rooms of hard light, of opsr and of every other renderer that is installed with what it has for
caustics: manifolds and guiding of Cycles, light paths and photons of LuxCore, Open Image Denoise.

    pip install numpy OpenEXR mitsuba bpy pyluxcore
    cargo build --release
    python3 tests/bench/hard_light.py target/release/opsr

A pool with waves on its water, and a statue of glass beside one of metal, under a lamp of 20 x 20 cm in a room of 2 m; smooth glass,
mirrors and matt walls, which all renderers have alike. BUDGET and TURNS are taken from the environment (20 s, 3). Samples of a
render are those that take BUDGET of CPU time, by the time of 16; a render of one sample counts as loading. ONLY names the rows to print, by parts of their names with commas between. OIDN_DIR must name Open Image
Denoise. The reference is of SAMPLES (4096) iterations of vcm. PICTURES names a folder for the last pictures. Not part of the automatic tests: it needs an hour.
"""

import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile

import numpy as np

import against_mitsuba as boxes
import peers
from against_mitsuba import ROOM, SIZE, WHITE, quad, sphere


def water(edge=1.05, bottom=-1.05, top=-0.55, cells=96):
    """A closed body with waves on top, which holds the floor and the feet of the walls: they are wet."""
    x, z = np.meshgrid(np.linspace(-edge, edge, cells + 1), np.linspace(-edge, edge, cells + 1), indexing="ij")
    # They fade towards the sides.
    fade = (1 - (x / edge) ** 8) * (1 - (z / edge) ** 8)
    waves = lambda x, z: 0.03 * np.sin(7 * x + 3 * z) + 0.02 * np.sin(11 * z - 5 * x + 1)
    height = top + fade * waves(x, z)
    slope = np.gradient(height, 2 * edge / cells)
    n = np.stack([-slope[0], np.ones_like(height), -slope[1]], -1).reshape(-1, 3)
    corners, normals = [np.stack([x, height, z], -1).reshape(-1, 3)], [n / np.linalg.norm(n, axis=1, keepdims=True)]
    at = lambda i, j: i * (cells + 1) + j
    index = []
    for i in range(cells):
        for j in range(cells):
            index += [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]]
    a, b, c, d = ([s * edge, bottom, t * edge] for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    up = lambda corner: [corner[0], top, corner[2]]
    for side in (quad(a, b, c, d), *(quad(q, p, up(p), up(q)) for p, q in ((a, b), (b, c), (c, d), (d, a)))):
        p, n, faces = side
        index += (faces + sum(map(len, corners))).tolist()
        corners.append(p)
        normals.append(n)
    return np.concatenate(corners).astype(np.float32), np.concatenate(normals).astype(np.float32), np.array(index, np.uint32)


def statue(centre, size, folds):
    """A closed body with folds, of a ball that is taller than wide."""
    p, _, index = sphere([0, 0, 0], 1.0)
    theta, phi = np.arccos(np.clip(p[:, 1], -1, 1)), np.arctan2(p[:, 2], p[:, 0])
    radius = 1 + 0.15 * np.sin(theta) ** 2 * np.cos(folds * phi) + 0.1 * np.cos(4 * theta)
    p = (p * radius[:, None] * [0.7, 1, 0.7]).astype(np.float64)
    # Normals of corners from those of the triangles around; the seam has its corners twice.
    faces = np.cross(p[index[:, 1]] - p[index[:, 0]], p[index[:, 2]] - p[index[:, 0]])
    keys = np.round(p, 6)
    _, one = np.unique(keys, axis=0, return_inverse=True)
    sums = np.zeros((one.max() + 1, 3))
    for k in range(3):
        np.add.at(sums, one.reshape(-1)[index[:, k]], faces)
    n = sums[one.reshape(-1)]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return (size * p + centre).astype(np.float32), n.astype(np.float32), index


LAMP = ("light", "light", quad([-0.1, 0.99, -0.1], [0.1, 0.99, -0.1], [0.1, 0.99, 0.1], [-0.1, 0.99, 0.1]))
WALLS = [part for part in ROOM if part[0] != "light"] + [LAMP]
ROOMS = {
    "pool": WALLS + [("water", ("glass", 0), water()), ("ball", WHITE, sphere([0.45, -0.2, -0.5], 0.2))],
    "statue": WALLS + [
        ("glass statue", ("glass", 0), statue([-0.4, -0.42, 0.25], 0.5, 5)),
        ("metal statue", ("metal", 0), statue([0.45, -0.42, -0.3], 0.5, 3)),
    ],
}
# Name: package, what renders.
PEERS = {
    "Mitsuba, 8 lanes": ("mitsuba", lambda *args: peers.mitsuba(*args, 8)),
    "Cycles": ("bpy", peers.cycles),
    "Cycles, Oidn": ("bpy", lambda *args: peers.cycles(*args, "denoise")),
    "Cycles, guiding": ("bpy", lambda *args: peers.cycles(*args, "guide")),
    "Cycles, shadow caustics": ("bpy", lambda *args: peers.cycles(*args, "caustics")),
    "Cycles, shadow caustics, Oidn": ("bpy", lambda *args: peers.cycles(*args, "caustics", "denoise")),
    "LuxCore PATHCPU": ("pyluxcore", lambda *args: peers.luxcore(*args, "PATHCPU")),
    "LuxCore hybrid": ("pyluxcore", lambda *args: peers.luxcore(*args, "PATHCPU", **peers.HYBRID)),
    "LuxCore PhotonGI": ("pyluxcore", lambda *args: peers.luxcore(*args, "PATHCPU", **peers.PHOTON_GI)),
    "LuxCore BIDIRCPU": ("pyluxcore", lambda *args: peers.luxcore(*args, "BIDIRCPU")),
}
OURS = {
    "opsr, no option": [],
    "opsr, no option, Oidn": ["--denoise"],
    "opsr, beta-0.001": ["--opsr-table", "beta-0.001"],
    "opsr, plain paths": ["--integrator", "path", "--resolve", "raw"],
    "opsr, plain paths, Oidn": ["--integrator", "path", "--resolve", "raw", "--denoise"],
    # The reference.
    "opsr, vcm": ["--integrator", "vcm", "--resolve", "raw"],
}


def write(path, picture):
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {name: np.ascontiguousarray(picture[..., c], np.float32) for c, name in enumerate("RGB")}
    OpenEXR.File(header, channels).write(path)


def compared(program, picture, reference):
    """Metrics of `opsr compare` by name."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [os.path.join(folder, name) for name in ("a.exr", "b.exr", "c.json")]
        # Without the last row, which LuxCore lacks.
        write(paths[0], picture[:-1])
        write(paths[1], reference[:-1])
        subprocess.run([program, "compare", paths[0], paths[1], "--json", paths[2]], check=True, capture_output=True)
        metrics = json.load(open(paths[2]))["entries"][0]["metrics"]
    return {metric["name"]: metric["value"] for metric in metrics}


def render(program, who, name, spp, seed):
    """CPU seconds of a render, and its picture."""
    return peers.run(program, who, name, spp, seed, OURS, ROOMS, __file__)


def main():
    if sys.argv[1:2] == ["--render"]:
        who, name, spp, seed, file = sys.argv[2:]
        with tempfile.TemporaryDirectory() as folder:
            np.save(file, PEERS[who][1](folder, ROOMS[name], int(spp), int(seed)))
        # Some packages crash when the interpreter takes them apart.
        os._exit(0)
    program = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "target/release/opsr")
    seconds, turns, samples = (int(os.environ.get(*key)) for key in (("BUDGET", 20), ("TURNS", 3), ("SAMPLES", 4096)))
    pictures = os.environ.get("PICTURES")
    print(peers.processor())
    there = [*OURS, *(who for who, (package, _) in PEERS.items() if importlib.util.find_spec(package))]
    only = os.environ.get("ONLY", "").split(",")
    there = [who for who in there if any(part in who for part in only)]
    for who, (package, _) in PEERS.items():
        if not importlib.util.find_spec(package):
            print(f"missing: {who} (pip install {package})")
    for name in ROOMS:
        reference = render(program, "opsr, vcm", name, samples, 1000)[1]
        print(f"{name}, {SIZE} x {SIZE}, {seconds} CPU-seconds, medians of {turns} turns: relMSE trimmed, MAPE, FLIP, energy")
        for who in there:
            try:
                start = render(program, who, name, 1, 0)[0]
                trial = max(render(program, who, name, 17, 0)[0] - start, 0.1)
                spp = max(round(16 * seconds / trial), 4)
                found, cost = [], []
                for turn in range(turns):
                    spent, picture = render(program, who, name, spp + 1, turn + 1)
                    found.append(compared(program, picture, reference))
                    cost.append(spent - start)
            except subprocess.CalledProcessError as error:
                print(f"  left out, it fails: {who}: {(error.stderr or '').strip().splitlines()[-1:]}", flush=True)
                continue
            if pictures:
                write(os.path.join(pictures, f"{name} {who}.exr"), picture)
            row = [statistics.median(of[key] for of in found) for key in ("relMSE trimmed", "MAPE", "FLIP", "energy ratio")]
            print(f"  {who}: {row[0]:.4f}, {row[1]:.3f}, {row[2]:.3f}, {row[3]:.3f}; {spp} samples, "
                  f"{statistics.median(cost):.1f} s", flush=True)


if __name__ == "__main__":
    main()
