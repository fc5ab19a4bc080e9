#!/usr/bin/env python3
"""Twelve more scenes, made as held-out ones after the choice between photons and paths for mirrors was set.

    python3 suites/unseen_third.py scenes third
    python3 suites/unseen_third.py references third [OPSR] [SAMPLES]
"""

import math
import random

import unseen
from unseen import (
    arc, ball, box, cup, diffuse, floor, glass, gloss, inside, lamp, mesh, metal, quad, ring, room, scene, sky, sun, turned,
)
from unseen_second import point


def spot(where, to, cone, delta, r, g, b):
    return 'LightSource "spot" "point3 from" [{} {} {}] "point3 to" [{} {} {}] "float coneangle" [{}] "float conedeltaangle" [{}] "rgb I" [{} {} {}]\n'.format(*where, *to, cone, delta, r, g, b)


def leaf_green(r, t):
    return f'Material "diffusetransmission" "rgb reflectance" [{0.35 * r} {r} {0.2 * r}] "rgb transmittance" [{0.45 * t} {t} {0.12 * t}]\n'


def placed(where, turns, *parts):
    """Parts moved, after turns of (degrees, axis)."""
    text = "AttributeBegin\nTranslate {} {} {}\n".format(*where)
    return text + "".join("Rotate {} {} {} {}\n".format(a, *axis) for a, axis in turns) + "".join(parts) + "AttributeEnd\n"


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    length = math.sqrt(sum(x * x for x in a))
    return tuple(x / length for x in a) if length > 1e-14 else None


def surface(f, us, vs, spare=(0, 1, 0)):
    """A smooth mesh of f(u, v); its normals are those of du × dv."""
    points, normals, faces, e = [], [], [], 1e-4
    for u in us:
        for v in vs:
            du = [a - b for a, b in zip(f(u + e, v), f(u - e, v))]
            dv = [a - b for a, b in zip(f(u, v + e), f(u, v - e))]
            points.append(f(u, v))
            normals.append(unit(cross(du, dv)) or spare)
    row = len(vs)
    for i in range(len(us) - 1):
        for j in range(row - 1):
            a = i * row + j
            faces += [(a, a + row, a + row + 1), (a, a + row + 1, a + 1)]
    return mesh(points, faces, normals)


def steps(low, high, count):
    return [low + (high - low) * i / count for i in range(count + 1)]


def tube(path, radius, side=(1, 0, 0), segments=20):
    points, normals, faces = [], [], []
    for i, c in enumerate(path):
        t = unit([a - b for a, b in zip(path[min(i + 1, len(path) - 1)], path[max(i - 1, 0)])])
        b = unit(cross(side, t))
        n = cross(t, b)
        for k in range(segments + 1):
            a = 2 * math.pi * k / segments
            normal = tuple(math.cos(a) * p + math.sin(a) * q for p, q in zip(n, b))
            normals.append(normal)
            points.append(tuple(p + radius * q for p, q in zip(c, normal)))
    row = segments + 1
    for i in range(len(path) - 1):
        for k in range(segments):
            a = i * row + k
            faces += [(a, a + row, a + row + 1), (a, a + row + 1, a + 1)]
    return mesh(points, faces, normals)


def hollow(low, high, wall):
    """A closed box of glass with air within: the inner faces point into the cavity."""
    a, b = [x + wall for x in low], [x - wall for x in high]
    corners = [tuple((a, b)[i >> axis & 1][axis] for axis in range(3)) for i in range(8)]
    sides = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    return box(low, high) + mesh(corners, [face for p, q, r, s in sides for face in ((p, r, q), (p, s, r))])


def faceted(profile, centre, sides):
    """A turned body of flat facets."""
    points, faces = [], []
    for (r, h), (s, g) in zip(profile, profile[1:]):
        for k in range(sides):
            low, high = 2 * math.pi * k / sides, 2 * math.pi * (k + 1) / sides
            a, b = (r * math.cos(low), h, -r * math.sin(low)), (r * math.cos(high), h, -r * math.sin(high))
            c, d = (s * math.cos(high), g, -s * math.sin(high)), (s * math.cos(low), g, -s * math.sin(low))
            for face in ((a, b, c), (a, c, d)):
                if len(set(face)) == 3:
                    faces.append(tuple(range(len(points), len(points) + 3)))
                    points += [tuple(x + y for x, y in zip(centre, p)) for p in face]
    return mesh(points, faces)


def tumbled(x, z, rest, half, angles):
    """A box turned about all axes that stands on one corner at height rest."""
    points = []
    for i in range(8):
        p = [half[k] * (1 if i >> k & 1 else -1) for k in range(3)]
        for axis, angle in enumerate(angles):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            c, s = math.cos(angle), math.sin(angle)
            p[a], p[b] = c * p[a] - s * p[b], s * p[a] + c * p[b]
        points.append(p)
    lift = rest - min(p[1] for p in points)
    sides = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    return mesh([(x + p[0], p[1] + lift, z + p[2]) for p in points], [f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))])


def down(x0, z0, x1, z1, y):
    return quad((x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1))


def gear(teeth, outer, root, bore, thick):
    """A spur gear about the y axis, from y = 0 to thick, of flat facets."""
    rim, hole = [], []
    for i in range(teeth):
        for part, r in ((0.0, root), (0.28, root), (0.42, outer), (0.68, outer), (0.82, root)):
            a = 2 * math.pi * (i + part) / teeth
            rim.append((r * math.cos(a), -r * math.sin(a)))
            hole.append((bore * math.cos(a), -bore * math.sin(a)))
    n = len(rim)
    points = [(x, y, z) for loop in (rim, hole) for y in (0, thick) for x, z in loop]
    low, high, inner, upper, faces = 0, n, 2 * n, 3 * n, []
    for i in range(n):
        j = (i + 1) % n
        for a, b, c, d in ((low + i, low + j, high + j, high + i), (inner + j, inner + i, upper + i, upper + j), (high + i, high + j, upper + j, upper + i), (low + j, low + i, inner + i, inner + j)):
            faces += [(a, b, c), (a, c, d)]
    return mesh(points, faces)


def courtyard():
    stones = random.Random(31)
    parts = [sky(0.6, 0.75, 1.0), sun((2.2, 3.4, 2.6), 10, 9.2, 7.8), diffuse(0.2, 0.18, 0.16), floor(-0.02, 30)]
    for i in range(-6, 6):
        for j in range(-6, 8):
            tone, h = stones.uniform(0.32, 0.5), stones.uniform(-0.005, 0.003)
            parts += [diffuse(tone, 0.95 * tone, 0.87 * tone), box((0.75 * i, -0.1, 0.75 * j), (0.75 * i + 0.735, h, 0.75 * j + 0.735))]
    parts += [diffuse(0.62, 0.52, 0.4), box((-4.3, 0, -3.9), (-4, 2.9, 5)), box((4, 0, -3.9), (4.3, 2.9, 5)), box((-4.3, 0, -4.2), (-0.5, 2.9, -3.9)), box((0.6, 0, -4.2), (4.3, 2.9, -3.9)), box((-0.5, 2.2, -4.2), (0.6, 2.9, -3.9))]
    parts += [diffuse(0.5, 0.48, 0.45), box((-4.35, 2.9, -3.85), (-3.95, 3.0, 5)), box((3.95, 2.9, -3.85), (4.35, 3.0, 5)), box((-4.35, 2.9, -4.25), (4.35, 3.0, -3.85)), box((-0.8, 0, -0.8), (0.8, 0.35, 0.8), 0.3)]
    parts += [diffuse(0.16, 0.24, 0.2), box((-0.48, 0, -4.15), (0.58, 2.19, -4.1)), diffuse(0.45, 0.42, 0.38), box((-3.7, 0.38, -2.6), (-3.2, 0.48, -0.4)), box((-3.65, 0, -2.4), (-3.25, 0.38, -2.2)), box((-3.65, 0, -0.8), (-3.25, 0.38, -0.6))]

    def column(h, angle):
        r = (0.3 - 0.05 * h) * (1 + 0.16 * math.cos(3 * (angle - 1.5 * h)))
        return (r * math.cos(angle), 0.35 + h, -r * math.sin(angle))

    parts += [metal(0.93, 0.93, 0.94), surface(lambda a, h: column(h, a), steps(0, 2 * math.pi, 90), steps(0, 1.9, 70)), ball((0, 2.42, 0), 0.24)]
    parts += [ball((1.55, 0.45, 1.0), 0.45), ball((0.75, 0.22, 1.75), 0.22), ball((-2.2, 0.6, -1.9), 0.6), placed((-1.65, 0.7, 0.75), [(35, (0, 1, 0)), (-8, (1, 0, 0))], ring((0, 0, 0), 0.62, 0.08, "z", 96))]
    return scene((1.6, 1.75, 6.2), (-0.1, 1.0, 0), 46, *parts)


