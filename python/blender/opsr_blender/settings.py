"""Preferences, settings of a scene, and their panels."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty, StringProperty

INTEGRATORS = ["auto", "path", "guided", "manifold", "bdpt", "vcm", "sppm", "light", "mlt"]


class OpsrPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

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
    view_spp: IntProperty(name="Viewport Samples", default=64, min=1, description="Samples per pixel of the viewport")
    integrator: EnumProperty(name="Integrator", items=[(name, name, "") for name in INTEGRATORS])
    distribution: EnumProperty(
        name="Microfacets",
        items=[("ggx", "GGX", "As in Cycles"), ("beckmann", "Beckmann", "For which the tables were learned: shorter tails")],
    )
    denoise: BoolProperty(name="Denoise", default=True, description="By Open Image Denoise, which Blender has")
    more: StringProperty(name="More Options", description="Further options of opsr render, such as --seed 3")


class OpsrPanel(bpy.types.Panel):
    bl_idname = "RENDER_PT_opsr"
    bl_label = "opsr"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {"OPSR"}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        self.layout.use_property_split = True
        for name in OpsrSettings.__annotations__:
            self.layout.prop(context.scene.opsr, name)


# Panels of Eevee that show what opsr takes: surfaces, the world, lamps.
OF_EEVEE = {"EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface", "EEVEE_MATERIAL_PT_volume", "EEVEE_WORLD_PT_surface", "DATA_PT_EEVEE_light"}  # fmt: skip
WITHOUT = {"VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes", "RENDER_PT_simplify"}


def shared_panels():
    """Blender's own panels that suit opsr."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if panel.__name__ not in WITHOUT and ("BLENDER_RENDER" in engines or panel.__name__ in OF_EEVEE):
            yield panel


CLASSES = [OpsrPreferences, OpsrSettings, OpsrPanel]


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.opsr = PointerProperty(type=OpsrSettings)
    for panel in shared_panels():
        panel.COMPAT_ENGINES.add("OPSR")


def unregister():
    for panel in bpy.types.Panel.__subclasses__():
        getattr(panel, "COMPAT_ENGINES", set()).discard("OPSR")
    del bpy.types.Scene.opsr
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
