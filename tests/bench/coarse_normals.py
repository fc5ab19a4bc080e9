#!/usr/bin/env python3
"""Light that shading normals lose: coarse balls and ripples of a normal map in a white surrounding, and the light of bdpt and vcm over
that of path beside a coarse ball. The tables of docs/lab/fixes.md, "Dark rims".

    pip install numpy OpenEXR
    cargo build --release
    python3 tests/bench/coarse_normals.py target/release/opsr

Not part of the automatic tests: it takes some minutes.
"""

import base64
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

import numpy as np
import OpenEXR

PROGRAM = sys.argv[1]


def pbr(metallic, roughness, base=(1, 1, 1), **extensions):
    surface = {"metallicFactor": metallic, "roughnessFactor": roughness, "baseColorFactor": [*base, 1]}
    return {"pbrMetallicRoughness": surface, "extensions": {f"KHR_materials_{name}": value for name, value in extensions.items()}}


BALLS = {
    "mirror": pbr(1, 0),
    "metal of roughness 0.2": pbr(1, 0.2),
    "metal of roughness 0.4": pbr(1, 0.4),
    "gloss": pbr(0, 0.1),
    "coat": pbr(1, 0.3, clearcoat={"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0}),
    "glass": pbr(0, 0, transmission={"transmissionFactor": 1}, volume={"thicknessFactor": 1}),
}
MATT = pbr(0, 1, (0.6, 0.6, 0.6), specular={"specularFactor": 0})
LAMP = {**pbr(0, 1, (0, 0, 0), emissive_strength={"emissiveStrength": 60}), "emissiveFactor": [1, 1, 1]}


def ball(rows):
    """A ball of this many rows and twice as many columns, with smooth normals."""
    columns, at = 2 * rows, lambda i, j: i * (2 * rows + 1) + j
    angles = [(math.pi * i / rows, 2 * math.pi * j / columns) for i in range(rows + 1) for j in range(columns + 1)]
    points = [[math.sin(t) * math.cos(p), math.cos(t), math.sin(t) * math.sin(p)] for t, p in angles]
    upper = [[at(i, j), at(i, j + 1), at(i + 1, j)] for i in range(1, rows) for j in range(columns)]
    lower = [[at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)] for i in range(rows - 1) for j in range(columns)]
    return {"POSITION": points, "NORMAL": points}, upper + lower


def quad(*corners, uvs=None):
    return {"POSITION": corners, **({"TEXCOORD_0": uvs} if uvs else {})}, [[0, 1, 2], [0, 2, 3]]


def write(path, meshes, eye, fov, normal_map=None):
    """A glTF file of meshes with a material each, and a camera at a height and a distance that sees the origin."""
    data, views, accessors = b"", [], []

    def add(array, kind):
        nonlocal data
        array = np.array(array, np.float32 if kind[0] == "V" else np.uint16)
        flat = array.reshape(-1, int(kind[-1]) if kind[0] == "V" else 1)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126 if kind[0] == "V" else 5123, "count": len(flat), "type": kind,
                          "min": flat.min(0).tolist(), "max": flat.max(0).tolist()})
        data += array.tobytes() + bytes(-array.nbytes % 4)
        return len(accessors) - 1

    listed, materials = [], []
    for (attributes, faces), material in meshes:
        attributes = {name: add(values, f"VEC{len(values[0])}") for name, values in attributes.items()}
        listed.append({"primitives": [{"attributes": attributes, "indices": add(faces, "SCALAR"), "material": len(materials)}]})
        materials.append(material)
    turn = -math.atan2(*eye) / 2
    nodes = [{"mesh": i} for i in range(len(listed))]
    nodes.append({"camera": 0, "translation": [0, *eye], "rotation": [math.sin(turn), 0, 0, math.cos(turn)]})
    used = sorted({name for material in materials for name in material["extensions"]})
    uri = lambda kind, content: f"data:{kind};base64,{base64.b64encode(content).decode()}"
    scene = {
        "asset": {"version": "2.0"}, "extensionsUsed": used, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes,
        "meshes": listed, "materials": materials, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": uri("application/octet-stream", data)}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": fov, "znear": 0.01, "aspectRatio": 1}}],
    }
    if normal_map:
        scene |= {"images": [{"uri": uri("image/png", normal_map)}], "textures": [{"source": 0}]}
        materials[0] |= {"normalTexture": {"index": 0}, "doubleSided": True}
    path.write_text(json.dumps(scene))


