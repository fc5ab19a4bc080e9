"""Rendered mode of the viewport: looks, draws, and asks to be drawn again."""

import contextlib
import copy
import pathlib
import shutil
import tempfile
import weakref

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import engine as of_engine
from . import export, exr
from .program import Render
from .refine import Refiner

# Seconds between looks at the running render.
INTERVAL = 0.1


class Viewport:
    """What an engine keeps of its viewport."""

    def __init__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="opsr-view-", dir=bpy.app.tempdir))
        self.refiner = Refiner(self.export, self.start, lambda running: of_engine.combined(exr.read(running.output)))
        self.texture, self.drawn, self.exporting = None, None, False

    def close(self):
        """Ends the render."""
        self.refiner.end()
        shutil.rmtree(self.folder, ignore_errors=True)

    def export(self):
        self.exporting = True
        try:
            return export.scene(bpy.context.evaluated_depsgraph_get(), self.folder)
        finally:
            self.exporting = False

    def start(self, exported, view):
        pose, projection, size, lens = view
        # The camera is another one for each view, the rest is exported once.
        glb = copy.copy(exported.glb)
        glb.json, glb.bytes = copy.deepcopy(exported.glb.json), bytearray(exported.glb.bytes)
        shaped = (np.array(pose).reshape(4, 4), np.array(projection).reshape(4, 4))
        words = [*exported.options, *export.view(glb, shaped, size, (0, 0, *size), lens, "viewport")]
        glb.save(exported.scene)
        scene = bpy.context.scene
        spp = ["--spp", scene.opsr.view_spp]
        command = [of_engine.program(), "render", exported.scene, *words, *spp, *of_engine.settings(scene)]
        return Render(command, self.folder / "view.exr", save_every="300ms", denoiser=of_engine.library())


def view_of(context):
    """Pose, projection, size and lens of a viewport as numbers that can be compared."""
    region, seen = context.region, context.region_data
    pose, lens = np.array(seen.view_matrix.inverted()), None
    camera = context.scene.camera
    if seen.view_perspective == "CAMERA" and camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
        lens = export.lens_of(camera.data, np.array(camera.matrix_world), [])
    flat = [tuple(np.round(matrix, 7).reshape(-1).tolist()) for matrix in (pose, np.array(seen.window_matrix))]
    return (*flat, (region.width, region.height), lens)


def tick(engine):
    """Lets a viewport go on as long as there is one."""
    shown = engine()
    with contextlib.suppress(ReferenceError):
        if shown is not None and shown.viewport.refiner.tick():
            shown.tag_redraw()
        return INTERVAL if shown is not None else None


def of(engine):
    """The viewport of an engine."""
    if getattr(engine, "viewport", None) is None:
        engine.viewport = Viewport()
        weakref.finalize(engine, engine.viewport.close)
        bpy.app.timers.register(lambda engine=weakref.ref(engine): tick(engine), first_interval=INTERVAL)
    return engine.viewport


def update(engine, depsgraph):
    """The scene has changed, unless the export itself touched it."""
    shown = of(engine)
    if not shown.exporting:
        shown.refiner.changed()


def draw(engine, context, depsgraph):
    """Draws the picture so far."""
    shown = of(engine)
    shown.refiner.look(view_of(context))
    picture = shown.refiner.picture
    engine.update_stats("opsr", shown.refiner.message)
    if picture is None:
        return
    if picture is not shown.drawn:
        height, width = picture.shape[:2]
        buffer = gpu.types.Buffer("FLOAT", picture.size, picture.reshape(-1))
        shown.texture, shown.drawn = gpu.types.GPUTexture((width, height), format="RGBA32F", data=buffer), picture
    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(depsgraph.scene)
    draw_texture_2d(shown.texture, (0, 0), context.region.width, context.region.height)
    engine.unbind_display_space_shader()
    gpu.state.blend_set("NONE")
