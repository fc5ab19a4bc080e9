"""A scene of Blender as files and options for opsr: the exporter's meshes and materials, and what it leaves out."""

import math
import pathlib

import bpy
import numpy as np

from . import lamps, materials, world
from .glb import UP, Glb


class Exported:
    """An exported scene: its file, options of the program, and notes on what could not be translated."""

    def __init__(self, glb, folder):
        self.glb, self.folder = glb, pathlib.Path(folder)
        self.scene, self.options, self.notes = self.folder / "scene.glb", [], []


def scene(depsgraph, folder):
    """Exports a scene without camera."""
    if not hasattr(bpy.types, "EXPORT_SCENE_OT_gltf"):
        raise RuntimeError("Blender's add-on glTF 2.0, which exports scenes, is not enabled")
    folder = pathlib.Path(folder)
    path = folder / "exported.glb"
    # Cameras and lamps follow below: the exporter leaves out what they have of a lens, a size or an angle.
    shown = bpy.data.scenes[depsgraph.scene.name]
    with bpy.context.temp_override(scene=shown, view_layer=shown.view_layers[depsgraph.view_layer.name]):
        bpy.ops.export_scene.gltf(
            filepath=str(path),
            export_format="GLB",
            use_active_scene=True,
            use_renderable=True,
            export_cameras=False,
            export_lights=False,
            export_extras=True,
            export_apply=True,
            export_animations=False,
            export_current_frame=True,
        )
    out = Exported(Glb(path), folder)
    suns = []
    for lamp, is_shown in lamps_of(depsgraph, out.notes):
        if lamp["kind"] == "SUN" and lamp["angle"] >= lamps.SMALLEST_SUN:
            towards = np.asarray(lamp["matrix"])[:3, 2]
            suns.append((towards, lamp["color"], min(lamp["angle"], math.pi)))
        elif is_shown:
            lamps.add(out.glb, lamp)
    for material in materials_of(depsgraph):
        out.notes += materials.translate(out.glb, material)
    out.notes += objects_left_out(depsgraph)
    out.options += world.options(depsgraph.scene.world, suns, folder, out.notes)
    path.unlink()
    return out


def lamps_of(depsgraph, notes):
    """All lamps of a scene as plain dicts, instances too."""
    for instance in depsgraph.object_instances:
        shown = instance.object
        if shown.type != "LIGHT":
            continue
        yield lamp(shown, instance.matrix_world, notes), True


def lamp(shown, matrix, notes):
    data, name = shown.data, shown.name
    energy = data.energy * 2 ** getattr(data, "exposure", 0.0)
    color = [c * energy for c in data.color]
    if getattr(data, "use_temperature", False):
        color = [c * t for c, t in zip(color, data.temperature_color, strict=True)]
    color = by_nodes(data, color, name, notes)
    matrix = np.array(matrix)
    out = {"kind": data.type, "name": name, "matrix": matrix, "color": color, "visible": shown.visible_camera}
    if data.type in ("POINT", "SPOT"):
        out["radius"] = data.shadow_soft_size
        if data.type == "SPOT":
            out["spot_size"], out["spot_blend"] = data.spot_size, data.spot_blend
            if not np.allclose(np.linalg.norm(matrix[:3, :2], axis=0), np.linalg.norm(matrix[:3, 2]), rtol=0.01):
                notes.append(f"lamp {name}: its cone is shown round")
    elif data.type == "SUN":
        out["angle"] = data.angle
    else:
        square = data.shape in ("SQUARE", "DISK")
        out["shape"], out["size"] = data.shape, (data.size, data.size if square else data.size_y)
        if data.spread < math.pi - 1e-3:
            notes.append(f"lamp {name}: its spread is shown as 180 degrees")
    if getattr(data, "normalize", True) is False:
        denormalise(out)
    return out


def denormalise(lamp):
    """Flux of a lamp whose power is given as if its surface were one square metre, as Blender 5 may have it."""
    if lamp["kind"] == "AREA":
        positions, faces = lamps.area(lamp)
        lamp["color"] = [c * lamps.size_of(positions, faces) for c in lamp["color"]]
    elif lamp["kind"] != "SUN" and lamp["radius"] > 0:
        lamp["color"] = [c * math.pi * lamp["radius"] ** 2 for c in lamp["color"]]


def by_nodes(data, color, name, notes):
    """The colour of a lamp with the strength of its nodes."""
    output = None
    if data.use_nodes and data.node_tree:
        output = next((n for n in data.node_tree.nodes if n.type == "OUTPUT_LIGHT" and n.is_active_output), None)
    if output is None:
        return color
    node = materials.source_of(output.inputs["Surface"])
    if node is None or node.type != "EMISSION":
        notes.append(f"lamp {name}: its nodes are not translated")
        return color
    reader = materials.Reader(name)
    emission = reader.look(node)["emission"]
    notes += [note.replace("material", "lamp", 1) for note in reader.notes]
    return [c * e for c, e in zip(color, emission, strict=True)]


