"""Blender add-on: renders the scene with the program `opsr` and shows the picture.

Edit, Preferences, Add-ons, Install from Disk: this file. Then Properties, Render, opsr. docs/blender.md says what comes across.
"""

import os
import pathlib
import shlex
import shutil
import subprocess
import tempfile
import time

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty, StringProperty

bl_info = {
    "name": "opsr",
    "description": "Path tracing with optimised path space regularisation",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "Properties > Render > opsr",
    "category": "Render",
}

INTEGRATORS = ["path", "bdpt", "vcm", "sppm", "light", "mlt", "auto"]


class OpsrPreferences(bpy.types.AddonPreferences):
    bl_idname = __name__

    program: StringProperty(
        name="Program", default="opsr", subtype="FILE_PATH", description="The program opsr: a path, or a name on PATH"
    )

    def draw(self, _context):
        self.layout.prop(self, "program")


class OpsrSettings(bpy.types.PropertyGroup):
    table: StringProperty(
        name="Table", default="beta-0.001", description="beta-0.001, beta-0.05, or a file; empty for plain path tracing"
    )
    spp: IntProperty(name="Samples", default=128, min=1, description="Samples per pixel")
    integrator: EnumProperty(name="Integrator", items=[(name, name, "") for name in INTEGRATORS])
    denoise: BoolProperty(name="Denoise", description="By Open Image Denoise, which the program must find")
    solid_glass: BoolProperty(
        name="Solid Glass", default=True, description="Closed meshes that transmit are solid bodies, not thin walls"
    )
    more: StringProperty(name="More Options", description="Further options of opsr render, such as --seed 3")


def export(path):
    """Writes the scene as opsr reads it: with unitless lights, at the current frame."""
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLB",
        use_renderable=True,
        export_cameras=True,
        export_lights=True,
        export_import_convert_lighting_mode="COMPAT",
        export_apply=True,
        export_animations=False,
        export_current_frame=True,
    )


def environment(world):
    """Options of an environment map that is an image file; the file of the scene has no world."""
    for node in world.node_tree.nodes if world and world.node_tree else ():
        if node.type == "TEX_ENVIRONMENT" and node.image and node.outputs["Color"].is_linked:
            path = bpy.path.abspath(node.image.filepath)
            shader = node.outputs["Color"].links[0].to_node
            strength = shader.inputs["Strength"].default_value if "Strength" in shader.inputs else 1.0
            return ["--env", path, "--env-rotation", "-90", "--env-intensity", str(strength)]
    return []


def command(scene, program, exported, output):
    """The command that renders an exported scene."""
    settings, render = scene.opsr, scene.render
    share = render.resolution_percentage / 100
    size = [max(1, int(length * share)) for length in (render.resolution_x, render.resolution_y)]
    words = [program, "render", exported, "-o", output, "--size", f"{size[0]}x{size[1]}", "--spp", settings.spp]
    words += ["--camera", scene.camera.name, "--integrator", settings.integrator, "--progress", "none"]
    if settings.table:
        named = settings.table.startswith("beta-")
        words += ["--opsr-table", settings.table if named else bpy.path.abspath(settings.table)]
    words += ["--denoise"] * settings.denoise + ["--solid-glass"] * settings.solid_glass
    return [str(word) for word in words + environment(scene.world) + shlex.split(settings.more)]


def show(image):
    """Shows a picture in an image editor, or in a new window if there is none."""
    areas = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    editors = [area for area in areas if area.type == "IMAGE_EDITOR"]
    if not editors:
        bpy.ops.wm.window_new()
        editors = [bpy.context.window_manager.windows[-1].screen.areas[0]]
        editors[0].type = "IMAGE_EDITOR"
    editors[0].spaces.active.image = image


class OpsrRender(bpy.types.Operator):
    """Render the scene with opsr and show the picture; Esc ends with the samples so far"""

    bl_idname = "render.opsr"
    bl_label = "Render with opsr"

    @classmethod
    def poll(cls, context):
        return context.scene.camera is not None

    def execute(self, context):
        addon = context.preferences.addons.get(__name__)
        wanted = bpy.path.abspath(addon.preferences.program) if addon else os.environ.get("OPSR", "opsr")
        program = shutil.which(wanted)
        if program is None:
            self.report({"ERROR"}, f"{wanted}: no such program; the add-on's preferences name it")
            return {"CANCELLED"}
        # Kept as long as Blender runs: the picture is read from it.
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="opsr-", dir=bpy.app.tempdir))
        self.output = self.folder / f"{context.scene.name}.exr"
        export(self.folder / "scene.glb")
        words = command(context.scene, program, self.folder / "scene.glb", self.output)
        self.said = open(self.folder / "said.txt", "w+", encoding="utf-8", errors="replace")
        self.process = subprocess.Popen(words, stdout=self.said, stderr=self.said)
        if bpy.app.background:
            self.process.wait()
            return self.finish(context)
        self.begin = time.monotonic()
        self.timer = context.window_manager.event_timer_add(0.5, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            # The program writes the picture so far.
            self.process.send_signal(2 if os.name == "posix" else 15)
        if self.process.poll() is None:
            seconds = time.monotonic() - self.begin
            context.workspace.status_text_set(f"opsr renders: {seconds:.0f} s; Esc ends it")
            return {"PASS_THROUGH"}
        context.workspace.status_text_set(None)
        context.window_manager.event_timer_remove(self.timer)
        return self.finish(context)

    def finish(self, context):
        self.said.seek(0)
        said = self.said.read().strip().splitlines()
        self.said.close()
        for line in said:
            if "WARN" in line:
                self.report({"WARNING"}, line)
        # 5: stopped, with the samples so far.
        if self.process.returncode not in (0, 5) or not self.output.exists():
            self.report({"ERROR"}, said[-1] if said else f"opsr ended with code {self.process.returncode}")
            return {"CANCELLED"}
        image = bpy.data.images.load(str(self.output))
        image.name = f"opsr {context.scene.name}"
        if not bpy.app.background:
            show(image)
        return {"FINISHED"}


class OpsrPanel(bpy.types.Panel):
    bl_idname = "RENDER_PT_opsr"
    bl_label = "opsr"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    def draw(self, context):
        self.layout.use_property_split = True
        for name in OpsrSettings.__annotations__:
            self.layout.prop(context.scene.opsr, name)
        self.layout.operator(OpsrRender.bl_idname, icon="RENDER_STILL")


CLASSES = [OpsrPreferences, OpsrSettings, OpsrRender, OpsrPanel]


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.opsr = PointerProperty(type=OpsrSettings)


def unregister():
    del bpy.types.Scene.opsr
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
