#!/usr/bin/env python3
"""Ten scenes of kinds that nothing was learned or tuned on, as pbrt files, and suites of every method on them.

    python3 suites/unseen.py scenes unseen                        # ten files and three suites below the folder unseen
    python3 suites/unseen.py references unseen [OPSR] [SAMPLES]   # references of raw vcm (128) and the error they have left
    opsr bench unseen/small.toml -o small.json                    # 64x48 pixels; frames.toml has 256x192
    opsr bench unseen/denoised.toml -o denoised.json              # beside Open Image Denoise, which OIDN_DIR names
    python3 suites/auto.py small.json

Lengths are metres, radiances W/(m² sr). Every mesh is turned or boxed here; nothing is random but the leaves, whose generator is seeded.
"""

import json
import math
import os
import random
import subprocess
import sys

HEAD = """Sampler "sobol" "integer pixelsamples" [64]
Film "rgb" "integer xresolution" [256] "integer yresolution" [192]
LookAt {} {} {} {} {} {} 0 1 0
Camera "perspective" "float fov" [{}]
WorldBegin
"""


def scene(eye, at, fov, *parts):
    return HEAD.format(*eye, *at, fov) + "".join(parts)


def diffuse(r, g=None, b=None):
    return f'Material "diffuse" "rgb reflectance" [{r} {r if g is None else g} {r if b is None else b}]\n'


def metal(r, g, b, roughness=0.0):
    return f'Material "conductor" "rgb reflectance" [{r} {g} {b}] "float roughness" [{roughness}] "bool remaproughness" [false]\n'


def glass(eta=1.5, roughness=0.0):
    return f'Material "dielectric" "float eta" [{eta}] "float roughness" [{roughness}] "bool remaproughness" [false]\n'


def gloss(r, g, b, roughness=0.05):
    return (
        f'Material "coateddiffuse" "rgb reflectance" [{r} {g} {b}] "float roughness" [{roughness}] "bool remaproughness" [false]\n'
    )


def lamp(r, g, b, *shapes):
    return f'AttributeBegin\nAreaLightSource "diffuse" "rgb L" [{r} {g} {b}]\n' + diffuse(0.0) + "".join(shapes) + "AttributeEnd\n"


def sky(r, g, b):
    return f'LightSource "infinite" "rgb L" [{r} {g} {b}]\n'


def sun(source, r, g, b):
    return 'LightSource "distant" "point3 from" [{} {} {}] "point3 to" [0 0 0] "rgb L" [{} {} {}]\n'.format(*source, r, g, b)


def inside(name, absorbs, *parts):
    return (
        f'MakeNamedMedium "{name}" "string type" "homogeneous" "rgb sigma_a" [{absorbs[0]} {absorbs[1]} {absorbs[2]}] '
        f'"rgb sigma_s" [0 0 0]\nAttributeBegin\nMediumInterface "{name}" ""\n' + "".join(parts) + "AttributeEnd\n"
    )


def mesh(points, faces, normals=None):
    def words(rows):
        return " ".join(" ".join(f"{x:.6g}" for x in row) for row in rows)

    text = f'Shape "trianglemesh" "point3 P" [{words(points)}] "integer indices" [{words(faces)}]'
    return text + (f' "normal N" [{words(normals)}]\n' if normals else "\n")


def quad(a, b, c, d):
    return mesh([a, b, c, d], [(0, 1, 2), (0, 2, 3)])


def floor(y, half, x=0.0, z=0.0):
    return quad((x - half, y, z - half), (x - half, y, z + half), (x + half, y, z + half), (x + half, y, z - half))


def box(low, high, turn=0.0):
    middle = [(a + b) / 2 for a, b in zip(low, high)]
    corners = [[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)]
    cos, sin = math.cos(turn), math.sin(turn)
    points = []
    for x, y, z in corners:
        dx, dz = x - middle[0], z - middle[2]
        points.append((middle[0] + cos * dx + sin * dz, y, middle[2] - sin * dx + cos * dz))
    sides = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    return mesh(points, [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])