def ripples(degrees=10, rows=256):
    """A PNG file of one column: normals that lean along v as a sine."""
    slopes = [math.radians(degrees) * math.sin(2 * math.pi * i / rows) for i in range(rows)]
    encode = lambda x: round(127.5 + 127.5 * x)
    texels = b"".join(bytes([0, 128, encode(math.sin(s)), encode(math.cos(s))]) for s in slopes)
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    header = struct.pack(">IIBBBBB", 1, rows, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(texels)) + chunk(b"IEND", b"")


def main(folder):
    scene, picture, white = folder / "scene.gltf", folder / "picture.exr", folder / "white.exr"
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": np.ones((8, 16, 3), np.float32)}).write(str(white))

    def render(size, samples, env=white, integrator="path"):
        options = f"--size {size}x{size} --spp {samples} --integrator {integrator} --resolve raw --progress none --env {env}".split()
        subprocess.run([PROGRAM, "render", scene, *options, "-o", picture], check=True, stderr=subprocess.DEVNULL)
        channels = OpenEXR.File(str(picture)).channels()
        return np.array((channels["RGB"] if "RGB" in channels else channels["RGBA"]).pixels, np.float64)[..., :3]

    print("least pixel in a surrounding of 1, balls of 6, 8 and 16 rows")
    for name, material in BALLS.items():
        least = []
        for rows in (6, 8, 16):
            write(scene, [(ball(rows), material)], (0.6, 5.0), 0.45)
            least.append(f"{render(96, 64).mean(2).min():.3f}")
        print(f"  {name}: {', '.join(least)}", flush=True)

    print("ripples of 10 degrees over the same surface without, from 5, 10 and 20 degrees")
    water = pbr(0, 0, (0, 0, 0), ior={"ior": 1.33})
    plane = quad([-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1], uvs=[[0, 0], [1, 0], [1, 10], [0, 10]])
    for name, material in {"metal": pbr(1, 0), "water": water}.items():
        ratios = []
        for degrees in (5, 10, 20):
            height, distance = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
            means = []
            for normal_map in (ripples(), None):
                # Six ripples fill the picture from below to above.
                write(scene, [(plane, dict(material))], (100 * height, 100 * distance), 0.012 * height, normal_map)
                means.append(render(64, 64).mean())
            ratios.append(f"{means[0] / means[1]:.3f}")
        print(f"  {name}: {', '.join(ratios)}", flush=True)

    print("light of bdpt and vcm over that of path, a ball of 8 rows over a floor under a small lamp")
    floor = quad([-3, -1.02, 3], [3, -1.02, 3], [3, -1.02, -3], [-3, -1.02, -3])
    lamp = quad([1.5, 1.7, 1.2], [1.9, 1.6, 1.2], [1.9, 1.6, 1.7], [1.5, 1.7, 1.7])
    for name in ("mirror", "glass"):
        write(scene, [(ball(8), BALLS[name]), (floor, MATT), (lamp, LAMP)], (0.6, 5.0), 0.45)
        means = [render(48, n, "none", integrator).mean() for integrator, n in (("path", 1024), ("bdpt", 256), ("vcm", 256))]
        print(f"  {name}: {means[1] / means[0]:.4f}, {means[2] / means[0]:.4f}", flush=True)


with tempfile.TemporaryDirectory() as place:
    main(pathlib.Path(place))