def vanity():
    parts = [room((-1.2, 0, -0.9), (1.2, 2.4, 1.7), diffuse(0.58, 0.64, 0.62)), gloss(0.3, 0.3, 0.32, 0.1), box((-1.2, 0, -0.9), (1.2, 0.01, 1.7))]
    parts += [gloss(0.3, 0.2, 0.13, 0.15), box((-0.72, 0.1, -0.9), (0.72, 0.8, -0.42)), gloss(0.8, 0.78, 0.75, 0.06), box((-0.76, 0.8, -0.9), (0.76, 0.84, -0.38))]
    parts += [metal(0.95, 0.95, 0.95), box((-0.45, 1.15, -0.9), (0.45, 1.85, -0.885)), diffuse(0.12, 0.09, 0.07)]
    parts += [box((-0.47, 1.13, -0.9), (0.47, 1.15, -0.875)), box((-0.47, 1.85, -0.9), (0.47, 1.87, -0.875)), box((-0.47, 1.15, -0.9), (-0.45, 1.85, -0.875)), box((0.45, 1.15, -0.9), (0.47, 1.85, -0.875))]
    for x in (-0.58, 0.58):
        parts += [metal(0.9, 0.72, 0.42, 0.1), box((x - 0.05, 1.15, -0.9), (x + 0.05, 1.85, -0.89))]
        for y in (1.25, 1.5, 1.75):
            parts += [gloss(0.8, 0.8, 0.78), placed((x, y, -0.89), [(90, (1, 0, 0))], turned([(0.024, 0.0), (0.018, 0.04), (0, 0.042)], (0, 0, 0), 24)), point((x, y, -0.82), 0.32, 0.27, 0.2)]
    parts += [lamp(150, 125, 90, ball((x, 2.02, -0.78), 0.025, 24)) for x in (-0.2, 0.2)] + [metal(0.9, 0.72, 0.42, 0.1), box((-0.26, 2.055, -0.9), (0.26, 2.075, -0.76))]
    parts += [gloss(0.86, 0.86, 0.85, 0.03), cup((0, 0.841, -0.62), 0.2, 0.13, 0.012), metal(0.9, 0.9, 0.92), turned([(0.028, 0.84), (0.026, 0.85), (0.014, 0.855)], (0, 0, -0.845), 32)]
    bend = [(0, 0.845, -0.845), (0, 0.95, -0.845), (0, 1.04, -0.845)] + [(0, 1.04 + 0.055 * math.sin(a), -0.79 - 0.055 * math.cos(a)) for a in steps(0.2, math.pi, 14)] + [(0, 1.015, -0.735)]
    parts += [tube(bend, 0.012), tube([(0.0, 0.93, -0.845), (0.06, 0.945, -0.845)], 0.006, (0, 0, 1)), ball((0.06, 0.945, -0.845), 0.009, 24)]
    for x, z, r, h, colour in ((-0.42, -0.6, 0.045, 0.09, (0.75, 0.35, 0.3)), (-0.55, -0.72, 0.04, 0.14, (0.8, 0.77, 0.68)), (-0.33, -0.5, 0.03, 0.05, (0.25, 0.4, 0.5)), (0.58, -0.58, 0.05, 0.07, (0.82, 0.8, 0.76))):
        parts += [gloss(*colour, 0.08), turned([(r, 0.84), (r, 0.84 + h), (0.8 * r, 0.85 + h)], (x, 0, z)), metal(0.92, 0.78, 0.5, 0.12), turned([(0.85 * r, 0.845 + h), (0.85 * r, 0.865 + h), (0, 0.868 + h)], (x, 0, z))]
    parts += [gloss(0.2, 0.25, 0.3), cup((0.4, 0.84, -0.7), 0.035, 0.1, 0.004), diffuse(0.7, 0.2, 0.25), placed((0.4, 0.85, -0.7), [(12, (0, 0, 1))], box((-0.004, 0, -0.006), (0.004, 0.19, 0.006))), diffuse(0.25, 0.55, 0.6), placed((0.41, 0.85, -0.69), [(-14, (1, 0, 0))], box((-0.004, 0, -0.006), (0.004, 0.18, 0.006)))]
    parts += [diffuse(0.75, 0.72, 0.66), box((-1.19, 0.9, 0.1), (-1.16, 1.45, 0.6)), metal(0.9, 0.9, 0.92), tube([(-1.15, 1.46, 0.0), (-1.15, 1.46, 0.7)], 0.01), diffuse(0.45, 0.3, 0.2), box((-0.2, 0, 1.67), (0.6, 2.05, 1.7)), diffuse(0.8, 0.78, 0.7), box((0.25, 0.84, -0.5), (0.36, 0.87, -0.42), 0.3)]
    return scene((0.42, 1.5, 0.95), (-0.02, 1.2, -0.7), 56, *parts)


def solar():
    parts = [sky(0.55, 0.7, 1.0), sun((-1.4, 2.2, 0.7), 12, 11.2, 9.6), diffuse(0.52, 0.42, 0.3), floor(0, 200)]
    parts += [diffuse(0.6, 0.54, 0.45), box((-9, 0, -5.3), (9, 0.75, -5.0)), box((-9.05, 0.75, -5.35), (9.05, 0.83, -4.95)), diffuse(0.3, 0.32, 0.22), box((-60, 0, -80), (60, 4, -70))]
    for x, z in ((0.0, 0.0), (4.2, -1.6)):
        trough = [metal(0.94, 0.94, 0.95), surface(lambda z, x: (x, x * x / 3.4, z), steps(-1.6, 1.6, 2), steps(-1.15, 1.15, 64))]
        trough += [gloss(0.5, 0.52, 0.55, 0.1), surface(lambda x, z: (x, x * x / 3.4 - 0.03, z), steps(-1.15, 1.15, 64), steps(-1.6, 1.6, 2))]
        trough += [gloss(0.03, 0.03, 0.035, 0.1), tube([(0, 0.85, -1.85), (0, 0.85, 1.85)], 0.05, (1, 0, 0), 40), metal(0.7, 0.7, 0.72, 0.2)] + [box((-0.012, 0.0, k - 0.015), (0.012, 0.81, k + 0.015)) for k in (-1.55, 0, 1.55)]
        parts += [placed((x, 1.35, z), [(32.47, (0, 0, 1))], *trough), gloss(0.25, 0.3, 0.33, 0.15)] + [box((x - 0.07, 0, z + k - 0.05), (x + 0.07, 1.27, z + k + 0.05)) for k in (-1.45, 1.45)]
        parts += [diffuse(0.5)] + [box((x - 0.3, 0, z + k - 0.25), (x + 0.3, 0.1, z + k + 0.25)) for k in (-1.45, 1.45)]
    parts += [diffuse(0.5, 0.33, 0.18), box((-2.6, 0, -1.6), (-2.0, 0.5, -1.1), 0.4), metal(0.8, 0.8, 0.82, 0.15), turned([(0.22, 0), (0.22, 0.6), (0, 0.62)], (-2.9, 0, -2.6)), gloss(0.12, 0.25, 0.5), turned([(0.25, 0), (0.25, 0.7), (0, 0.72)], (-3.4, 0, -3.4))]
    return scene((-1.3, 1.3, 3.7), (0.0, 1.62, 0), 50, *parts)