def turned(profile, centre=(0, 0, 0), segments=48, axis="y"):
    """A surface of revolution with smooth normals; the profile, radius and height, runs upwards for normals that point out."""
    points, normals, faces = [], [], []
    for i, (r, h) in enumerate(profile):
        before, after = profile[max(i - 1, 0)], profile[min(i + 1, len(profile) - 1)]
        dr, dh = after[0] - before[0], after[1] - before[1]
        length = math.hypot(dr, dh) or 1.0
        for k in range(segments + 1):
            angle = 2 * math.pi * k / segments
            cos, sin = math.cos(angle), math.sin(angle)
            local, normal = (r * cos, h, -r * sin), (dh / length * cos, -dr / length, -dh / length * sin)
            if axis == "z":
                local, normal = (local[0], -local[2], local[1]), (normal[0], -normal[2], normal[1])
            points.append(tuple(c + x for c, x in zip(centre, local)))
            normals.append(normal)
    row = segments + 1
    for i in range(len(profile) - 1):
        for k in range(segments):
            a, b = i * row + k, (i + 1) * row + k
            faces += [(a, a + 1, b + 1)] if profile[i][0] else []
            faces += [(a, b + 1, b)] if profile[i + 1][0] else []
    return mesh(points, faces, normals)


def arc(radius, low=-90, high=90, steps=24, flat=1.0, x=0.0):
    angles = [math.radians(low + (high - low) * i / steps) for i in range(steps + 1)]
    return [(round(x + radius * math.cos(a), 9), flat * radius * math.sin(a)) for a in angles]


def ball(centre, radius, segments=48, flat=1.0):
    return turned(arc(radius, flat=flat), centre, segments)


def ring(centre, radius, thick, axis="y", segments=64):
    return turned(arc(thick, -180, 180, 20, x=radius), centre, segments, axis)


def cup(centre, radius, height, wall):
    """An open vessel with a rounded foot: outside up, inside down."""
    outside = [(0, 0), (0.7 * radius, 0), (0.85 * radius, 0.05 * height), (radius, height)]
    within = [(radius - wall, height), (0.85 * radius - wall, wall + 0.05 * height), (0, wall + 0.05 * height)]
    return turned(outside[:2], centre) + turned(outside[1:], centre) + turned([outside[-1], within[0]], centre) + turned(within[:2], centre) + turned(within[1:], centre)


def room(low, high, walls, open_side=None):
    """The inside of a box: floor, ceiling and walls but for one of them (0 to 5: -x, +x, -y, +y, -z, +z)."""
    (a, b, c), (d, e, f) = low, high
    sides = [
        quad((a, b, c), (a, e, c), (a, e, f), (a, b, f)), quad((d, b, c), (d, b, f), (d, e, f), (d, e, c)),
        quad((a, b, c), (a, b, f), (d, b, f), (d, b, c)), quad((a, e, c), (d, e, c), (d, e, f), (a, e, f)),
        quad((a, b, c), (d, b, c), (d, e, c), (a, e, c)), quad((a, b, f), (a, e, f), (d, e, f), (d, b, f)),
    ]
    return walls + "".join(side for i, side in enumerate(sides) if i != open_side)


def sunglasses():
    parts = [sky(0.6, 0.7, 0.9), sun((2, 4, 1), 6, 5.6, 5), diffuse(0.55, 0.4, 0.28), floor(0, 2)]
    for x in (-0.035, 0.035):
        tinted = turned(arc(0.026, -90, 90, 16, flat=0.06), (x, 0.027, 0), 40, "z")
        parts.append(inside(f"tint{x}", (600, 700, 800), glass(), tinted))
        parts += [gloss(0.02, 0.02, 0.02), ring((x, 0.027, 0), 0.0275, 0.0018, "z", 48)]
        parts.append(box((1.85 * x - 0.001, 0.03, -0.12), (1.85 * x + 0.001, 0.034, 0)))
    parts += [gloss(0.02, 0.02, 0.02), box((-0.009, 0.032, -0.001), (0.009, 0.036, 0.001))]
    return scene((0.08, 0.12, 0.22), (0, 0.015, -0.03), 42, *parts)


