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

import importlib.util as _importlib_util
import inspect as _inspect
import json as _json
import os as _os
import copyreg as _copyreg
import tempfile as _tempfile

import numpy as _numpy  # noqa: F401  An error here says more than one in the middle of a render.

from . import _opsr
from ._opsr import (
    Film,
    Progress,
    Resolved,
    Scene,
    Step,
    Table,
    View,
    __version__,
    bench,
    choose,
    compare,
    merge,
    record,
    resolve,
    train,
)


def _find_denoiser():
    """Names the folder of Open Image Denoise in the package `pyoidn` (`opsr[denoise]`), unless OIDN_DIR names one already."""
    package = _importlib_util.find_spec("pyoidn")
    if package is not None and package.origin is not None:
        _os.environ.setdefault("OIDN_DIR", _os.path.join(_os.path.dirname(package.origin), "oidn"))


_find_denoiser()


def _remade(method, arguments, keywords):
    """A scene from its pickle."""
    return getattr(Scene, method)(*arguments, **keywords)


def _read_table(text):
    """A table from its pickle."""
    with _tempfile.TemporaryDirectory() as folder:
        path = _os.path.join(folder, "table.json")
        with open(path, "wb") as file:
            file.write(text)
        return Table.load(path)


def _pickled_table(table):
    with _tempfile.TemporaryDirectory() as folder:
        path = _os.path.join(folder, "table.json")
        table.save(path)
        with open(path, "rb") as file:
            return _read_table, (file.read(),)


_copyreg.pickle(Table, _pickled_table)


def _described(function, name):
    """Gives a function the signature and the help of the options that the library declares."""
    options = _json.loads(_opsr._options(name))
    lines = [f"{option['name']}: {option['help']}" for option in options]
    function.__doc__ = function.__doc__.replace("OPTIONS\n", "\n".join(lines) + "\n")
    keyword = _inspect.Parameter.KEYWORD_ONLY
    declared = [_inspect.Parameter(o["name"], keyword, default=o["default"]) for o in options]
    first = [
        parameter
        for parameter in _inspect.signature(function).parameters.values()
        if parameter.kind is not _inspect.Parameter.VAR_KEYWORD
    ]
    positional = [p for p in first if p.kind is not keyword]
    others = [p for p in first if p.kind is keyword]
    function.__signature__ = _inspect.Signature([*positional, *declared, *others])
    return function


def render(scene, *, on_progress=None, threads=None, part=None, samples=None, begun=None, **options):
    """Renders a scene. The same settings give the same picture as the program, at any number of threads.

scene: the scene.
OPTIONS
on_progress: called with a Progress after each pass; False ends the render, which then has the samples so far.
threads: their number; all cores by default.
part: write this file instead, for `merge`, and return None. It is whole or not there.
samples: (first, last + 1) of the samples of a part; by default all `spp`.
begun: a part of the first of these samples, of the same pixels, to go on with; both begin with sample 0.

Ctrl-C ends the render after the current pass and raises KeyboardInterrupt. Raises ValueError for settings that cannot
be, MemoryError for pictures that are too large for this machine.
"""
    return _opsr.render(
        scene, on_progress=on_progress, threads=threads, part=part, samples=samples, begun=begun, **options
    )


render = _described(render, "render")


def view(scene, *, port=0, height=640, reference=None, **options):
    """Shows a scene on a page while it is rendered: in a notebook in the cell, else at the `address` of what is returned.

scene: a path, or a Scene, of which path and options are taken.
OPTIONS
port: port of the page on this machine; 0 takes one that is free.
height: rows of the cell in pixels.
reference: an EXR file to show beside the scene's picture.

The page is open until `close()` is called or nothing holds the View any more. What is wrong with the scene is said on the
page. Raises ValueError for settings that cannot be, OSError for a port that is taken.
"""
    return _opsr.view(scene, port=port, height=height, reference=reference, **options)


view = _described(view, "view")

__all__ = [
    "Film",
    "Progress",
    "Resolved",
    "Scene",
    "Step",
    "Table",
    "View",
    "__version__",
    "bench",
    "choose",
    "compare",
    "merge",
    "record",
    "render",
    "resolve",
    "train",
    "view",
]