def street():
    goods = random.Random(12)
    parts = [sky(0.012, 0.015, 0.028), gloss(0.05, 0.05, 0.055, 0.03), quad((-3, 0, -40), (-3, 0, 12), (3, 0, 12), (3, 0, -40))]
    parts += [diffuse(0.28), box((-5, -0.2, -40), (-3, 0.12, 12)), box((3, -0.2, -40), (5, 0.12, 12)), diffuse(0.36, 0.2, 0.15), box((-9, 0, -2), (-5, 9, 12)), box((-9, 0, -40), (-5, 11, -9)), box((-9, 3.1, -9), (-5, 8, -2)), box((-5.2, 0.12, -9), (-5, 0.6, -2)), box((-5.2, 0.6, -9), (-5, 3.1, -8.2)), box((-5.2, 0.6, -2.7), (-5, 3.1, -2)), box((-5.2, 2.7, -8.2), (-5, 3.1, -2.7))]
    parts += [diffuse(0.34, 0.31, 0.27), box((5, 0, -14), (9, 10, 12)), diffuse(0.3, 0.26, 0.25), box((5, 0, -40), (9, 8, -14)), box((-9, 0, -46), (9, 9, -40)), room((-8, 0.13, -9), (-5.2, 3.05, -2), diffuse(0.78, 0.7, 0.58), 1)]
    parts += [lamp(26, 23, 17, down(-7.6, z, -5.6, z + 0.12, 3.04)) for z in (-7.4, -5.5, -3.6)] + [diffuse(0.5, 0.34, 0.2)] + [box((-7.9, y, -8.8), (-7.5, y + 0.03, -2.2)) for y in (0.9, 1.5, 2.1)] + [box((-6.1, 0.13, -7.9), (-5.5, 0.8, -3.0))]
    for i in range(26):
        z, y, h = -8.5 + 0.75 * (i % 9) + goods.uniform(0, 0.2), (0.93, 1.53, 2.13)[i // 9], goods.uniform(0.2, 0.45)
        parts += [gloss(goods.uniform(0.1, 0.8), goods.uniform(0.1, 0.6), goods.uniform(0.1, 0.6), 0.1), box((-7.8, y, z), (-7.6, y + h, z + goods.uniform(0.15, 0.4)))]
    parts += [gloss(0.7, 0.15, 0.12)] + [turned([(0.12, 0.8), (0.16, 1.0), (0.05, 1.2), (0.07, 1.3)], (-5.8, 0, z), 24) for z in (-7.2, -5.4, -3.6)]
    for side, z in ((-1, 1.5), (1, -4.5), (-1, -11.5), (1, -18.5)):
        x = 3.5 * side
        parts += [gloss(0.06, 0.08, 0.07, 0.1), tube([(x, 0.1, z), (x, 4.95, z)], 0.06, (1, 0, 0), 12), box((min(x, x - 1.3 * side), 4.93, z - 0.04), (max(x, x - 1.3 * side), 5.0, z + 0.04)), box((x - 1.2 * side - 0.24, 4.83, z - 0.15), (x - 1.2 * side + 0.24, 4.93, z + 0.15)), lamp(620, 500, 310, down(x - 1.2 * side - 0.2, z - 0.12, x - 1.2 * side + 0.2, z + 0.12, 4.825))]
    for x, z, turn, colour in ((1.9, -6.5, 90, (0.5, 0.03, 0.03)), (1.9, -13.5, 90, (0.6, 0.6, 0.62)), (-1.4, -14.0, -90, (0.04, 0.1, 0.3))):
        car = [gloss(*colour, 0.02), box((-2.1, 0.3, -0.85), (2.1, 0.85, 0.85)), gloss(0.02, 0.02, 0.025, 0.01), box((-1.3, 0.85, -0.75), (0.9, 1.38, 0.75)), gloss(*colour, 0.02), box((-1.35, 1.38, -0.78), (0.95, 1.42, 0.78)), diffuse(0.03)]
        car += [turned([(0.0, -0.1), (0.31, -0.1), (0.31, 0.1), (0.0, 0.1)], (u, 0.31, w), 24, "z") for u in (-1.3, 1.3) for w in (-0.8, 0.8)]
        car += [lamp(6, 0.3, 0.2, quad((-2.105, 0.62, w), (-2.105, 0.62, w + 0.2), (-2.105, 0.74, w + 0.2), (-2.105, 0.74, w))) for w in (-0.8, 0.6)] + ([lamp(90, 85, 75, quad((2.105, 0.56, w + 0.2), (2.105, 0.56, w), (2.105, 0.7, w), (2.105, 0.7, w + 0.2))) for w in (-0.8, 0.6)] if turn < 0 else [])
        parts.append(placed((x, 0, z), [(turn, (0, 1, 0))], *car))
    return scene((1.7, 1.7, 1.9), (-1.7, 1.45, -6), 60, *parts)


def gallery():
    paint = random.Random(77)

    def picture(width, height, base):
        w, h = width / 2, height / 2
        text = diffuse(*base) + box((-w, -h, 0), (w, h, 0.015))
        for k in range(9):
            a, b = sorted(paint.uniform(-w + 0.02, w - 0.02) for _ in range(2))
            c, d = sorted(paint.uniform(-h + 0.02, h - 0.02) for _ in range(2))
            text += diffuse(*(paint.uniform(0.04, 0.75) for _ in range(3))) + quad((a, c, 0.016 + 0.0003 * k), (b, c, 0.016 + 0.0003 * k), (b, d, 0.016 + 0.0003 * k), (a, d, 0.016 + 0.0003 * k))
        t = 0.07
        text += metal(0.95, 0.75, 0.38, 0.15) + box((-w - t, h, 0), (w + t, h + t, 0.05)) + box((-w - t, -h - t, 0), (w + t, -h, 0.05)) + box((-w - t, -h, 0), (-w, h, 0.05)) + box((w, -h, 0), (w + t, h, 0.05))
        return text + box((-w, h - 0.012, 0), (w, h, 0.03)) + box((-w, -h, 0), (w, -h + 0.012, 0.03)) + box((-w, -h, 0), (-w + 0.012, h, 0.03)) + box((w - 0.012, -h, 0), (w, h, 0.03))

    parts = [room((-3, 0, -2.5), (3, 3.2, 3.2), diffuse(0.72, 0.7, 0.66)), gloss(0.36, 0.22, 0.12, 0.15), box((-3, 0, -2.5), (3, 0.01, 3.2)), diffuse(0.2), box((-3, 0.01, -2.5), (3, 0.12, -2.48))]
    for x, w, h, base in ((-1.7, 0.9, 1.1, (0.5, 0.45, 0.35)), (0.1, 1.3, 0.9, (0.15, 0.25, 0.4)), (1.9, 0.8, 1.0, (0.6, 0.3, 0.2))):
        parts += [placed((x, 1.6, -2.5), [], picture(w, h, base)), spot((x, 3.0, -0.7), (x, 1.55, -2.5), 24, 7, 13, 12, 10), diffuse(0.03), placed((x, 3.06, -0.66), [(-50, (1, 0, 0))], box((-0.04, -0.05, -0.02), (0.04, 0.05, 0.14)))]
    parts += [placed((-3, 1.6, -0.3), [(90, (0, 1, 0))], picture(1.2, 1.0, (0.3, 0.4, 0.3))), spot((-1.2, 3.0, -0.3), (-3, 1.55, -0.3), 24, 7, 13, 12, 10), diffuse(0.03), box((-1.17, 3.0, -0.34), (-1.05, 3.1, -0.26))]
    parts += [diffuse(0.82), box((0.45, 0, -0.45), (0.95, 0.95, 0.05)), diffuse(0.12, 0.03, 0.05), box((0.47, 0.95, -0.43), (0.93, 0.96, 0.03)), glass(), hollow((0.475, 0.9605, -0.425), (0.925, 1.5, 0.025), 0.008)]
    idol = [(0, 0.0), (0.07, 0.0), (0.07, 0.02), (0.035, 0.04), (0.03, 0.06), (0.06, 0.12), (0.065, 0.17), (0.04, 0.22), (0.05, 0.26), (0.055, 0.29), (0.02, 0.32), (0.02, 0.33), (0.035, 0.35), (0.04, 0.375), (0.03, 0.4), (0.012, 0.415), (0.0, 0.43)]
    parts += [metal(0.97, 0.74, 0.33, 0.06), turned(idol, (0.7, 0.969, -0.2)), spot((1.0, 3.1, 0.8), (0.7, 1.1, -0.2), 14, 5, 16, 15, 13), spot((0.1, 3.1, 0.6), (0.7, 1.1, -0.2), 13, 5, 9, 8.6, 8), gloss(0.1, 0.08, 0.07, 0.1), box((-1.8, 0.38, 0.1), (-0.5, 0.45, 0.55)), box((-1.7, 0, 0.15), (-1.6, 0.38, 0.5)), box((-0.7, 0, 0.15), (-0.6, 0.38, 0.5))]
    return scene((0.5, 1.55, 2.0), (0.0, 1.3, -1.0), 60, *parts)


def greenhouse():
    leaves = random.Random(8)
    parts = [sky(0.65, 0.78, 1.0), sun((1.8, 2.4, 0.9), 16, 15, 12.5), diffuse(0.22, 0.3, 0.12), floor(-0.01, 60), diffuse(0.45, 0.4, 0.33), box((-1.7, -0.1, -2.6), (1.7, 0, 1.9))]
    parts += [diffuse(0.5, 0.25, 0.17), box((-1.65, 0, -2.55), (-1.55, 0.5, 1.85)), box((1.55, 0, -2.55), (1.65, 0.5, 1.85)), box((-1.55, 0, -2.55), (1.55, 0.5, -2.45)), box((-1.55, 0, 1.75), (1.55, 0.5, 1.85))]
    bars, panes, edges = [gloss(0.78, 0.8, 0.78, 0.1)], [glass()], steps(-2.5, 1.8, 5)
    for x in (-1.6, 1.6):
        bars += [box((x - 0.02, 0.5, z - 0.02), (x + 0.02, 1.7, z + 0.02)) for z in edges] + [box((x - 0.03, 1.7, -2.53), (x + 0.03, 1.75, 1.83))]
        panes += [box((x - 0.002, 0.505, a + 0.022), (x + 0.002, 1.695, b - 0.022)) for a, b in zip(edges, edges[1:])]
        for a, b in zip(edges, edges[1:]):
            panes.append(placed((x / 2, 2.13, (a + b) / 2), [(-26.57 if x > 0 else 26.57, (0, 0, 1))], box((-0.85, -0.002, (a - b) / 2 + 0.022), (0.85, 0.002, (b - a) / 2 - 0.022))))
        bars += [placed((x / 2, 2.13, z), [(-26.57 if x > 0 else 26.57, (0, 0, 1))], box((-0.88, -0.02, -0.018), (0.88, 0.02, 0.018))) for z in edges]
    for z in (-2.5, 1.8):
        thirds = steps(-1.6, 1.6, 4)
        bars += [box((x - 0.02, 0.5, z - 0.02), (x + 0.02, 1.7, z + 0.02)) for x in thirds[1:-1]] + [box((-1.6, 1.7, z - 0.02), (1.6, 1.75, z + 0.02))]
        panes += [box((a + 0.022, 0.505, z - 0.002), (b - 0.022, 1.695, z + 0.002)) for a, b in zip(thirds, thirds[1:])]
        corner = [(-1.5, 1.76), (1.5, 1.76), (0, 2.48)]
        panes.append(mesh([(p, q, z + d) for d in (-0.002, 0.002) for p, q in corner], [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)]))
    bars.append(box((-0.03, 2.5, -2.53), (0.03, 2.56, 1.83)))
    parts += bars + panes + [diffuse(0.45, 0.32, 0.2)] + [box((s * 0.95 - 0.5, 0.68, -2.4), (s * 0.95 + 0.5, 0.72, 1.0)) for s in (-1, 1)] + [box((s * x - 0.03, 0, z - 0.03), (s * x + 0.03, 0.68, z + 0.03)) for s in (-1, 1) for x in (0.52, 1.38) for z in (-2.3, 0.9)]
    for x, z, base, tall in [(s * 0.95 + d, z, 0.72, 0.75) for s in (-1, 1) for d, z in ((-0.15, -2.0), (0.12, -1.35), (-0.12, -0.7), (0.14, 0.0), (-0.28, -1.6), (0.3, -0.35), (0.32, -1.9))] + [(-0.15, -2.1, 0.0, 1.6), (1.0, 0.65, 0.72, 0.45)]:
        parts += [gloss(0.58, 0.27, 0.16, 0.3), cup((x, base + 0.001, z), 0.13, 0.22, 0.012), diffuse(0.13, 0.09, 0.06), turned([(0.117, base + 0.19), (0, base + 0.2)], (x, 0, z), 24), diffuse(0.2, 0.32, 0.1), tube([(x, base + 0.19, z), (x + 0.02, base + 0.19 + tall, z)], 0.008, (1, 0, 0), 8)]
        points, faces = [], []
        for k in range(44):
            a, h, reach, drop = leaves.uniform(0, 6.28), base + 0.25 + (tall - 0.06) * k / 44, leaves.uniform(0.12, 0.3), leaves.uniform(-0.1, 0.12)
            cos, sin, wide = math.cos(a), math.sin(a), reach * leaves.uniform(0.16, 0.26)
            rib = [(x + reach * t * cos, h + drop * t - 0.15 * reach * t * t, z + reach * t * sin) for t in (0.05, 0.35, 0.7, 1.0)]
            sides = [(p[0] - s * wide * f * sin, p[1] + 0.25 * wide, p[2] + s * wide * f * cos) for s in (-1, 1) for p, f in zip(rib[1:3], (1.0, 0.75))]
            n = len(points)
            points += rib + sides
            faces += [(n + i, n + j, n + k) for i, j, k in ((0, 4, 1), (1, 4, 5), (1, 5, 2), (2, 5, 3), (0, 1, 6), (1, 7, 6), (1, 2, 7), (2, 3, 7))]
        parts += [leaf_green(leaves.uniform(0.22, 0.38), leaves.uniform(0.2, 0.38)), mesh(points, faces)]
    parts += [gloss(0.75, 0.08, 0.04, 0.08)] + [ball((-0.15 + 0.13 * math.cos(k), 0.55 + 0.13 * k, -2.1 + 0.13 * math.sin(k)), 0.032, 20) for k in range(8)] + [metal(0.75, 0.76, 0.78, 0.2), cup((0.25, 0.001, -0.6), 0.14, 0.26, 0.004), diffuse(0.12, 0.25, 0.08)] + [ball((leaves.uniform(-5, 5), leaves.uniform(0.1, 1.1), leaves.uniform(-7.5, -6)), leaves.uniform(0.35, 0.75), 16) for _ in range(40)]
    return scene((0.15, 1.55, 1.6), (-0.05, 0.95, -1.3), 64, *parts)


