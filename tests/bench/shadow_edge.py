#!/usr/bin/env python3
"""The shadow's edge on a coarse ball with smooth normals, over that of a sphere: the table of docs/lab/fixes.md, "The shadow's edge".

    pip install numpy OpenEXR
    cargo build --release
    python3 tests/bench/shadow_edge.py target/release/opsr [SAMPLES]    # 64

Not part of the automatic tests: it takes some minutes.
"""

import math
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR

PROGRAM = sys.argv[1]
SAMPLES = int(sys.argv[2]) if len(sys.argv) > 2 else 64
ROWS, COLUMNS = 5, 10
SKY = '<emitter type="constant"><rgb name="radiance" value="1,1,1"/></emitter>'
SUN = '<emitter type="directional"><vector name="direction" value="{}"/><rgb name="irradiance" value="3,3,3"/></emitter>'
LAMP = (
    '<shape type="sphere"><point name="center" value="3,2,1"/><float name="radius" value="0.5"/>'
    '<emitter type="area"><rgb name="radiance" value="10,10,10"/></emitter></shape>'
)


def matt(albedo):
    return f'<bsdf type="diffuse"><rgb name="reflectance" value="{albedo},{albedo},{albedo}"/></bsdf>'


FLOOR = f'<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>{matt(0.5)}</shape>'


def write_ball(path):
    points = []
    for i in range(ROWS + 1):
        for j in range(COLUMNS + 1):
            a, b = math.pi * i / ROWS, 2 * math.pi * j / COLUMNS
            points.append((math.sin(a) * math.cos(b), math.cos(a), math.sin(a) * math.sin(b)))
    faces = []
    for i in range(ROWS):
        for j in range(COLUMNS):
            a, b = i * (COLUMNS + 1) + j + 1, (i + 1) * (COLUMNS + 1) + j + 1
            faces += [(a, a + 1, b + 1)] * (i > 0) + [(a, b + 1, b)] * (i < ROWS - 1)
    lines = [f"{kind} {x} {y} {z}" for kind in ("v", "vn") for x, y, z in points]
    lines += ["f " + " ".join(f"{k}//{k}" for k in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")


def ball(coarse, albedo, turn, y):
    if coarse:
        place = f'<transform name="to_world"><rotate z="1" angle="{turn}"/><translate y="{y}"/></transform>'
        return f'<shape type="obj"><string name="filename" value="ball.obj"/>{place}{matt(albedo)}</shape>'
    return f'<shape type="sphere"><point name="center" value="0,{y},0"/>{matt(albedo)}</shape>'


SCENES = {
    "sun from the side": lambda coarse: (SUN.format("-1,0,0") + ball(coarse, 0.5, 0, 0.8), "0,0.8,6"),
    "white furnace": lambda coarse: (SKY + ball(coarse, 1, 0, 0.8), "0,2,6"),
    "sky, on a floor": lambda coarse: (SKY + FLOOR + ball(coarse, 0.8, 36, 0.9), "0,2,6"),
    "sun, on a floor": lambda coarse: (SUN.format("-1,-0.5,0.1") + FLOOR + ball(coarse, 0.8, 36, 0.9), "0,2,6"),
    "lamp, on a floor": lambda coarse: (LAMP + FLOOR + ball(coarse, 0.8, 36, 0.9), "0,2,6"),
}


def render(folder, scene, coarse, integrator, samples):
    parts, eye = SCENES[scene](coarse)
    sensor = (
        f'<sensor type="perspective"><float name="fov" value="30"/><transform name="to_world"><lookat origin="{eye}" target="0,0.8,0" '
        'up="0,1,0"/></transform><film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/></film></sensor>'
    )
    (folder / "scene.xml").write_text(f'<scene version="3.0.0">{sensor}{parts}</scene>')
    options = ["--integrator", integrator, "--resolve", "raw", "--spp", str(samples), "--progress", "none"]
    command = [PROGRAM, "render", folder / "scene.xml", *options, "-o", folder / "picture.exr"]
    subprocess.run(command, check=True, capture_output=True)
    return OpenEXR.File(str(folder / "picture.exr")).channels()["RGB"].pixels.mean(-1)


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    write_ball(folder / "ball.obj")
    for scene in SCENES:
        fine = render(folder, scene, False, "path", SAMPLES)
        lit = fine > 0.02 * fine.max()
        for integrator in ("path", "bdpt", "vcm", "sppm"):
            coarse = render(folder, scene, True, integrator, SAMPLES)
            dark = (coarse[lit] < fine[lit] / 3).sum()
            print(f"{scene}, {integrator}: {coarse.mean() / fine.mean():.4f}, {dark} of {lit.sum()} below a third", flush=True)