def materials_of(depsgraph):
    """The materials of all objects that are shown."""
    found = {}
    for instance in depsgraph.object_instances:
        for slot in instance.object.material_slots:
            if slot.material is not None:
                found[slot.material.name] = slot.material
    return found.values()


def objects_left_out(depsgraph):
    """Notes on what has no mesh, and on settings of the scene that opsr does not have."""
    notes = []
    for shown in {instance.object for instance in depsgraph.object_instances}:
        if shown.type in ("VOLUME", "CURVES", "POINTCLOUD", "GPENCIL", "GREASEPENCIL"):
            notes.append(f"object {shown.name}: {shown.type.lower()} is not translated")
        if any(s.settings.render_type == "PATH" and s.settings.type == "HAIR" for s in shown.particle_systems):
            notes.append(f"object {shown.name}: hair is not translated")
    render = depsgraph.scene.render
    if render.use_motion_blur:
        notes.append("motion blur is not translated")
    if render.film_transparent:
        notes.append("a transparent film is not translated: the world is seen")
    if abs(render.pixel_aspect_x / render.pixel_aspect_y - 1) > 1e-3:
        notes.append("pixels are shown square")
    return sorted(notes)


def region(render, size):
    """The part of a picture that is rendered: its left edge, its top edge, width and height."""
    width, height = size
    if not render.use_border:
        return 0, 0, width, height
    left, right = (int(share * width) for share in (render.border_min_x, render.border_max_x))
    low, high = (int(share * height) for share in (render.border_min_y, render.border_max_y))
    return left, height - high, right - left, high - low


def camera(exported, shown, size, part, notes):
    """Adds a camera object, which shows a part of its picture; returns options that name it."""
    data = shown.data
    if data.type == "PANO":
        raise RuntimeError(f"camera {shown.name}: opsr has no panoramic cameras")
    width, height = size
    depsgraph = bpy.context.evaluated_depsgraph_get()
    matrix = np.array(shown.calc_matrix_camera(depsgraph, x=width, y=height))
    lens = None
    if data.dof.use_dof:
        lens = lens_of(data, np.array(shown.matrix_world), notes)
    return view(exported.glb, (np.array(shown.matrix_world), matrix), size, part, lens, shown.name)


def lens_of(data, matrix, notes):
    """Radius of the lens and its focus, in metres: the aperture is f / N, for an orthographic camera 1 / N."""
    dof = data.dof
    focus = dof.focus_distance
    if dof.focus_object is not None:
        to = np.array(dof.focus_object.matrix_world)[:3, 3] - matrix[:3, 3]
        axis = -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        focus = abs(float(to @ axis))
    if dof.aperture_blades > 0 or abs(dof.aperture_ratio - 1) > 1e-3:
        notes.append("the aperture is shown round")
    length = 1e-3 * data.lens if data.type == "PERSP" else 1.0
    return (length / (2 * max(dof.aperture_fstop, 1e-3)), focus)


def view(glb, matrices, size, part, lens, name):
    """Adds a camera by its pose and its projection, as OpenGL has it; returns its options.

    Where the axis is not in the middle of the picture, the picture is a crop of a larger one.
    """
    pose, projection = matrices
    (width, height), across, up = size, *offsets(projection)
    beside, above = round(across * width / 2), round(up * height / 2)
    frame = (width + 2 * abs(beside), height + 2 * abs(above))
    if projection[3, 2] != 0:
        yfov = 2 * math.atan(frame[1] / height / projection[1, 1])
        kind = {"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.001}}
    else:
        half = frame[1] / height / projection[1, 1]
        kind = {"type": "orthographic", "orthographic": {"ymag": half, "xmag": half * frame[0] / frame[1], "znear": 0, "zfar": 1e6}}
    if lens is not None and lens[0] > 0 and lens[1] > 0:
        kind["extras"] = {"apertureRadius": lens[0], "focusDistance": lens[1]}
    glb.camera(name, pose, kind)
    words = ["--camera", name, "--size", f"{frame[0]}x{frame[1]}"]
    left, top, *seen = part
    if beside or above or (width, height) != tuple(seen):
        words += ["--crop", f"{abs(beside) + beside + left},{abs(above) - above + top},{seen[0]},{seen[1]}"]
    return words


def offsets(projection):
    """Where the middle of the picture is, right and up of the axis, in half pictures."""
    if projection[3, 2] != 0:
        return projection[0, 2], projection[1, 2]
    return -projection[0, 3], -projection[1, 3]


def to_blender(normals):
    """Directions of glTF's world in Blender's."""
    return normals @ np.asarray(UP[:3, :3], normals.dtype)
