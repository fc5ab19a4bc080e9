"""Blender add-on: the program `opsr` as a render engine. docs/blender.md says what comes across."""

bl_info = {
    "name": "opsr",
    "description": "Path tracing with optimised path space regularisation",
    "version": (0, 2, 0),
    "blender": (4, 2, 0),
    "location": "Properties > Render > Render Engine",
    "category": "Render",
}


def register():
    import bpy

    from . import engine, settings

    settings.register()
    bpy.utils.register_class(engine.OpsrEngine)


def unregister():
    import bpy

    from . import engine, settings

    bpy.utils.unregister_class(engine.OpsrEngine)
    settings.unregister()
