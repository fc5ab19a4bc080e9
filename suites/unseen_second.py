#!/usr/bin/env python3
"""Ten scenes of other kinds than those of unseen.py, made after the choice of the integrator and blurs was tuned.

    python3 suites/unseen_second.py scenes second
    python3 suites/unseen_second.py references second [OPSR] [SAMPLES]
"""

import math
import random

import unseen
from unseen import (
    arc, ball, box, cup, diffuse, floor, glass, gloss, inside, lamp, mesh, metal, quad, ring, room, scene, sky, sun, turned,
)


def point(where, r, g, b):
    return 'LightSource "point" "point3 from" [{} {} {}] "rgb I" [{} {} {}]\n'.format(*where, r, g, b)


def translucent(r, t):
    return f'Material "diffusetransmission" "rgb reflectance" [{r} {r} {r}] "rgb transmittance" [{t} {t} {t}]\n'


def brilliant(centre, radius, sides=8):
    """A cut stone of flat facets: table, crown, girdle, pavilion."""
    def row(r, h, shift):
        angles = [2 * math.pi * (i + shift) / sides for i in range(sides)]
        return [(centre[0] + r * radius * math.cos(a), centre[1] + h * radius, centre[2] - r * radius * math.sin(a)) for a in angles]

    rows = [row(0.0, 0.0, 0), row(1.0, 0.86, 0), row(1.0, 0.9, 0), row(0.55, 1.2, 0.5), row(0.0, 1.2, 0)]
    faces = []
    for low, high in zip(rows, rows[1:]):
        for i in range(sides):
            j = (i + 1) % sides
            faces += [(low[i], low[j], high[j]), (low[i], high[j], high[i])]
    flat = [corner for face in faces for corner in face]
    return mesh(flat, [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(len(faces)) if len(set(faces[i])) == 3])


def jeweller():
    parts = [room((-0.5, 0, -0.4), (0.5, 0.6, 0.6), diffuse(0.12, 0.1, 0.14)), diffuse(0.02, 0.02, 0.03), box((-0.2, 0, -0.15), (0.2, 0.03, 0.15))]
    parts += [point((x, 0.5, z), *(3 * [0.25])) for x, z in ((-0.3, 0.2), (0.25, 0.3), (0.0, -0.2))]
    parts += [glass(2.42)] + [brilliant((x, 0.03, z), 0.018) for x, z in ((-0.05, 0.02), (0.0, 0.06), (0.05, 0.0))]
    parts += [inside("ruby", (5, 180, 140), glass(1.76), brilliant((0.0, 0.03, -0.03), 0.024, 6))]
    parts += [metal(0.95, 0.76, 0.42, 0.05), ring((-0.1, 0.033, 0.06), 0.02, 0.0025), ring((0.11, 0.035, 0.05), 0.018, 0.0035)]
    return scene((0.08, 0.2, 0.32), (0, 0.04, 0.01), 38, *parts)


def swimming_hall():
    parts = [room((-5, -1.5, -4), (5, 4, 6), diffuse(0.75, 0.78, 0.8)), diffuse(0.6, 0.58, 0.5)]
    parts += [box((-5, -1.5, -4), (-3, 0.1, 6)), box((3, -1.5, -4), (5, 0.1, 6)), box((-3, -1.5, -4), (3, 0.1, -3))]
    parts += [lamp(30, 30, 28, quad((x - 0.6, 3.9, z), (x + 0.6, 3.9, z), (x + 0.6, 3.9, z + 0.3), (x - 0.6, 3.9, z + 0.3))) for x in (-2, 2) for z in (-2, 2)]
    count = 40
    points, faces = [], []
    for j in range(count + 1):
        for i in range(count + 1):
            x, z = -3 + 6 * i / count, -3 + 9 * j / count
            points.append((x, 0.03 * math.sin(3.1 * x + 1.3 * z) + 0.02 * math.sin(2.3 * z - 1.7 * x + 1), z))
    for j in range(count):
        for i in range(count):
            a = j * (count + 1) + i
            faces += [(a, a + count + 1, a + count + 2), (a, a + count + 2, a + 1)]
    parts += [inside("pool", (0.25, 0.05, 0.03), glass(1.33), mesh(points, faces))]
    parts += [metal(0.9, 0.9, 0.92, 0.08), ring((-2.4, 0.5, 0), 0.35, 0.03, "z"), gloss(0.8, 0.2, 0.1), ball((1.2, -0.05, 0.5), 0.25)]
    return scene((1.5, 2.0, 5.5), (-0.5, 0.2, -1), 55, *parts)