def perfume():
    parts = [room((-0.7, 0, -0.5), (0.7, 1.1, 1.0), diffuse(0.1, 0.085, 0.1)), gloss(0.06, 0.035, 0.025, 0.1), box((-0.6, 0, -0.4), (0.6, 0.02, 0.5)), lamp(42, 38, 33, down(-0.2, -0.05, 0.1, 0.15, 0.85))]
    parts += [metal(0.94, 0.94, 0.94), box((-0.2, 0.0201, -0.13), (0.2, 0.026, 0.13)), metal(0.95, 0.76, 0.42, 0.1), box((-0.206, 0.02, -0.136), (0.206, 0.034, -0.13)), box((-0.206, 0.02, 0.13), (0.206, 0.034, 0.136)), box((-0.206, 0.02, -0.13), (-0.2, 0.034, 0.13)), box((0.2, 0.02, -0.13), (0.206, 0.034, 0.13))]
    y = 0.0262
    square = [glass(1.52), hollow((-0.034, 0, -0.018), (0.034, 0.09, 0.018), 0.005), inside("amber", (6, 26, 90), glass(1.36), box((-0.0288, 0.0052, -0.0128), (0.0288, 0.062, 0.0128))), metal(0.95, 0.78, 0.45, 0.08), turned([(0.011, 0.0902), (0.011, 0.1), (0.0, 0.1)], (0, 0, 0), 32), gloss(0.02, 0.02, 0.022, 0.02), box((-0.014, 0.1, -0.012), (0.014, 0.13, 0.012))]
    parts.append(placed((-0.115, y, -0.02), [(22, (0, 1, 0))], *square))
    outer, core = arc(0.042, -75, 75, 24), list(reversed(arc(0.036, -72, 72, 24)))
    outer, core = [(0, outer[0][1])] + outer + [(0.011, 0.052)], [(0.007, 0.052)] + core + [(0, core[-1][1])]
    low = outer[0][1]
    drop = [(0, -0.034)] + [p for p in arc(0.0355, -72, 72, 24) if p[1] < 0.012] + [(0.0335, 0.0118), (0, 0.0118)]
    parts.append(placed((0.0, y - low, 0.02), [], glass(1.52), turned(outer + core), inside("rose", (8, 55, 40), glass(1.36), turned(drop)), metal(0.92, 0.92, 0.93, 0.05), turned([(0.012, 0.0522), (0.012, 0.06), (0.004, 0.06)]), glass(1.52), ball((0, 0.0752, 0), 0.015)))
    hexagon = [(0, 0), (0.024, 0), (0.031, 0.012), (0.031, 0.085), (0.012, 0.105), (0.012, 0.112), (0.008, 0.112), (0.008, 0.104), (0.026, 0.082), (0.026, 0.014), (0.02, 0.006), (0, 0.006)]
    parts.append(placed((0.12, y, -0.035), [(10, (0, 1, 0))], glass(1.52), faceted(hexagon, (0, 0, 0), 6), inside("sea", (60, 14, 9), glass(1.36), faceted([(0, 0.0063), (0.0197, 0.0063), (0.0256, 0.0143), (0.0256, 0.06), (0, 0.06)], (0, 0, 0), 6)), metal(0.9, 0.9, 0.92, 0.03), turned([(0.013, 0.1122), (0.013, 0.14), (0.0, 0.143)])))
    parts.append(placed((0.02, y, -0.085), [], glass(1.52), turned([(0, 0), (0.018, 0), (0.018, 0.12), (0.008, 0.125), (0.008, 0.13), (0.005, 0.13), (0.005, 0.123), (0.0145, 0.118), (0.0145, 0.004), (0, 0.004)]), inside("lime", (26, 7, 60), glass(1.36), turned([(0, 0.0042), (0.0142, 0.0042), (0.0142, 0.1), (0, 0.1)])), metal(0.95, 0.76, 0.42, 0.1), turned([(0.009, 0.1302), (0.011, 0.15), (0, 0.155)])))
    parts += [gloss(0.82, 0.78, 0.72, 0.03)] + [ball((0.02 + 0.075 * math.cos(a), 0.0312, 0.085 + 0.032 * math.sin(a)), 0.005, 20) for a in steps(0.2, 5.9, 30)] + [gloss(0.5, 0.08, 0.12), turned([(0.012, 0.02), (0.012, 0.075), (0, 0.078)], (0.27, 0, 0.06), 32), metal(0.95, 0.76, 0.42, 0.1), ring((-0.28, 0.024, 0.1), 0.03, 0.004)]
    return scene((0.13, 0.27, 0.5), (0.0, 0.065, 0.0), 38, *parts)


