"""Lamps of Blender as surfaces and lights of glTF: radiance from watts (Blender's manual, Light Objects).

A lamp is a dict of plain numbers: kind, name, matrix (4 x 4, to Blender's world), color (with strength, radiant flux in W or for
a sun irradiance in W/m2), and what its kind has: radius, angle, size, shape, spot_size, spot_blend.
"""

import math

import numpy as np

from .glb import UP

# A sun of a smaller angle is a direction without one.
SMALLEST_SUN = math.radians(0.1)


def add(glb, lamp):
    """Adds a lamp that is no sun with an angle."""
    if lamp["kind"] == "AREA":
        positions, faces = area(lamp)
        surface(glb, lamp, positions, faces, 1 / (math.pi * size_of(positions, faces)))
    elif lamp["kind"] == "SUN":
        glb.light(lamp["name"], lamp["matrix"], {"type": "directional", **colour(lamp["color"])})
    elif lamp["radius"] > 0:
        positions, faces = ball(lamp)
        # A convex body shows a quarter of its area on the mean: it sends L A / 4 into every direction.
        surface(glb, lamp, positions, faces, 1 / (math.pi * size_of(positions, faces)))
    else:
        intensity = np.asarray(lamp["color"], float) / (4 * math.pi)
        light = {"type": "point", **colour(intensity)}
        if lamp["kind"] == "SPOT":
            outer = min(lamp["spot_size"] / 2, math.pi / 2)
            inner = outer * (1 - lamp["spot_blend"])
            light = {**light, "type": "spot", "spot": {"innerConeAngle": min(inner, outer - 1e-4), "outerConeAngle": outer}}
        glb.light(lamp["name"], lamp["matrix"], light)


def colour(values):
    """A colour of at most 1, and its factor."""
    values = np.maximum(np.asarray(values, float), 0)
    most = float(values.max())
    return {"color": (values / most).tolist() if most > 0 else [0, 0, 0], "intensity": most}


def surface(glb, lamp, positions, faces, factor):
    """Adds an emitting mesh of this radiance for a watt."""
    light = colour(np.asarray(lamp["color"], float) * factor)
    glb.uses("KHR_materials_emissive_strength")
    glb.uses("KHR_materials_specular")
    extras = {"lamp": {"hidden": not lamp.get("visible", False)}}
    if lamp["kind"] == "SPOT":
        axis = -(UP @ np.asarray(lamp["matrix"], float))[:3, 2]
        cos = math.cos(lamp["spot_size"] / 2)
        # Where Cycles' smooth step begins and ends, in cosines.
        inner = cos + (1 - cos) * max(lamp["spot_blend"], 1e-3)
        axis = axis / np.linalg.norm(axis)
        extras["lamp"]["cone"] = {"direction": axis.tolist(), "cosInner": inner, "cosOuter": cos}
    material = {
        "name": lamp["name"],
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
        "emissiveFactor": light["color"],
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": light["intensity"]},
            "KHR_materials_specular": {"specularFactor": 0},
        },
        "extras": extras,
    }
    glb.mesh(lamp["name"], positions, faces, material)


def to_scene(matrix, positions):
    """Points of a lamp in the space of glTF."""
    matrix = UP @ np.asarray(matrix, float)
    return np.asarray(positions, float) @ matrix[:3, :3].T + matrix[:3, 3]


def area(lamp):
    """The shape of an area lamp, which shines along its own -z."""
    across, along = lamp["size"]
    if lamp["shape"] in ("DISK", "ELLIPSE"):
        turns = np.linspace(0, 2 * math.pi, 64, endpoint=False)
        rim = np.stack([across / 2 * np.cos(turns), along / 2 * np.sin(turns), 0 * turns], axis=1)
        # The polygon has the area of the ellipse.
        rim *= math.sqrt(math.pi / (32 * math.sin(math.pi / 32)))
        positions = np.vstack([rim, np.zeros(3)])
        faces = [[64, (i + 1) % 64, i] for i in range(64)]
    else:
        x, y = across / 2, along / 2
        positions, faces = [[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], [[2, 1, 0], [3, 2, 0]]
    positions = to_scene(lamp["matrix"], positions)
    if np.linalg.det(np.asarray(lamp["matrix"], float)[:3, :3]) < 0:
        faces = [face[::-1] for face in faces]
    return positions, np.array(faces)


def ball(lamp):
    """An icosahedron whose faces are halved once, with the radius of a lamp."""
    golden = (1 + math.sqrt(5)) / 2
    corners = [(x, y * golden, 0) for x in (-1, 1) for y in (-1, 1)]
    corners = [np.roll(c, k) for k in range(3) for c in corners]
    corners = [np.array(c, float) / np.linalg.norm(c) for c in corners]
    near = [[j for j in range(12) if 0 < np.linalg.norm(corners[i] - corners[j]) < 1.2] for i in range(12)]
    coarse = [(i, j, k) for i in range(12) for j in near[i] for k in near[j] if i < j < k and k in near[i]]
    points, faces = [], []
    for corner in coarse:
        a, b, c = (corners[i] for i in corner)
        if np.dot(np.cross(b - a, c - a), a) < 0:
            b, c = c, b
        halves = [(p + q) / np.linalg.norm(p + q) for p, q in ((a, b), (b, c), (c, a))]
        first = len(points)
        points += [a, b, c, *halves]
        faces += [[first + i for i in face] for face in ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))]
    centre = (UP @ np.asarray(lamp["matrix"], float))[:3, 3]
    return np.array(points) * lamp["radius"] + centre, np.array(faces)


def size_of(positions, faces):
    """The area of a mesh."""
    a, b, c = (np.asarray(positions)[np.asarray(faces)[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