def chapel():
    parts = [sky(0.5, 0.6, 0.8), sun((3, 2.4, 0.8), 60, 55, 45), room((-3, 0, -4), (3, 5, 4), diffuse(0.55, 0.52, 0.48), 1), diffuse(0.5, 0.48, 0.44)]
    parts += [box((2.9, 0, -4), (3.2, 1, 4)), box((2.9, 3.6, -4), (3.2, 5, 4))]
    parts += [box((2.9, 1, z), (3.2, 3.6, z + 1.2)) for z in (-4, -1.6, 0.4, 2.8)]
    colours = [(1, 12, 14), (14, 3, 1), (2, 9, 14), (12, 10, 1), (3, 3, 14), (9, 1, 8)]
    for k, (z, width) in enumerate([(-2.8, 1.2), (-0.4, 0.8), (1.6, 1.2)]):
        for i in range(3):
            low = 1 + 2.6 * i / 3
            tint = [18 * x for x in colours[(2 * k + i) % 6]]
            parts.append(inside(f"stain{k}{i}", tint, glass(), box((3.0, low + 0.01, z + 0.01), (3.01, low + 2.6 / 3 - 0.01, z + width - 0.01))))
    parts += [diffuse(0.3, 0.2, 0.12)] + [box((-2.4, 0, z), (0.8, 0.5, z + 0.4)) for z in (-2.5, -1, 0.5, 2)]
    return scene((1.6, 1.7, 3.7), (-0.8, 1.2, -1.5), 62, *parts)


def bottles():
    parts = [room((-1, 0, -0.7), (1, 1.4, 1.6), diffuse(0.7, 0.66, 0.6)), lamp(16, 15, 14, quad((-0.6, 0.2, -0.69), (0.6, 0.2, -0.69), (0.6, 0.9, -0.69), (-0.6, 0.9, -0.69)))]
    parts += [lamp(40, 36, 30, quad((-0.15, 1.39, 0.3), (0.15, 1.39, 0.3), (0.15, 1.39, 0.6), (-0.15, 1.39, 0.6))), gloss(0.35, 0.2, 0.1, 0.15), box((-0.8, 0, -0.4), (0.8, 0.04, 0.5))]
    outside = [(0, 0.0), (0.036, 0.0), (0.04, 0.006), (0.04, 0.17), (0.034, 0.195), (0.014, 0.225), (0.014, 0.29)]
    within = [(0.011, 0.29), (0.011, 0.226), (0.031, 0.194), (0.037, 0.169), (0.037, 0.008), (0, 0.008)]
    for i, (x, z, fill, tint) in enumerate([(-0.16, 0.0, 0.16, (8, 40, 90)), (0.0, -0.06, 0.1, (70, 12, 30)), (0.15, 0.03, 0.15, (6, 9, 60))]):
        parts += [glass(1.52), turned(outside + within, (x, 0.0401, z)), inside(f"drink{i}", tint, glass(1.34), turned([(0, 0.0085), (0.0365, 0.0085), (0.0365, fill), (0, fill)], (x, 0.0401, z)))]
    parts += [metal(0.9, 0.9, 0.9, 0.12), turned([(0.05, 0.0401), (0.06, 0.0401), (0.06, 0.06), (0.055, 0.06), (0.05, 0.045)], (0.0, 0, 0.16))]
    return scene((0.12, 0.28, 0.75), (0, 0.13, -0.02), 36, *parts)


