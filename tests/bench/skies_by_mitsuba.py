#!/usr/bin/env python3
"""Illuminance of Mitsuba's sky and of its sun on the ground, which crates/formats/src/build/sky.rs scales this project's to.

    skies_by_mitsuba.py

Needs the packages mitsuba and numpy. Prints luminances of the irradiance for a sun 40 degrees high, and the sun's irradiance across its beam.
"""
import numpy as np

import mitsuba as mi

mi.set_variant("scalar_rgb")
HEIGHT = np.radians(40)


def ground(turbidity, **scales):
    """Irradiance of the plane z = 0, by a white floor."""
    look = mi.ScalarTransform4f().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])
    sun = [float(np.cos(HEIGHT)), 0.0, float(np.sin(HEIGHT))]
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}
    scene = {
        "type": "scene",
        "integrator": {"type": "direct"},
        "sensor": {
            "type": "perspective",
            "fov": 20,
            "to_world": look,
            "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 4096},
        },
        "sky": {"type": "sunsky", "sun_direction": sun, "turbidity": turbidity, **scales},
        "floor": {"type": "rectangle", "bsdf": white},
    }
    return np.pi * np.array(mi.render(mi.load_dict(scene))).mean((0, 1))


for turbidity in (2.0, 3.0, 6.0):
    sky, sun = ground(turbidity, sun_scale=0.0), ground(turbidity, sky_scale=0.0)
    luminance = [float(rgb @ [0.2126, 0.7152, 0.0722]) for rgb in (sky, sun)]
    beam = ", ".join(f"{x:.3f}" for x in sun / np.sin(HEIGHT))
    print(f"turbidity {turbidity}: sky {luminance[0]:.3f}, sun {luminance[1]:.3f}, across its beam {beam}")