def hall():
    parts = [sky(1.2, 1.4, 1.8), room((-4, 0, -6), (4, 5, 6), diffuse(0.75, 0.73, 0.7), 1)]
    parts += [diffuse(0.5, 0.5, 0.52)] + [box((-4, 0, -5 + 0.35 * i), (-1, 0.2 * (i + 1), -4.65 + 0.35 * i)) for i in range(12)]
    parts += [diffuse(0.7), box((3.6, 0, -2.2), (4.2, 5, -0.8)), box((3.6, 0, 0.8), (4.2, 5, 2.2)), box((3.6, 0, -6), (4.2, 1, 6))]
    parts += [diffuse(0.3, 0.1, 0.08), box((1, 0, -2), (2, 0.5, 0), 0.4)]
    return scene((2.5, 1.7, 5.5), (-1.5, 1.6, -2), 62, *parts)


def coffee_maker():
    parts = [room((-0.6, 0, -0.4), (0.6, 0.9, 1.2), diffuse(0.8, 0.78, 0.74))]
    parts.append(lamp(14, 13, 11, quad((-0.3, 0.899, 0.1), (0.3, 0.899, 0.1), (0.3, 0.899, 0.5), (-0.3, 0.899, 0.5))))
    parts += [gloss(0.03, 0.03, 0.035, 0.08), box((-0.12, 0, -0.2), (0.12, 0.04, 0.06)), box((-0.12, 0.04, -0.2), (0.12, 0.3, -0.09))]
    parts += [box((-0.12, 0.24, -0.2), (0.12, 0.32, 0.06)), metal(0.85, 0.85, 0.86, 0.15), box((-0.121, 0.225, -0.1), (0.121, 0.238, 0.061))]
    jug = [(0, 0.045), (0.06, 0.045), (0.078, 0.075), (0.074, 0.13), (0.052, 0.19), (0.055, 0.205)]
    within = [(0.052, 0.205), (0.049, 0.19), (0.071, 0.13), (0.075, 0.076), (0.058, 0.048), (0, 0.048)]
    coffee = [(0, 0.0485), (0.0575, 0.0485), (0.0745, 0.077), (0.0705, 0.128), (0, 0.128)]
    parts += [glass(), turned(jug + within, (0, 0, -0.01)), inside("coffee", (60, 140, 300), glass(1.33), turned(coffee, (0, 0, -0.01)))]
    parts += [gloss(0.7, 0.12, 0.08), cup((0.25, 0, 0.15), 0.04, 0.09, 0.004)]
    return scene((0.2, 0.33, 0.75), (0.04, 0.13, -0.02), 38, *parts)


def desk_lamp():
    parts = [room((-1, 0, -0.6), (1, 2, 2), diffuse(0.62, 0.66, 0.7)), diffuse(0.4, 0.25, 0.14), box((-0.9, 0, -0.55), (0.9, 0.03, 0.5))]
    shade = [(0.09, 0.4), (0.025, 0.5), (0.02, 0.53)]
    parts += [metal(0.9, 0.9, 0.9, 0.1), turned(shade, (-0.2, 0, 0)), turned([(r - 0.002, h) for r, h in reversed(shade)], (-0.2, 0, 0))]
    parts += [lamp(600, 520, 400, ball((-0.2, 0.45, 0), 0.012, 16)), glass(), ball((-0.2, 0.45, 0), 0.026)]
    parts += [gloss(0.1, 0.1, 0.12), turned([(0.1, 0.03), (0.1, 0.045), (0, 0.05)], (-0.45, 0, -0.1)), box((-0.46, 0.04, -0.11), (-0.44, 0.55, -0.09))]
    parts += [box((-0.46, 0.54, -0.11), (-0.2, 0.555, -0.09)), diffuse(0.85), box((-0.1, 0.03, 0.05), (0.11, 0.032, 0.35), 0.3)]
    parts += [glass(), ball((0.08, 0.058, -0.02), 0.028), metal(0.95, 0.78, 0.4, 0.05), ring((-0.02, 0.034, 0.2), 0.03, 0.004)]
    return scene((0.35, 0.5, 0.85), (-0.1, 0.16, 0), 45, *parts)