def headlight():
    parts = [room((-2, 0, -2), (2, 2.5, 3), diffuse(0.6, 0.6, 0.62)), gloss(0.3, 0.31, 0.33, 0.1), box((-1.9, 0, -1.9), (1.9, 0.02, 2.9))]
    bowl = [(0.02 * i, -0.25 + (0.02 * i) ** 2 / 0.2) for i in range(1, 11)]
    parts += [metal(0.92, 0.92, 0.92), turned(bowl, (-0.6, 0.8, 0.9), 48, "z"), diffuse(0.05), turned([(r + 0.004, h - 0.004) for r, h in reversed(bowl)], (-0.6, 0.8, 0.9), 48, "z")]
    parts += [lamp(900, 860, 700, ball((-0.6, 0.8, 0.7), 0.012, 16)), glass(), turned(arc(0.2, -90, 90, 20, flat=0.12), (-0.6, 0.8, 0.99), 48, "z")]
    parts += [diffuse(0.7, 0.3, 0.2), box((-0.5, 0.02, 1.9), (0.1, 0.5, 2.1), 0.3), glass(), ball((-0.45, 0.62, 2.0), 0.12), diffuse(0.4), box((-0.7, 0.02, 0.6), (-0.5, 0.6, 0.8))]
    return scene((1.7, 1.5, 0.2), (-0.6, 0.6, 1.6), 60, *parts)


def kitchen():
    parts = [sky(1.0, 1.1, 1.3), room((-1.5, 0, -0.6), (1.5, 2.4, 2.6), diffuse(0.8, 0.78, 0.74), 0), gloss(0.08, 0.08, 0.09, 0.12), box((-1.5, 0.86, -0.6), (1.5, 0.9, 0.05))]
    parts += [diffuse(0.75), box((-1.5, 0, -0.6), (1.5, 0.86, 0.0)), box((-0.9, 1.5, -0.6), (0.9, 2.1, -0.25))]
    parts += [lamp(20, 18, 14, quad((-0.8, 1.495, -0.45), (0.8, 1.495, -0.45), (0.8, 1.495, -0.42), (-0.8, 1.495, -0.42)))]
    parts += [metal(0.8, 0.79, 0.78, 0.2), turned([(0.0, 0.9), (0.12, 0.9), (0.13, 0.92), (0.13, 1.02), (0.127, 1.02), (0.127, 0.92), (0.118, 0.905), (0, 0.905)], (-0.3, 0, -0.25)), box((-0.17, 1.0, -0.26), (0.0, 1.012, -0.24))]
    bowl = [(0, 0.9), (0.032, 0.9), (0.03, 0.904), (0.004, 0.91), (0.004, 0.97), (0.03, 0.99), (0.04, 1.03), (0.033, 1.08), (0.0315, 1.08), (0.038, 1.03), (0.028, 0.993), (0, 0.975)]
    parts += [glass(), turned(bowl, (0.25, 0, -0.15)), turned(bowl, (0.38, 0, -0.25)), gloss(0.85, 0.85, 0.82), cup((0.0, 0.9, -0.1), 0.045, 0.08, 0.004), gloss(0.8, 0.55, 0.05, 0.2), ball((0.55, 0.94, -0.2), 0.04)]
    return scene((0.35, 1.3, 1.0), (0.05, 0.98, -0.3), 44, *parts)


def snow_globe():
    flakes = random.Random(9)
    parts = [sky(0.5, 0.55, 0.65), sun((-2, 3, 1.5), 9, 8.5, 7.5), gloss(0.5, 0.36, 0.24, 0.1), floor(0, 3), gloss(0.25, 0.05, 0.05), turned([(0.075, 0), (0.075, 0.02), (0.06, 0.035), (0, 0.035)])]
    parts += [glass(), ball((0, 0.1, 0), 0.08), inside("globe", (0.6, 0.2, 0.15), glass(1.33), ball((0, 0.1, 0), 0.075))]
    parts += [diffuse(0.9), turned([(0.0, 0.045), (0.055, 0.055), (0.03, 0.068), (0, 0.07)]), diffuse(0.7, 0.2, 0.15), box((-0.018, 0.06, -0.014), (0.018, 0.095, 0.014), 0.5), diffuse(0.12, 0.3, 0.12), turned([(0.016, 0.07), (0, 0.13)], (0.028, 0, 0.01), 12)]
    parts.append(diffuse(0.95))
    for _ in range(60):
        r, a, h = 0.068 * flakes.random() ** 0.5, flakes.uniform(0, 6.28), flakes.uniform(0.08, 0.15)
        r = min(r, math.sqrt(max(0.07**2 - (h - 0.1) ** 2, 0)))
        parts.append(ball((r * math.cos(a), h, r * math.sin(a)), 0.0012, 6))
    return scene((0.1, 0.17, 0.36), (0, 0.085, 0), 34, *parts)


