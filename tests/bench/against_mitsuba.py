#!/usr/bin/env python3
"""Four boxes in opsr and in Mitsuba 3: do the pictures agree, and how many camera paths does a CPU-second buy? The same of
the integrator of `opsr.mitsuba` at the table beta-0.001, and its error beside that of Mitsuba's `path` in equal time.

    pip install mitsuba numpy
    pip install ./python
    cargo build --release
    python3 tests/bench/against_mitsuba.py target/release/opsr

Both trace the same triangles with the same models (Lambert, a Beckmann conductor that reflects everything, a Beckmann
dielectric), the same depth and Russian roulette. Agreement: the mean of the pictures within 4 standard errors, and the
differences of 8x8 tiles spread as their own noise says. Speed: CPU time of both, in turns, in one run. Not part of the
automatic tests: it needs Mitsuba and minutes. Where Mitsuba's LLVM fails, DRJIT_LIBLLVM_PATH names another; rustc brings one.
With LANES=8 in the environment Mitsuba is held to AVX2; without it a processor with AVX-512 has 16.
"""

import ctypes
import json
import math
import os
import resource
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np

try:
    import mitsuba as mi
except ImportError:
    mi = None  # peers.py has the boxes from here.

SIZE, VERTICES = 128, 12
FOV_Y = math.radians(39)
CAMERA_Z = 3.4
IOR = 1.5
RADIANCE = 20.0


def quad(a, b, c, d):
    """Corners counter-clockwise as seen from the front."""
    p = np.array([a, b, c, d], np.float32)
    n = np.cross(p[1] - p[0], p[2] - p[0])
    return p, np.tile(n / np.linalg.norm(n), (4, 1)).astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32)


def sphere(centre, radius, rings=64):
    segments = 2 * rings
    theta, phi = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments + 1), indexing="ij")
    n = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1).reshape(-1, 3)
    index = []
    at = lambda i, j: i * (segments + 1) + j
    for i in range(rings):
        for j in range(segments):
            if i > 0:
                index.append([at(i, j), at(i, j + 1), at(i + 1, j)])
            if i + 1 < rings:
                index.append([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)])
    return (radius * n + centre).astype(np.float32), n.astype(np.float32), np.array(index, np.uint32)


WHITE, RED, GREEN = [0.7, 0.7, 0.7], [0.6, 0.1, 0.1], [0.1, 0.5, 0.1]
ROOM = [
    ("floor", WHITE, quad([-1, -1, 1], [1, -1, 1], [1, -1, -1], [-1, -1, -1])),
    ("ceiling", WHITE, quad([-1, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1])),
    ("back", WHITE, quad([-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1])),
    ("left", RED, quad([-1, -1, 1], [-1, -1, -1], [-1, 1, -1], [-1, 1, 1])),
    ("right", GREEN, quad([1, -1, -1], [1, -1, 1], [1, 1, 1], [1, 1, -1])),
    ("light", "light", quad([-0.3, 0.99, -0.3], [0.3, 0.99, -0.3], [0.3, 0.99, 0.3], [-0.3, 0.99, 0.3])),
]
# A material is a reflectance, the light, or a kind and its alpha.
SCENES = {
    "glass and metal": ROOM + [
        ("ball", ("glass", 0.09), sphere([-0.4, -0.6, 0.3], 0.38)),
        ("other", ("metal", 0.15), sphere([0.45, -0.55, -0.3], 0.42)),
    ],
    "sharp and rough": ROOM + [
        ("ball", ("metal", 0.04), sphere([-0.4, -0.6, 0.3], 0.38)),
        ("other", ("glass", 0.3), sphere([0.45, -0.55, -0.3], 0.42)),
        ("third", ("metal", 0.5), sphere([0.1, 0.2, -0.5], 0.3)),
    ],
    "diffuse": ROOM + [
        ("ball", WHITE, sphere([-0.4, -0.6, 0.3], 0.38)),
        ("other", WHITE, sphere([0.45, -0.55, -0.3], 0.42)),
    ],
    "a million triangles": ROOM + [("ball", WHITE, sphere([0.0, -0.3, 0.0], 0.68, 500))],
}


def material(kind):
    plain = {"KHR_materials_specular": {"specularFactor": 0.0}}
    pbr = {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 1}
    if kind == "light":
        pbr["baseColorFactor"] = [0, 0, 0, 1]
        extensions = dict(plain, KHR_materials_emissive_strength={"emissiveStrength": RADIANCE})
        return {"pbrMetallicRoughness": pbr, "emissiveFactor": [1, 1, 1], "extensions": extensions}
    if kind[0] == "glass":
        pbr["roughnessFactor"] = math.sqrt(kind[1])
        extensions = {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_ior": {"ior": IOR},
            "KHR_materials_volume": {"thicknessFactor": 1},
        }
        return {"pbrMetallicRoughness": pbr, "extensions": extensions}
    if kind[0] == "metal":
        pbr.update(metallicFactor=1, roughnessFactor=math.sqrt(kind[1]))
        return {"pbrMetallicRoughness": pbr}
    pbr["baseColorFactor"] = [*kind, 1]
    return {"pbrMetallicRoughness": pbr, "extensions": plain}