def candles():
    parts = [room((-1.4, 0, -1.1), (1.4, 2.2, 1.6), diffuse(0.4, 0.33, 0.28)), gloss(0.32, 0.17, 0.08, 0.1), box((-0.7, 0.7, -0.4), (0.7, 0.74, 0.45)), diffuse(0.2, 0.11, 0.06)] + [box((x - 0.03, 0, z - 0.03), (x + 0.03, 0.7, z + 0.03)) for x in (-0.63, 0.63) for z in (-0.33, 0.38)]
    for i, (x, z, r, h) in enumerate([(-0.2, -0.02, 0.036, 0.08), (-0.09, 0.1, 0.032, 0.06), (0.02, -0.08, 0.042, 0.1), (0.12, 0.08, 0.034, 0.07), (0.23, -0.03, 0.038, 0.085)]):
        wall, top = 0.003, 0.003 + 0.05 * h + 0.3 * h
        wide, base = 0.85 * r - wall - 0.0006, 0.0033 + 0.05 * h
        parts.append(placed((x, 0.7402, z), [], glass(), cup((0, 0, 0), r, h, wall), diffuse(0.8, 0.74, 0.6), turned([(0, base), (wide, base)], (0, 0, 0), 32), turned([(wide, base), (wide, top)], (0, 0, 0), 32), turned([(wide, top), (0, top - 0.002)], (0, 0, 0), 32), diffuse(0.03), tube([(0, top - 0.003, 0), (0.0005, top + 0.006, 0)], 0.0008, (1, 0, 0), 8), lamp(900, 520, 190, ball((0, top + 0.0165, 0), 0.004, 16, 2.6))))
    parts += [gloss(0.12, 0.2, 0.3, 0.15), box((-0.42, 0.74, -0.2), (-0.26, 0.765, 0.04), 0.5), gloss(0.45, 0.1, 0.08, 0.15), box((-0.41, 0.765, -0.17), (-0.28, 0.785, 0.02), 0.2), metal(0.95, 0.93, 0.88, 0.05), ball((0.36, 0.775, -0.12), 0.035), metal(0.95, 0.76, 0.42, 0.12), ring((0.3, 0.744, 0.16), 0.03, 0.004), gloss(0.5, 0.12, 0.06, 0.1), ball((-0.02, 0.775, 0.2), 0.035), ball((0.05, 0.77, 0.22), 0.03)]
    return scene((0.18, 1.02, 0.72), (0.0, 0.775, 0.0), 44, *parts)