def mirror_room():
    parts = [room((-2, 0, -2), (2, 2.6, 3), diffuse(0.7, 0.6, 0.52)), metal(0.95, 0.95, 0.95), box((-0.9, 0.4, -1.99), (0.9, 2.2, -1.97))]
    parts += [diffuse(0.2), box((-0.3, 1.6, 0.7), (0.3, 2.0, 0.75)), lamp(70, 64, 52, quad((-0.25, 1.65, 0.69), (-0.25, 1.95, 0.69), (0.25, 1.95, 0.69), (0.25, 1.65, 0.69)))]
    parts += [gloss(0.2, 0.3, 0.5, 0.05), ball((0.8, 0.35, -0.4), 0.35), metal(0.95, 0.8, 0.5, 0.1), ball((-0.8, 0.3, 0.1), 0.3), glass(), ball((0.0, 0.25, 0.4), 0.25), gloss(0.4, 0.3, 0.22, 0.15), box((-1.9, 0, -1.9), (1.9, 0.005, 2.9))]
    return scene((1.2, 1.5, 2.8), (-0.1, 0.8, -0.8), 58, *parts)


def lampshade():
    parts = [room((-1.2, 0, -0.8), (1.2, 2.2, 2), diffuse(0.75, 0.7, 0.62)), gloss(0.4, 0.24, 0.14, 0.1), box((-0.9, 0.68, -0.6), (0.9, 0.72, 0.4))]
    parts += [translucent(0.3, 0.45), turned([(0.16, 1.05), (0.09, 1.3)], (-0.25, 0, -0.1)), lamp(140, 110, 70, ball((-0.25, 1.15, -0.1), 0.03, 24)), metal(0.85, 0.7, 0.4, 0.1)]
    parts += [turned([(0.07, 0.72), (0.07, 0.735), (0.01, 0.75), (0.01, 1.1), (0, 1.1)], (-0.25, 0, -0.1)), glass(1.5, 0.2), turned([(0, 0.721), (0.04, 0.721), (0.045, 0.86), (0.04, 0.86), (0.036, 0.73), (0, 0.73)], (0.08, 0, 0.1))]
    parts += [glass(), ball((0.3, 0.78, 0.05), 0.06), gloss(0.15, 0.3, 0.5), cup((0.2, 0.72, -0.25), 0.05, 0.1, 0.004)]
    return scene((0.35, 1.15, 1.2), (0, 0.9, -0.05), 44, *parts)


def facade():
    parts = [sky(0.6, 0.75, 1.0), sun((1.5, 2.2, 3.0), 18, 16.5, 14), diffuse(0.22, 0.22, 0.23), floor(0, 300), diffuse(0.5, 0.48, 0.45), box((-12, 0, -14), (12, 26, -6.05))]
    parts += [metal(0.75, 0.82, 0.85)]
    for row in range(6):
        for column in range(6):
            x, y, lean = -11.2 + 3.8 * column, 1.5 + 4.1 * row, 0.015 * ((row * 7 + column * 3) % 5 - 2)
            parts.append(quad((x, y, -6 + lean), (x + 3.3, y, -6 - lean), (x + 3.3, y + 3.4, -6 - lean), (x, y + 3.4, -6 + lean)))
    parts += [diffuse(0.55, 0.3, 0.22), box((-20, 0, 4), (-13, 9, 14)), gloss(0.1, 0.2, 0.5, 0.02), box((2, 0.4, 1), (6, 1.1, 2.8)), box((2.8, 1.1, 1.1), (5.2, 1.7, 2.7)), diffuse(0.15, 0.3, 0.08)]
    parts += [ball((x, 2.2, z), 1.3, 16) for x, z in ((-8, 1), (-3, 0.5), (9, -2))] + [diffuse(0.3, 0.2, 0.1)] + [box((x - 0.15, 0, z - 0.15), (x + 0.15, 1.2, z + 0.15)) for x, z in ((-8, 1), (-3, 0.5), (9, -2))]
    return scene((12, 4.5, 20), (-1, 5, -2), 50, *parts)


unseen.SCENES = [jeweller, swimming_hall, chapel, bottles, headlight, kitchen, snow_globe, mirror_room, lampshade, facade]

if __name__ == "__main__":
    unseen.main(__doc__)