def write_gltf(folder, parts):
    blob, views, accessors, meshes = b"", [], [], []
    for i, (name, _, (p, n, index)) in enumerate(parts):
        first = len(accessors)
        for data, kind, component in [(p, "VEC3", 5126), (n, "VEC3", 5126), (index.reshape(-1), "SCALAR", 5125)]:
            raw = data.tobytes()
            views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(raw)})
            accessor = {"bufferView": len(views) - 1, "componentType": component, "count": len(data), "type": kind}
            if data is p:
                accessor.update(min=p.min(0).tolist(), max=p.max(0).tolist())
            accessors.append(accessor)
            blob += raw
        attributes = {"POSITION": first, "NORMAL": first + 1}
        meshes.append({"name": name, "primitives": [{"attributes": attributes, "indices": first + 2, "material": i}]})
    open(os.path.join(folder, "box.bin"), "wb").write(blob)
    nodes = [{"mesh": i} for i in range(len(parts))] + [{"camera": 0, "translation": [0, 0, CAMERA_Z]}]
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular", "KHR_materials_emissive_strength", "KHR_materials_transmission",
                           "KHR_materials_ior", "KHR_materials_volume"],
        "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes, "meshes": meshes,
        "materials": [material(kind) for _, kind, _ in parts],
        "cameras": [{"type": "perspective", "perspective": {"yfov": FOV_Y, "znear": 0.01, "aspectRatio": 1}}],
        "buffers": [{"uri": "box.bin", "byteLength": len(blob)}], "bufferViews": views, "accessors": accessors,
    }
    path = os.path.join(folder, "box.gltf")
    json.dump(document, open(path, "w"))
    return path


def write_ply(path, p, n, index):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(p)}\n"
    header += "".join(f"property float {k}\n" for k in ["x", "y", "z", "nx", "ny", "nz"])
    header += f"element face {len(index)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = b"".join(struct.pack("<B3i", 3, *map(int, t)) for t in index)
    open(path, "wb").write(header.encode() + np.hstack([p, n]).astype("<f4").tobytes() + faces)


def mitsuba_scene(folder, parts, sampler="independent"):
    rgb = lambda v: {"type": "rgb", "value": v}
    to_world = mi.ScalarTransform4f().look_at(origin=[0, 0, CAMERA_Z], target=[0, 0, 0], up=[0, 1, 0])
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": VERTICES + 1, "rr_depth": 5},
        "sensor": {
            "type": "perspective", "fov": math.degrees(FOV_Y), "fov_axis": "y", "to_world": to_world,
            "sampler": {"type": sampler},
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"},
                     "component_format": "float32"},
        },
    }
    for name, kind, mesh in parts:
        path = os.path.join(folder, name + ".ply")
        write_ply(path, *mesh)
        shape = {"type": "ply", "filename": path}
        if kind == "light":
            shape["emitter"] = {"type": "area", "radiance": rgb([RADIANCE] * 3)}
            shape["bsdf"] = {"type": "diffuse", "reflectance": rgb([0.0] * 3)}
        elif kind == ("glass", 0):
            shape["bsdf"] = {"type": "dielectric", "int_ior": IOR, "ext_ior": 1.0}
        elif kind == ("metal", 0):
            shape["bsdf"] = {"type": "conductor", "material": "none"}
        elif kind[0] == "glass":
            shape["bsdf"] = {"type": "roughdielectric", "distribution": "beckmann", "alpha": kind[1],
                             "int_ior": IOR, "ext_ior": 1.0}
        elif kind[0] == "metal":
            shape["bsdf"] = {"type": "roughconductor", "distribution": "beckmann", "alpha": kind[1],
                             "material": "none"}
        else:
            shape["bsdf"] = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(kind)}}
        scene[name] = shape
    return mi.load_dict(scene)