def window():
    parts = [sky(0.8, 0.9, 1.2), sun((1.2, 1.5, 0.4), 40, 37, 30), room((-1.2, 0, -1), (1, 2.2, 1.6), diffuse(0.78, 0.75, 0.7), 1)]
    parts += [diffuse(0.7), box((0.98, 0, -1), (1.02, 0.9, 1.6)), box((0.98, 1.9, -1), (1.02, 2.2, 1.6))]
    parts += [box((0.98, 0.9, -1), (1.02, 1.9, -0.4)), box((0.98, 0.9, 0.8), (1.02, 1.9, 1.6)), glass(), box((0.995, 0.9, -0.4), (1.005, 1.9, 0.8))]
    parts += [diffuse(0.5, 0.32, 0.2), box((-0.6, 0.7, -0.5), (0.7, 0.74, 0.5)), glass(), cup((0.2, 0.741, 0), 0.04, 0.14, 0.003)]
    parts += [inside("water", (0.4, 0.1, 0.05), glass(1.33), turned([(0, 0.0105), (0.031, 0.0105), (0.0355, 0.09), (0, 0.09)], (0.2, 0.741, 0)))]
    parts += [gloss(0.75, 0.3, 0.05), ball((0.0, 0.785, 0.12), 0.045)]
    return scene((-0.35, 1.02, 0.4), (0.2, 0.8, 0.0), 42, *parts)


def chandelier():
    parts = [room((-2, 0, -2), (2, 3, 3), diffuse(0.7, 0.62, 0.5)), metal(0.9, 0.7, 0.35, 0.08), ring((0, 2.05, 0), 0.5, 0.02)]
    parts.append(box((-0.01, 2.05, -0.01), (0.01, 3, 0.01)))
    drop = [(0, -0.05), (0.016, -0.025), (0.018, -0.012), (0.006, 0.01), (0, 0.02)]
    for i in range(8):
        angle = 2 * math.pi * i / 8
        x, z = 0.5 * math.cos(angle), 0.5 * math.sin(angle)
        parts += [lamp(120, 90, 50, ball((x, 2.17, z), 0.014, 12, 2.2)), diffuse(0.8, 0.78, 0.7), turned([(0.012, 2.07), (0.012, 2.13), (0, 2.13)], (x, 0, z), 12)]
        for k in range(2):
            about = angle + 0.25 + 0.3 * k
            parts += [glass(1.6), turned(drop, (0.5 * math.cos(about), 1.98, 0.5 * math.sin(about)), 6)]
    parts += [glass(1.6), ball((0, 1.9, 0), 0.06, 8)]
    return scene((0.6, 1.5, 2.6), (0, 1.85, 0), 46, *parts)


def bathroom():
    parts = [room((-1, 0, -0.8), (1, 2.4, 1.8), gloss(0.75, 0.8, 0.82, 0.02)), metal(0.95, 0.95, 0.95), box((-0.45, 1.2, -0.799), (0.45, 1.9, -0.79))]
    parts += [lamp(60, 56, 48, ball((x, 2.0, -0.7), 0.04, 24)) for x in (-0.3, 0.0, 0.3)]
    parts += [gloss(0.85, 0.85, 0.85), cup((0, 0.75, -0.45), 0.3, 0.14, 0.03), metal(0.9, 0.9, 0.92, 0.03), turned([(0.02, 0.85), (0.018, 1.05), (0, 1.06)], (0, 0, -0.74))]
    parts += [box((-0.015, 1.02, -0.74), (0.015, 1.04, -0.5)), glass(), cup((0.38, 0.9, -0.6), 0.035, 0.1, 0.004), diffuse(0.2, 0.5, 0.3), box((-0.5, 0.86, -0.78), (-0.32, 0.9, -0.6))]
    return scene((0.35, 1.55, 1.1), (0, 1.15, -0.6), 55, *parts)


