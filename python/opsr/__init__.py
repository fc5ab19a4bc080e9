"""Path tracing with optimised path space regularisation, learned tables, training and metrics.

    import opsr

    scene = opsr.Scene.load("scene.glb")
    film = opsr.render(scene, spp=64, table="beta-0.001")
    film.picture            # height x width x 3, linear Rec. 709 radiance, float32
    film.save("out.exr")

Pictures are numpy arrays of shape (height, width, 3), rows from the top, of linear radiance with Rec. 709 primaries, in
float32. Roughness is Beckmann's alpha, from 0 (Dirac) to 1 (diffuse). Work is done without the GIL, on threads of its own;
Ctrl-C stops renders and trainings. Errors have the messages of the program `opsr`.
"""

import numpy as _numpy  # noqa: F401  An error here says more than one in the middle of a render.

from ._opsr import (
    Film,
    Progress,
    Resolved,
    Scene,
    Step,
    Table,
    __version__,
    bench,
    compare,
    merge,
    record,
    render,
    resolve,
    train,
)

__all__ = [
    "Film",
    "Progress",
    "Resolved",
    "Scene",
    "Step",
    "Table",
    "__version__",
    "bench",
    "compare",
    "merge",
    "record",
    "render",
    "resolve",
    "train",
]
