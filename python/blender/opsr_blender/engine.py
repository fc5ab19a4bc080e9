"""The render engine: F12 and animations, with passes; the viewport."""

import os
import pathlib
import shlex
import shutil
import tempfile
import threading

import bpy
import numpy as np

from . import export, exr
from .program import NoProgram, Render, denoiser, find

# Passes beside the picture: Blender's name, letters and kind, and the layer with its letters in opsr's files.
PASSES = [
    ("Albedo", "RGB", "COLOR", "albedo", "RGB"),
    ("Normal", "XYZ", "VECTOR", "normal", "XYZ"),
    ("Depth", "Z", "VALUE", "depth", ""),
    ("Error", "X", "VALUE", "error", ""),
]
# Blender's depth where there is nothing.
FAR = 1e10


def program():
    """The path of the program."""
    addon = bpy.context.preferences.addons.get(__package__)
    wanted = bpy.path.abspath(addon.preferences.program) if addon else os.environ.get("OPSR", "opsr")
    return find(wanted)


def library():
    """The folder of Open Image Denoise, or None."""
    return denoiser(pathlib.Path(bpy.utils.resource_path("LOCAL")).parent)


def settings(scene):
    """Options of `opsr render` by the panel. Without the library there is no denoising by default, and an error where it was chosen."""
    chosen = scene.opsr
    words = ["--integrator", chosen.integrator, "--distribution", chosen.distribution]
    if chosen.table:
        words += ["--opsr-table", chosen.table if chosen.table.startswith("beta-") else bpy.path.abspath(chosen.table)]
    more = shlex.split(chosen.more)
    denoises = chosen.denoise and (chosen.is_property_set("denoise") or library() is not None)
    return words + ["--denoise"] * (denoises and "--denoise" not in more) + more


def on_main_thread(work):
    """Does what only the main thread may: in a window, renders have a thread of their own."""
    if threading.current_thread() is threading.main_thread():
        return work()
    done, result = threading.Event(), {}

    def run():
        try:
            result["value"] = work()
        except BaseException as error:  # noqa: BLE001 - it is raised again where the result is awaited
            result["error"] = error
        done.set()

    bpy.app.timers.register(run)
    done.wait()
    if "error" in result:
        raise result["error"]
    return result["value"]


def pixels(picture, letters, layer):
    """A layer in Blender's order: rows from the bottom."""
    values = exr.layer(picture, layer, letters)
    return None if values is None else np.ascontiguousarray(values[::-1], np.float32)


def combined(picture):
    """The picture with an alpha of 1."""
    rgb = pixels(picture, "RGB", "")
    return np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=-1)


def pass_of(picture, layer, letters):
    """A pass in Blender's units, or None if the file does not have it."""
    values = pixels(picture, letters, layer)
    if values is None:
        return None
    if layer == "normal":
        values = export.to_blender(values)
    if layer == "depth":
        values = np.minimum(values, FAR)
    return values


class OpsrEngine(bpy.types.RenderEngine):
    """Renders with the program opsr."""

    bl_idname = "OPSR"
    bl_label = "opsr"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene, layer):
        """Names the passes."""
        self.register_pass(scene, layer, "Combined", 4, "RGBA", "COLOR")
        for name, letters, kind, *_ in PASSES:
            self.register_pass(scene, layer, name, len(letters), letters, kind)

    def render(self, depsgraph):
        """Renders a frame."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="opsr-", dir=bpy.app.tempdir))
        try:
            self.render_in(folder, depsgraph)
        except (NoProgram, RuntimeError, OSError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            self.error_set(str(error))
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def render_in(self, folder, depsgraph):
        scene = depsgraph.scene
        share = scene.render.resolution_percentage / 100
        size = (int(scene.render.resolution_x * share), int(scene.render.resolution_y * share))
        part = export.region(scene.render, size)
        found = program()
        self.update_stats("", "opsr: exports")

        def prepare():
            if not bpy.app.background:
                # The exporter looks at the window's scene, which may be at another frame than the render.
                bpy.data.scenes[scene.name].frame_set(scene.frame_current, subframe=scene.frame_subframe)
            exported = export.scene(depsgraph, folder)
            exported.options += export.camera(exported, camera_of(self, scene), size, part, exported.notes)
            exported.glb.save(exported.scene)
            return exported

        exported = on_main_thread(prepare)
        words = [found, "render", exported.scene, *exported.options, "--spp", scene.opsr.spp, *settings(scene), "--aov"]
        running = Render(words, folder / "picture.exr", save_every="2s", denoiser=library())
        try:
            failed, warned = self.watch(running, depsgraph, part[2:])
        except BaseException:
            running.kill()
            raise
        if failed is not None:
            raise RuntimeError(failed)
        # The panel says what microfacets the tables were learned for.
        warned = [line for line in warned if not line.startswith("--distribution")]
        for line in [*exported.notes, *warned]:
            self.report({"WARNING"}, line)
        self.show(running, depsgraph, part[2:])

    def watch(self, running, depsgraph, size):
        """Waits for the end of a render and shows how far it is; returns what went wrong, and warnings."""
        wait = threading.Event()
        while running.running():
            wait.wait(0.1)
            if self.test_break():
                running.stop()
            self.update_progress(running.fraction)
            self.update_stats("", f"opsr: {running.status()}")
            if running.fresh():
                self.show(running, depsgraph, size)
        return running.end()

    def show(self, running, depsgraph, size):
        """Gives Blender the picture so far."""
        picture = exr.read(running.output)
        result = self.begin_result(0, 0, *size, layer=depsgraph.view_layer_eval.name)
        passes = result.layers[0].passes
        passes["Combined"].rect.foreach_set(combined(picture).reshape(-1))
        for name, _, _, layer, letters in PASSES:
            values = pass_of(picture, layer, letters)
            if values is not None and name in passes:
                passes[name].rect.foreach_set(values.reshape(-1))
        self.end_result(result)

    def view_update(self, context, depsgraph):
        """The scene has changed."""
        from . import viewport

        viewport.update(self, depsgraph)

    def view_draw(self, context, depsgraph):
        """Draws the picture so far; another one begins where the view has changed."""
        from . import viewport

        viewport.draw(self, context, depsgraph)


def camera_of(engine, scene):
    shown = engine.camera_override or scene.camera
    if shown is None:
        raise RuntimeError("the scene has no camera")
    return shown