def opsr_render(program, gltf, spp, seed, *options):
    """Picture, and CPU seconds of the process."""
    out = os.path.join(os.path.dirname(gltf), "opsr.exr")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([program, "render", gltf, "--spp", str(spp), "--size", f"{SIZE}x{SIZE}", "--max-depth",
                    str(VERTICES), "--seed", str(seed), "--resolve", "raw", "--progress", "none", "-o", out, *options], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    picture = mi.Bitmap(out)
    names = [field.name for field in picture.struct_()]
    pixels = np.array(picture)[..., [names.index(channel) for channel in "RGB"]]
    return pixels, seconds


def mitsuba_render(scene, spp, seed, integrator=None):
    start = time.process_time()
    pixels = np.array(mi.render(scene, spp=spp, seed=seed, integrator=integrator))[..., :3]
    return pixels, time.process_time() - start


def tiles(picture):
    return picture.mean(-1).reshape(SIZE // 8, 8, SIZE // 8, 8).mean((1, 3))


def compare(name, a_name, a_render, b_name, b_render, spp, turns):
    """Prints what was found; whether the pictures agree."""
    b_render(spp, 1000)  # Compiles Mitsuba's kernels.
    start = min(a_render(1, 1000)[1] for _ in range(2))
    ours, theirs, seconds = [], [], [0.0, 0.0]
    for turn in range(turns):
        a, s = a_render(spp, turn)
        seconds[0] += s
        b, t = b_render(spp, turn)
        seconds[1] += t
        ours.append(tiles(a))
        theirs.append(tiles(b))
    ours, theirs = np.array(ours), np.array(theirs)
    error = lambda x: np.sqrt(x.var(0, ddof=1) / turns)
    z = (ours.mean(0) - theirs.mean(0)) / np.maximum(np.hypot(error(ours), error(theirs)), 1e-9)
    a, b = ours.mean((1, 2)), theirs.mean((1, 2))
    mean_z = (a.mean() - b.mean()) / math.hypot(a.std(ddof=1), b.std(ddof=1)) * math.sqrt(turns)
    print(f"{name}: mean radiance: {a_name} {a.mean():.5f}, {b_name} {b.mean():.5f}, ratio {a.mean() / b.mean():.5f}, z {mean_z:.2f}")
    # Student's t with about 10 degrees of freedom has a variance of 1.25.
    print(f"  tiles of 8x8: mean square of z {np.mean(z**2):.2f} (1.25 expected), largest |z| {np.abs(z).max():.1f}")
    paths = turns * spp * SIZE * SIZE / 1e6
    print(f"  {a_name} {paths / seconds[0]:.3f}, {b_name} {paths / seconds[1]:.3f} million camera paths per CPU-second: "
          f"ratio {seconds[1] / seconds[0]:.2f}, {seconds[1] / (seconds[0] - turns * start):.2f} without the "
          f"{start:.2f} s in which {a_name} starts, loads and writes")
    return abs(mean_z) < 4 and np.mean(z**2) < 2


def gain(name, scene, table, plain, spp, turns):
    """Prints the error of the integrator of `opsr.mitsuba` beside that of `path` in equal time."""
    reference = mitsuba_render(scene, 64 * spp, 5000, plain)[0]
    error = lambda picture: float(np.mean((picture - reference) ** 2 / (reference**2 + 0.01)))
    absolute = lambda picture: float(np.mean(np.abs(picture - reference) / (reference + 0.01)))
    costs, errors, mapes = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
    for turn in range(turns):
        for k, integrator in enumerate((plain, table)):
            costs[k] += mitsuba_render(scene, spp, turn, integrator)[1]
    cost = costs[1] / costs[0]
    longer = max(1, round(spp * cost))
    mitsuba_render(scene, longer, 1000, plain)
    for turn in range(turns):
        for k, (integrator, samples) in enumerate(((plain, longer), (table, spp))):
            picture = mitsuba_render(scene, samples, 2000 + turn, integrator)[0]
            errors[k] += error(picture)
            mapes[k] += absolute(picture)
    print(f"{name}: {cost:.2f} of the time of `path`; at {spp} samples and the {longer} of `path` in that time: "
          f"relMSE {errors[1] / errors[0]:.2f}, MAPE {mapes[1] / mapes[0]:.2f} of it")


def hold_to_avx2():
    """Compiles Mitsuba's kernels for AVX2 and 8 lanes. Dr.Jit has a function for that, but not in Python."""
    import drjit

    core = ctypes.CDLL(os.path.join(os.path.dirname(drjit.__file__), "libdrjit-core.so"))
    core._Z19jit_llvm_set_targetPKcS0_j(b"x86-64-v3", b"+avx2,+fma", ctypes.c_uint(8))


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else "target/release/opsr"
    spp = int(os.environ.get("SPP", 256))
    if mi is None:
        sys.exit("pip install mitsuba")
    mi.set_variant("llvm_ad_rgb")
    if os.environ.get("LANES") == "8":
        hold_to_avx2()
    try:
        import opsr.mitsuba
    except ImportError:
        print("without the integrator of opsr: pip install ./python")
        table = None
    else:
        opsr.mitsuba.register()
        bounds = {"max_depth": VERTICES + 1, "rr_depth": 5}
        table = mi.load_dict({"type": "opsr", "table": "beta-0.001", **bounds})
        plain = mi.load_dict({"type": "path", **bounds})
    agree = []
    for name, parts in SCENES.items():
        with tempfile.TemporaryDirectory() as folder:
            gltf, scene = write_gltf(folder, parts), mitsuba_scene(folder, parts)
            ours = lambda *options: lambda spp, seed: opsr_render(program, gltf, spp, seed, *options)
            theirs = lambda integrator: lambda spp, seed: mitsuba_render(scene, spp, seed, integrator)
            agree.append(compare(name, "opsr", ours(), "Mitsuba", theirs(None), spp, 6))
            if table is not None:
                at = ours("--opsr-table", "beta-0.001", "--resolve", "raw")
                agree.append(compare(name + ", table", "opsr", at, "opsr.mitsuba", theirs(table), spp, 6))
                gain(name, scene, table, plain, spp // 4, 6)
    return 0 if all(agree) else 1


if __name__ == "__main__":
    sys.exit(main())
