"""Suns that have an angle, drawn into a map."""

import math

import numpy as np

# Columns of maps: a sun of half a degree is three texels wide.
COLUMNS = 2048
MOST_COLUMNS = 4096


def with_suns(pixels, suns):
    """Adds discs to a map: a sun is a direction towards it, an irradiance and the angle of its disc."""
    height = max(COLUMNS // 2, pixels.shape[0])
    narrow = min(angle for _, _, angle in suns)
    # Three texels across the smallest.
    while 3 * math.pi / height > narrow and height < MOST_COLUMNS // 2:
        height *= 2
    rows = np.arange(height) * pixels.shape[0] // height
    columns = np.arange(2 * height) * pixels.shape[1] // (2 * height)
    pixels = np.array(pixels[np.ix_(rows, columns)], np.float32)
    for towards, irradiance, angle in suns:
        share, solid = disc(height, np.asarray(towards, float), angle / 2)
        # Irradiance of a plane that faces it: the cosine over the disc is all but 1.
        facing = (share[2] * solid[share[0]] * share[3]).sum()
        pixels[share[0], share[1]] += (share[2] / facing)[:, None] * np.asarray(irradiance, np.float32)
    return pixels


def disc(height, towards, radius):
    """Rows, columns, covered shares and cosines of the texels that a disc covers, and the solid angle of a texel by row.

    A direction (x, y, z) of Blender is seen at u = 1/2 - atan2(y, x) / 2 pi and v = 1/2 - asin(z) / pi of a map, from its left top.
    """
    towards = towards / np.linalg.norm(towards)
    width, fine = 2 * height, 8
    pitch = math.pi / height
    edges = np.cos(np.arange(height + 1) * pitch)
    solid = (edges[:-1] - edges[1:]) * (2 * math.pi / width)
    polar, turn = math.acos(min(max(towards[2], -1), 1)), math.atan2(towards[1], towards[0])
    first, last = int((polar - radius) / pitch) - 1, int((polar + radius) / pitch) + 2
    rows = np.arange(max(first, 0), min(last, height))
    # Columns that may be met: all near a pole.
    lowest = math.sin(min(polar, math.pi - polar)) if radius < min(polar, math.pi - polar) else 0.0
    reach = math.asin(min(math.sin(radius) / lowest, 1)) if lowest > math.sin(radius) else math.pi
    centre, half = (0.5 - turn / (2 * math.pi)) * width, min(int(reach / pitch) + 2, width // 2)
    columns = np.arange(int(centre) - half, int(centre) + half) % width
    offsets = (np.arange(fine) + 0.5) / fine
    theta = ((rows[:, None] + offsets) * pitch)[:, None, :, None]
    phi = (math.pi - (columns[:, None] + offsets) * pitch)[None, :, None, :]
    cos = np.sin(theta) * (np.cos(phi) * towards[0] + np.sin(phi) * towards[1]) + np.cos(theta) * towards[2]
    inside = cos >= math.cos(radius)
    share = inside.mean(axis=(2, 3))
    facing = np.where(inside, cos, 0).sum(axis=(2, 3)) / np.maximum(inside.sum(axis=(2, 3)), 1)
    i, j = np.nonzero(share)
    return (rows[i], columns[j], share[i, j], facing[i, j]), solid