def ice():
    parts = [room((-1.1, 0, -0.8), (1.3, 2.2, 1.6), diffuse(0.74, 0.72, 0.68)), gloss(0.42, 0.27, 0.16, 0.12), box((-0.7, 0.68, -0.5), (0.7, 0.72, 0.5)), lamp(14, 15.5, 17, quad((-1.09, 0.95, -0.5), (-1.09, 1.85, -0.5), (-1.09, 1.85, 0.6), (-1.09, 0.95, 0.6))), gloss(0.8, 0.8, 0.78, 0.1)]
    parts += [box((-1.1, 0.9, -0.55), (-1.02, 0.95, 0.65)), box((-1.1, 1.85, -0.55), (-1.05, 1.9, 0.65)), box((-1.1, 0.95, -0.55), (-1.05, 1.85, -0.5)), box((-1.1, 0.95, 0.6), (-1.05, 1.85, 0.65)), box((-1.085, 0.95, 0.03), (-1.06, 1.85, 0.07)), box((-1.085, 1.38, -0.5), (-1.06, 1.42, 0.6))]
    parts += [gloss(0.82, 0.83, 0.84, 0.04), turned([(0.07, 0.72), (0.075, 0.7205), (0.1, 0.727), (0.15, 0.739), (0.152, 0.741), (0.15, 0.742), (0.1, 0.731), (0.085, 0.728), (0, 0.728)], (0, 0, 0), 72), glass(1.31)]
    for x, z, size, angles in ((-0.062, -0.035, 0.016, (0.0, 0.3, 0.0)), (-0.012, -0.055, 0.017, (0.35, 0.5, 0.3)), (0.048, -0.05, 0.016, (0.0, 1.1, 0.0)), (-0.035, 0.022, 0.016, (0.5, 0.2, 0.1)), (0.02, 0.0, 0.015, (0.0, 0.7, 0.0)), (0.055, 0.055, 0.0145, (0.7, 0.4, 0.6))):
        parts.append(tumbled(x, z, 0.7283, (size, 0.94 * size, 1.05 * size), angles))
    parts.append(tumbled(0.02, -0.005, 0.7588, (0.013, 0.013, 0.014), (0.2, 0.4, 0.1)))

    def slice_of(radius, thick):
        text = gloss(0.85, 0.62, 0.05, 0.15) + turned([(radius, -thick), (radius, thick)]) + diffuse(0.85, 0.82, 0.6) + turned([(0, -thick), (radius, -thick)]) + turned([(radius, thick), (0, thick)]) + gloss(0.85, 0.7, 0.2, 0.08)
        for k in range(9):
            a, b, r = 2 * math.pi * (k + 0.06) / 9, 2 * math.pi * (k + 0.94) / 9, 0.86 * radius
            fan = [(0.1 * radius * math.cos((a + b) / 2), -0.1 * radius * math.sin((a + b) / 2))] + [(r * math.cos(t), -r * math.sin(t)) for t in steps(a, b, 6)]
            text += mesh([(p, thick + 0.0003, q) for p, q in fan], [(0, i, i + 1) for i in range(1, 7)]) + mesh([(p, -thick - 0.0003, q) for p, q in fan], [(0, i + 1, i) for i in range(1, 7)])
        return text

    parts += [placed((0.098, 0.7545, 0.005), [(12, (0, 0, 1)), (74, (1, 0, 0))], slice_of(0.027, 0.003)), placed((-0.005, 0.7325, 0.075), [(-30, (0, 1, 0))], slice_of(0.027, 0.0035)), placed((-0.06, 0.7335, 0.062), [(25, (0, 1, 0)), (4, (0, 0, 1))], slice_of(0.025, 0.003))]
    parts += [gloss(0.85, 0.64, 0.06, 0.12), placed((0.2, 0.752, -0.08), [(35, (0, 1, 0)), (90, (0, 0, 1))], turned(arc(0.032, flat=1.25)), turned([(0.006, 0.038), (0.005, 0.046), (0, 0.047)])), metal(0.85, 0.85, 0.86, 0.08), placed((0.24, 0.721, 0.1), [(70, (0, 1, 0))], box((-0.1, 0, -0.009), (0.03, 0.0015, 0.009))), gloss(0.06, 0.04, 0.03, 0.1), placed((0.24, 0.721, 0.1), [(70, (0, 1, 0))], box((0.03, -0.0005, -0.009), (0.12, 0.011, 0.009)))]
    parts += [gloss(0.2, 0.35, 0.5, 0.1), cup((-0.25, 0.72, -0.2), 0.045, 0.09, 0.004), diffuse(0.7, 0.68, 0.62), box((-0.36, 0.7201, 0.02), (-0.2, 0.726, 0.2), 0.2)]
    return scene((0.13, 0.98, 0.4), (0.01, 0.738, 0.0), 40, *parts)