def aquarium():
    parts = [room((-1.5, 0, -1), (1.5, 2.2, 2), diffuse(0.35, 0.38, 0.42)), diffuse(0.25, 0.15, 0.1), box((-0.7, 0, -0.5), (0.7, 0.7, 0.2))]
    parts.append(lamp(90, 95, 100, quad((-0.35, 1.36, -0.2), (0.35, 1.36, -0.2), (0.35, 1.36, -0.12), (-0.35, 1.36, -0.12))))
    water = box((-0.55, 0.71, -0.4), (0.55, 1.15, 0.1))
    parts += [inside("tank", (0.5, 0.12, 0.06), glass(1.33), water), diffuse(0.75, 0.68, 0.5), box((-0.54, 0.705, -0.39), (0.54, 0.76, 0.09))]
    parts += [diffuse(0.9, 0.35, 0.1), ball((-0.2, 0.95, -0.1), 0.05, 32, 0.6), ball((0.25, 1.02, -0.2), 0.04, 32, 0.6), diffuse(0.3, 0.3, 0.32), ball((0.05, 0.78, -0.2), 0.1, 12)]
    return scene((0.5, 1.35, 1.7), (0, 0.95, -0.1), 42, *parts)


def car():
    parts = [sky(0.7, 0.85, 1.1), sun((3, 4, 2), 5, 4.7, 4.2), diffuse(0.18), floor(0, 60), gloss(0.55, 0.03, 0.04, 0.01)]
    parts += [turned(arc(1.0, -30, 90, 32, flat=0.55), (0, 0.55, 0), 64), inside("pane", (3, 2.4, 2.6), glass(), turned(arc(0.62, 0, 90, 24, flat=0.8), (0, 0.85, 0), 64), turned([(0, 0.0), (0.62, 0.0)], (0, 0.85, 0), 64))]
    parts += [diffuse(0.03)] + [turned([(0.0, -0.12), (0.3, -0.12), (0.3, 0.12), (0.0, 0.12)], (x, 0.3, 0.95), 32, "z") for x in (-0.62, 0.62)]
    parts += [metal(0.9, 0.9, 0.9, 0.04)] + [turned([(0.18, 0.13), (0.0, 0.16)], (x, 0.3, 0.95), 32, "z") for x in (-0.62, 0.62)]
    return scene((2.2, 1.5, 3.4), (0, 0.5, 0.2), 36, *parts)


def greenhouse():
    leaves = random.Random(5)
    parts = [sky(0.7, 0.8, 1.0), sun((1, 2, 1.4), 25, 23, 19), diffuse(0.35, 0.26, 0.18), floor(0, 8)]
    parts += [diffuse(0.75), box((-1.5, 0, -1.5), (1.5, 0.6, -1.45)), box((-1.5, 0, -1.5), (-1.45, 0.6, 1.5)), box((1.45, 0, -1.5), (1.5, 0.6, 1.5))]
    parts += [glass()] + [box((-1.5 + 0.75 * i, 2.0, -1.5), (-0.77 + 0.75 * i, 2.006, 1.5)) for i in range(4)]
    parts += [box((-1.5, 0.6, -1.49), (1.5, 2.0, -1.484)), box((-1.49, 0.6, -1.5), (-1.484, 2.0, 1.5)), box((1.484, 0.6, -1.5), (1.49, 2.0, 1.5))]
    for x in (-0.8, 0.0, 0.8):
        parts += [diffuse(0.6, 0.28, 0.16), cup((x, 0, -0.5), 0.2, 0.35, 0.02), gloss(0.12, 0.34, 0.06, 0.2)]
        for _ in range(60):
            angle, lift, reach = leaves.uniform(0, 6.28), leaves.uniform(0.35, 1.1), leaves.uniform(0.1, 0.4)
            cos, sin = math.cos(angle), math.sin(angle)
            a, tip = (x, lift, -0.5), (x + reach * cos, lift + leaves.uniform(-0.1, 0.2), -0.5 + reach * sin)
            middle = [(p + q) / 2 for p, q in zip(a, tip)]
            wide = 0.05
            parts.append(quad(a, (middle[0] - wide * sin, middle[1], middle[2] + wide * cos), tip, (middle[0] + wide * sin, middle[1], middle[2] - wide * cos)))
    return scene((0.9, 1.4, 3.0), (0, 0.7, -0.4), 48, *parts)