def harbour():
    homes = random.Random(4)
    parts = [sky(0.38, 0.45, 0.62), sun((-5, 1.7, -1.6), 10, 6.2, 3.0), diffuse(0.3, 0.27, 0.2), floor(-2.5, 60), diffuse(0.4, 0.37, 0.34), box((-60, -3, -60), (-38, 1.4, 30)), box((38, -3, -60), (60, 1.4, 30)), box((-38, -3, -60), (38, 1.1, -38)), box((-38, -3, 9), (38, 1.2, 30))]

    def wave(x, z):
        return 0.045 * math.sin(1.9 * x + 1.1 * z) + 0.03 * math.sin(2.7 * z - 1.6 * x + 1) + 0.012 * math.sin(5.3 * x + 4.1 * z + 2) + 0.008 * math.sin(8.7 * z - 3.9 * x)

    spread = lambda s: 39 * (0.25 * s + 0.75 * s**3)  # noqa: E731
    away = lambda s: 9.5 - 48.5 * (0.35 * s + 0.65 * s**2)  # noqa: E731
    # The water is a closed body: its sides and bottom lie within the quays and the ground.
    xs, zs, n = [spread(t) for t in steps(-1, 1, 170)], [away(t) for t in steps(0, 1, 170)], 173
    xs, zs, points, normals, faces = [xs[0]] + xs + [xs[-1]], [zs[0]] + zs + [zs[-1]], [], [], []
    for j, z in enumerate(zs):
        for i, x in enumerate(xs):
            edge = i in (0, n - 1) or j in (0, n - 1)
            points.append((x, -2.9 if edge else wave(x, z), z))
            normals.append(unit(((wave(x - 1e-3, z) - wave(x + 1e-3, z)) / 2e-3, 1, (wave(x, z - 1e-3) - wave(x, z + 1e-3)) / 2e-3)))
    for j in range(n - 1):
        for i in range(n - 1):
            a = j * n + i
            faces += [(a, a + 1, a + n + 1), (a, a + n + 1, a + n)]
    around = list(range(n)) + [j * n + n - 1 for j in range(1, n)] + [n * n - 1 - i for i in range(1, n)] + [j * n for j in range(n - 2, 0, -1)]
    points.append((0, -2.95, -10))
    normals.append((0, -1, 0))
    faces += [(b, a, n * n) for a, b in zip(around, around[1:] + around[:1])]
    parts.append(inside("sea", (0.45, 0.12, 0.09), glass(1.33), mesh(points, faces, normals)))
    parts += [diffuse(0.38, 0.27, 0.18)] + [box((-4.6, 0.72, 8.6 - 0.24 * k), (-2.6, 0.76 + 0.004 * (k * 7 % 3), 8.82 - 0.24 * k)) for k in range(74)] + [diffuse(0.22, 0.16, 0.11)] + [box((x - 0.06, 0.6, -9.2), (x + 0.06, 0.72, 9)) for x in (-4.4, -2.8)] + [tube([(x, -2.5, z), (x, 1.25, z)], 0.11, (1, 0, 0), 12) + turned([(0.11, 1.25), (0, 1.27)], (x, 0, z), 12) for x in (-4.5, -2.7) for z in (5, 1.5, -2, -5.5, -9)]

    def hull(u, v):
        w, d = 0.95 * max(1 - abs(u) ** 2.6, 0) ** 0.6, 0.85 * max(1 - u**4, 0) ** 0.5
        return (2.6 * u, 0.5 + 0.25 * u * u - d * math.sin(v), w * math.cos(v))

    boat = [gloss(0.08, 0.16, 0.36, 0.04), surface(hull, steps(-0.999, 0.999, 50), steps(0, math.pi, 30)), gloss(0.55, 0.4, 0.25, 0.15), surface(lambda u, s: (2.6 * u, 0.47 + 0.25 * u * u, -s * hull(u, 0)[2]), list(reversed(steps(-0.99, 0.99, 30))), steps(-1, 1, 2))]
    boat += [gloss(0.8, 0.8, 0.77, 0.05), box((-1.1, 0.45, -0.5), (0.2, 1.25, 0.5)), box((-1.2, 1.25, -0.58), (0.3, 1.3, 0.58)), gloss(0.02, 0.025, 0.03, 0.01), box((-1.0, 0.85, -0.51), (0.1, 1.12, 0.51)), box((0.15, 0.85, -0.42), (0.21, 1.12, 0.42)), gloss(0.4, 0.26, 0.15, 0.1), tube([(0.9, 0.5, 0), (0.9, 3.4, 0)], 0.035, (1, 0, 0), 12), metal(0.85, 0.85, 0.87, 0.1), ring((1.9, 0.95, 0), 0.12, 0.015, "z", 32)]
    parts += [placed((0.6, 0, -2.6), [(28, (0, 1, 0)), (2, (1, 0, 0))], *boat), gloss(0.75, 0.2, 0.04, 0.08), ball((2.6, 0.1, 1.2), 0.28), ball((-1.6, 0.08, -9), 0.28), metal(0.9, 0.9, 0.92, 0.05), tube([(2.6, 0.36, 1.2), (2.6, 0.62, 1.2)], 0.02, (1, 0, 0), 10)]
    for k in range(9):
        x, w, h = -26 + 6.2 * k, homes.uniform(3.2, 4.6), homes.uniform(3.5, 6.0)
        tone = [homes.uniform(0.35, 0.75) for _ in range(2)]
        parts += [diffuse(max(tone), min(tone), 0.3), box((x, 1.1, -46), (x + w, 1.1 + h, -41)), diffuse(0.35, 0.15, 0.1), mesh([(x - 0.2, 1.1 + h, -40.8), (x + w + 0.2, 1.1 + h, -40.8), (x + w / 2, 2.8 + h, -40.8), (x - 0.2, 1.1 + h, -46.2), (x + w + 0.2, 1.1 + h, -46.2), (x + w / 2, 2.8 + h, -46.2)], [(0, 1, 2), (3, 5, 4), (0, 2, 5), (0, 5, 3), (1, 4, 5), (1, 5, 2), (0, 3, 4), (0, 4, 1)]), diffuse(0.1, 0.11, 0.13)] + [box((x + u, 2.2, -41.02), (x + u + 0.7, 3.3, -40.98)) for u in (0.5, 1.9)]
    return scene((1.6, 2.2, 6.2), (-0.6, 0.25, -3.5), 52, *parts)


def office():
    books = random.Random(21)
    parts = [room((-3, 0, -2.5), (3, 2.7, 3.2), diffuse(0.74, 0.73, 0.7)), diffuse(0.25, 0.28, 0.33), box((-3, 0, -2.5), (3, 0.01, 3.2))]
    parts += [lamp(22, 21.5, 20, down(x - 0.6, -0.6, x + 0.6, -0.3, 2.69)) for x in (-1.3, 1.3)] + [gloss(0.8, 0.8, 0.8, 0.2)] + [box((x - 0.65, 2.66, z - 0.02), (x + 0.65, 2.7, z + 0.02)) for x in (-1.3, 1.3) for z in (-0.64, -0.26)]
    for x, z, turn in ((-1.4, -1.2, 0), (1.2, -1.0, -8), (-0.6, 1.2, 180)):
        desk = [gloss(0.58, 0.45, 0.32, 0.2), box((-0.8, 0.71, -0.4), (0.8, 0.74, 0.4)), gloss(0.3, 0.3, 0.32, 0.2)] + [box((u - 0.03, 0, w - 0.03), (u + 0.03, 0.71, w + 0.03)) for u in (-0.74, 0.74) for w in (-0.34, 0.34)]
        desk += [gloss(0.04, 0.04, 0.045, 0.2), box((-0.3, 0.86, -0.22), (0.3, 1.2, -0.19)), box((-0.03, 0.75, -0.24), (0.03, 0.9, -0.2)), box((-0.12, 0.74, -0.3), (0.12, 0.755, -0.12)), diffuse(0.2, 0.32, 0.45), quad((-0.285, 0.875, -0.189), (0.285, 0.875, -0.189), (0.285, 1.185, -0.189), (-0.285, 1.185, -0.189)), gloss(0.65, 0.65, 0.62, 0.2), box((-0.22, 0.741, 0.05), (0.22, 0.76, 0.2)), box((0.3, 0.741, 0.08), (0.36, 0.765, 0.18)), diffuse(0.82), box((-0.65, 0.74, -0.1), (-0.42, 0.79, 0.22), 0.15), gloss(0.6, 0.12, 0.1, 0.2), cup((0.6, 0.741, -0.1), 0.04, 0.09, 0.004), gloss(0.75, 0.74, 0.7, 0.2), box((0.3, 0.1, -0.3), (0.7, 0.68, 0.3))]
        chair = [gloss(0.1, 0.14, 0.2, 0.2), box((-0.24, 0.44, 0.5), (0.24, 0.5, 0.96)), box((-0.22, 0.55, 0.94), (0.22, 1.0, 0.99)), gloss(0.12, 0.12, 0.13, 0.2), turned([(0.03, 0.06), (0.03, 0.44)], (0, 0, 0.73), 16), box((-0.3, 0.03, 0.7), (0.3, 0.07, 0.76)), box((-0.03, 0.03, 0.43), (0.03, 0.07, 1.03))]
        parts.append(placed((x, 0, z), [(turn, (0, 1, 0))], *desk, *chair))
    for x in (-2.4, 0.0):
        parts += [gloss(0.66, 0.6, 0.5, 0.2), box((x - 0.5, 0, -2.5), (x - 0.47, 1.9, -2.2)), box((x + 0.47, 0, -2.5), (x + 0.5, 1.9, -2.2)), box((x - 0.47, 0, -2.5), (x + 0.47, 1.9, -2.48))] + [box((x - 0.47, y, -2.48), (x + 0.47, y + 0.025, -2.2)) for y in (0.1, 0.55, 1.0, 1.45, 1.875)]
        for y in (0.125, 0.575, 1.025, 1.475):
            at = x - 0.46
            while at < x + books.uniform(0.05, 0.4):
                w, h = books.uniform(0.025, 0.07), books.uniform(0.22, 0.34)
                parts += [gloss(books.uniform(0.06, 0.7), books.uniform(0.06, 0.55), books.uniform(0.06, 0.6), 0.25), box((at, y, -2.47), (at + w - 0.002, y + h, -2.47 + books.uniform(0.17, 0.24)))]
                at += w
    parts += [gloss(0.7, 0.7, 0.68, 0.2), cup((2.5, 0.01, -2.0), 0.2, 0.4, 0.015), diffuse(0.12, 0.3, 0.1)] + [ball((2.5 + 0.16 * math.cos(2.4 * k), 0.55 + 0.09 * k, -2.0 + 0.16 * math.sin(2.4 * k)), 0.2, 14) for k in range(8)] + [diffuse(0.85), box((1.0, 1.2, -2.49), (2.0, 1.9, -2.47)), diffuse(0.6, 0.2, 0.15), box((2.96, 1.1, -1.2), (2.99, 1.8, 0.0)), gloss(0.3, 0.31, 0.33, 0.2), cup((0.25, 0.01, -0.3), 0.13, 0.3, 0.005)]
    return scene((1.9, 1.75, 2.9), (-0.3, 0.85, -0.9), 60, *parts)