SCENES = [sunglasses, hall, coffee_maker, desk_lamp, window, chandelier, bathroom, aquarium, car, greenhouse]
# Size, CPU seconds and seeds.
SUITES = {"small": ((64, 48), [0.5, 2.0], 2), "frames": ((256, 192), [6.0], 1), "denoised": ((64, 48), [0.5, 2.0], 2)}
# Of the last one: what every renderer has, and no option with and without a denoiser.
DENOISED = """[[method]]
name = "plain, denoised"
denoise = true
sampler = "sobol"

[[method]]
name = "auto"
integrator = "auto"
resolve = "default"

[[method]]
name = "auto, denoised"
integrator = "auto"
resolve = "default"
denoise = true
"""


def suite(name, size, times, seeds):
    """The methods are those of auto.toml, or of the denoiser."""
    here = os.path.dirname(os.path.abspath(__file__))
    with open(os.path.join(here, "auto.toml")) as file:
        methods = file.read()
    methods = methods[methods.index("[[method]]") :].replace('"../', f'"{os.path.dirname(here)}/')
    baseline = "path"
    if name == "denoised":
        methods, baseline = DENOISED, "plain, denoised"
    text = f'baseline = "{baseline}"\nseeds = {seeds}\ntimes = {json.dumps(times)}\nclock = "cpu"\n'
    for make in SCENES:
        name = make.__name__
        text += f'\n[[scene]]\nname = "{name}"\nfile = "{name}.pbrt"\nsize = {list(size)}\nmax_vertices = 14\n'
        text += f'reference = "{name}-{size[0]}.exr"\n'
    return text + "\n" + methods


def write(folder):
    os.makedirs(folder, exist_ok=True)
    for make in SCENES:
        with open(os.path.join(folder, make.__name__ + ".pbrt"), "w") as file:
            file.write(make())
    for name, (size, times, seeds) in SUITES.items():
        with open(os.path.join(folder, name + ".toml"), "w") as file:
            file.write(suite(name, size, times, seeds))


def references(folder, program, samples):
    for size in dict.fromkeys(size for size, _, _ in SUITES.values()):
        for make in SCENES:
            name = make.__name__
            out = os.path.join(folder, f"{name}-{size[0]}.exr")
            # A small frame has the same noise as a large one with a sixteenth of the samples.
            spp = samples * (16 if size[0] == 64 else 1)
            command = [program, "render", os.path.join(folder, name + ".pbrt"), "--integrator", "vcm", "--resolve", "raw", "--seed", "1000"]
            command += ["--size", f"{size[0]}x{size[1]}", "--spp", str(spp), "--max-vertices", "14", "--stats", out + ".json", "--progress", "none", "-o", out]
            subprocess.run(command, check=True, capture_output=True)
            with open(out + ".json") as file:
                print(name, size, f"average error {json.load(file)['mean_relative_error']:.4f}", flush=True)


def main(usage):
    match sys.argv[1:]:
        case ["scenes", folder]:
            write(folder)
        case ["references", folder, *rest]:
            references(folder, rest[0] if rest else "target/release/opsr", int(rest[1]) if len(rest) > 1 else 128)
        case _:
            sys.exit(usage)


if __name__ == "__main__":
    main(__doc__)