def workshop():
    parts = [room((-1.5, 0, -0.6), (1.5, 2.5, 2.0), diffuse(0.5, 0.48, 0.45)), gloss(0.36, 0.24, 0.14, 0.25), box((-0.9, 0.82, -0.55), (0.9, 0.88, 0.3)), diffuse(0.2, 0.28, 0.26), box((-0.85, 1.0, -0.6), (0.85, 1.75, -0.58))]
    ringed = [(0.34 * math.cos(2 * math.pi * k / 10), 0.12 * 0 + 0.26 * math.sin(2 * math.pi * k / 10) - 0.1) for k in range(10)]
    parts += [lamp(130, 118, 95, down(x - 0.02, z - 0.02, x + 0.02, z + 0.02, 1.598)) for x, z in ringed] + [gloss(0.05, 0.05, 0.055, 0.1), placed((0, 1.62, -0.1), [], "Scale 1 1 0.765\n", ring((0, 0, 0), 0.34, 0.02)), box((-0.01, 1.62, -0.37), (0.01, 2.5, -0.35))] + [box((x - 0.025, 1.6, z - 0.025), (x + 0.025, 1.63, z + 0.025)) for x, z in ringed]
    brass, steel = (0.88, 0.7, 0.36), (0.72, 0.72, 0.73)
    for x, z, y, spin, tone, rough, shape in ((-0.1, -0.05, 0.8802, 0, brass, 0.12, (28, 0.1, 0.088, 0.02, 0.018)), (0.075, -0.05, 0.8802, 8, steel, 0.2, (18, 0.074, 0.062, 0.012, 0.018)), (-0.13, 0.13, 0.8802, 3, brass, 0.05, (12, 0.04, 0.031, 0.008, 0.014)), (-0.1, -0.05, 0.8985, 11, steel, 0.1, (14, 0.05, 0.041, 0.02, 0.014)), (0.2, -0.2, 0.8802, 5, brass, 0.3, (36, 0.09, 0.081, 0.03, 0.012))):
        parts += [metal(*tone, rough), placed((x, y, z), [(spin, (0, 1, 0))], gear(*shape))]
    parts += [metal(*brass, 0.08), placed((-0.34, 0.9935, -0.28), [(20, (0, 1, 0)), (76, (1, 0, 0))], gear(32, 0.115, 0.102, 0.03, 0.016)), metal(*steel, 0.05), turned([(0.0195, 0.88), (0.0195, 0.96), (0.017, 0.963), (0, 0.963)], (-0.1, 0, -0.05), 32), turned([(0.012, 0.88), (0.012, 0.93), (0, 0.932)], (0.075, 0, -0.05), 24)]
    wrench = [metal(*steel, 0.15), box((-0.09, 0, -0.008), (0.09, 0.006, 0.008)), placed((0, 0.004, 0), [], ring((-0.105, 0, 0), 0.017, 0.005, "y", 32)), box((0.09, 0, -0.016), (0.125, 0.008, -0.009)), box((0.09, 0, 0.009), (0.125, 0.008, 0.016)), box((0.082, 0, -0.016), (0.09, 0.008, 0.016))]
    driver = [gloss(0.65, 0.08, 0.05, 0.05), tube([(-0.09, 0.013, 0), (-0.085, 0.013, 0), (-0.01, 0.013, 0)], 0.013, (0, 0, 1)), ball((-0.09, 0.013, 0), 0.013, 24), ball((-0.01, 0.013, 0), 0.013, 24), metal(*steel, 0.1), tube([(0.0, 0.013, 0), (0.11, 0.013, 0)], 0.0035, (0, 0, 1), 16)]
    parts += [placed((0.3, 0.8802, 0.05), [(65, (0, 1, 0))], *wrench), placed((-0.3, 0.8802, 0.1), [(-50, (0, 1, 0))], *driver), placed((0.25, 1.3, -0.579), [(90, (0, 0, 1)), (90, (1, 0, 0))], *wrench), placed((0.4, 1.3, -0.579), [(90, (0, 0, 1)), (90, (1, 0, 0))], "Scale 1.3 1 1.3\n", *wrench), placed((-0.2, 1.35, -0.578), [(90, (0, 0, 1)), (90, (1, 0, 0))], *driver), placed((-0.32, 1.35, -0.578), [(90, (0, 0, 1)), (90, (1, 0, 0))], *driver)]
    lens = [glass(1.52), turned(arc(0.045, flat=0.2)), metal(*brass, 0.06), ring((0, 0, 0), 0.0475, 0.0035), tube([(0.05, 0, 0), (0.075, 0, 0)], 0.004, (0, 0, 1)), gloss(0.03, 0.02, 0.02, 0.05), tube([(0.075, 0, 0), (0.15, 0, 0)], 0.008, (0, 0, 1)), ball((0.15, 0, 0), 0.008, 20), ball((0.075, 0, 0), 0.008, 20)]
    parts += [placed((-0.005, 0.975, 0.1), [(-28, (0, 1, 0)), (-5, (0, 0, 1)), (12, (1, 0, 0))], *lens), metal(*steel, 0.2), placed((0.09, 0.88, 0.145), [], turned([(0.04, 0), (0.04, 0.008), (0.005, 0.012), (0.005, 0.09), (0, 0.091)], (0, 0, 0), 32)), gloss(0.1, 0.3, 0.2, 0.15), box((0.4, 0.88, -0.35), (0.7, 1.02, -0.15), 0.2), gloss(0.75, 0.72, 0.65, 0.1), cup((-0.55, 0.88, -0.1), 0.045, 0.1, 0.004), diffuse(0.75, 0.73, 0.65), box((-0.52, 0.8801, 0.02), (-0.3, 0.882, 0.25), 0.2)]
    parts += [metal(*steel, 0.25)] + [placed((0.02 + 0.025 * (k % 4), 0.8802, 0.2 + 0.022 * (k // 4)), [(37 * k, (0, 1, 0))], faceted([(0, 0), (0.007, 0), (0.007, 0.006), (0, 0.006)], (0, 0, 0), 6)) for k in range(7)]
    return scene((0.18, 1.3, 0.62), (-0.01, 0.93, -0.04), 46, *parts)


unseen.SCENES = [courtyard, vanity, solar, street, gallery, greenhouse, perfume, candles, ice, harbour, office, workshop]

if __name__ == "__main__":
    unseen.main(__doc__)
