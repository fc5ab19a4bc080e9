"""The world of a Blender scene as a map: colours, images and skies, with suns that have an angle drawn into it."""

import hashlib
import math
import pathlib
import subprocess
import sys
import tempfile

import bpy
import numpy as np

from . import exr
from .materials import output_of, source_of
from .suns import COLUMNS, MOST_COLUMNS, with_suns

# The map's own left edge is -x in Blender and -z in glTF.
ROTATION = -90.0
BAKED = {}

# Runs in a Blender of its own, where a render may begin at any time.
BAKE = """
import bpy, math, sys
blend, name, output, columns = sys.argv[-4:]
bpy.ops.wm.read_factory_settings(use_empty=True)
with bpy.data.libraries.load(blend) as (theirs, ours):
    ours.worlds = [name]
scene = bpy.context.scene
scene.world = ours.worlds[0]
scene.render.engine = "CYCLES"
camera = bpy.data.cameras.new("bake")
scene.camera = bpy.data.objects.new("bake", camera)
scene.collection.objects.link(scene.camera)
scene.camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
camera.type = "PANO"
holder = camera if hasattr(camera, "panorama_type") else camera.cycles
holder.panorama_type = "EQUIRECTANGULAR"
render, cycles = scene.render, scene.cycles
render.resolution_x, render.resolution_y, render.resolution_percentage = int(columns), int(columns) // 2, 100
cycles.device, cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = "CPU", 4, False, False
cycles.pixel_filter_type = "BOX"
render.filepath, render.use_file_extension, render.dither_intensity = output, False, 0
settings = render.image_settings
settings.file_format, settings.color_depth, settings.exr_codec, settings.color_mode = "OPEN_EXR", "32", "ZIP", "RGB"
bpy.ops.render.render(write_still=True)
"""


def options(world, suns, folder, notes):
    """Options of `opsr render` for a world and its suns; maps go to the folder."""
    if world is None:
        return drawn(np.zeros((1, 2, 3), np.float32), suns, folder) if suns else ["--env", "none"]
    background = background_of(world, notes)
    colour = constant(world, background)
    if colour is not None:
        if max(colour) <= 0 and not suns:
            return ["--env", "none"]
        return drawn(np.tile(np.float32(colour), (1, 2, 1)), suns, folder)
    direct = None if suns else image_file(background)
    if direct is not None:
        path, turn, strength = direct
        return ["--env", path, "--env-rotation", f"{ROTATION + turn:g}", "--env-intensity", f"{strength:g}"]
    return drawn(baked(world), suns, folder)


def background_of(world, notes):
    """The node Background at the end of a world, or None for anything else."""
    output = output_of(world.node_tree) if world.use_nodes and world.node_tree else None
    if output is None:
        return None
    if output.inputs["Volume"].is_linked:
        notes.append(f"world {world.name}: its volume is not translated")
    if any(node.type == "LIGHT_PATH" for node in world.node_tree.nodes):
        notes.append(f"world {world.name}: Light Path is not translated: what the camera sees also lights the scene")
    node = source_of(output.inputs["Surface"])
    return node if node is not None and node.type == "BACKGROUND" else None


def constant(world, background):
    """The radiance of a world of one colour, or None."""
    if not (world.use_nodes and world.node_tree):
        return tuple(world.color)
    output = output_of(world.node_tree)
    if output is None or source_of(output.inputs["Surface"]) is None:
        return (0.0, 0.0, 0.0)
    if background is None or any(source_of(background.inputs[name]) is not None for name in ("Color", "Strength")):
        return None
    strength = background.inputs["Strength"].default_value
    return tuple(c * strength for c in background.inputs["Color"].default_value[:3])


def image_file(background):
    """File, turn in degrees and strength of a world that is an equirectangular file turned about the vertical axis; else None."""
    if background is None or source_of(background.inputs["Strength"]) is not None:
        return None
    texture = source_of(background.inputs["Color"])
    if texture is None or texture.type != "TEX_ENVIRONMENT" or texture.image is None:
        return None
    image, turn = texture.image, 0.0
    path = pathlib.Path(bpy.path.abspath(image.filepath, library=image.library))
    linear = image.colorspace_settings.name in ("Linear Rec.709", "Linear", "Linear BT.709")
    plain = texture.projection == "EQUIRECTANGULAR" and image.source == "FILE" and not image.packed_file and linear
    if not plain or path.suffix.lower() not in (".hdr", ".exr") or not path.is_file():
        return None
    mapping = source_of(texture.inputs["Vector"])
    if mapping is not None and mapping.type == "MAPPING":
        values = {each.name: each for each in mapping.inputs}
        about_z = mapping.vector_type == "POINT" and values["Rotation"].default_value[:2] == (0.0, 0.0)
        scaled = tuple(values["Scale"].default_value) != (1.0, 1.0, 1.0)
        moved = tuple(values["Location"].default_value) != (0.0, 0.0, 0.0)
        linked = any(each.is_linked for name, each in values.items() if name != "Vector")
        if not about_z or scaled or moved or linked:
            return None
        turn = -math.degrees(values["Rotation"].default_value[2])
        mapping = source_of(values["Vector"])
    if mapping is not None and mapping.type != "TEX_COORD":
        return None
    return str(path), turn, background.inputs["Strength"].default_value


def baked(world):
    """The map of any world, by Cycles in a Blender of its own; kept until the world changes."""
    key = fingerprint(world)
    if key not in BAKED:
        BAKED.clear()
        BAKED[key] = bake(world)
    return BAKED[key]


def fingerprint(world):
    """A hash of all that a world is made of."""
    words = []
    for node in world.node_tree.nodes if world.node_tree else ():
        for name in node.bl_rna.properties.keys():
            value = getattr(node, name, None)
            image = (value.filepath, len(value.pixels)) if isinstance(value, bpy.types.Image) else None
            words.append(image or (repr(value) if isinstance(value, (int, float, str, bool)) else None))
            if hasattr(value, "__len__") and len(value) in (2, 3, 4) and not isinstance(value, str):
                words.append([repr(each) for each in value])
        for socket in node.inputs:
            value = getattr(socket, "default_value", None)
            words.append(tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else repr(value))
            words += [link.from_node.name + link.from_socket.name for link in socket.links]
    return hashlib.sha256(repr([world.name, words]).encode()).hexdigest()


def bake(world):
    columns = COLUMNS
    for node in world.node_tree.nodes:
        if node.type == "TEX_ENVIRONMENT" and node.image:
            columns = min(max(columns, node.image.size[0]), MOST_COLUMNS)
    with tempfile.TemporaryDirectory(prefix="opsr-world-") as folder:
        blend, script, output = (pathlib.Path(folder) / name for name in ("world.blend", "bake.py", "world.exr"))
        bpy.data.libraries.write(str(blend), {world}, path_remap="ABSOLUTE", fake_user=True)
        script.write_text(BAKE)
        arguments = [str(blend), world.name, str(output), str(columns)]
        blender = [bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1", "--python", str(script), "--"]
        words = blender if bpy.app.binary_path else [sys.executable, str(script)]
        ran = subprocess.run([*words, *arguments], capture_output=True, text=True, check=False)
        if not output.exists():
            said = ran.stderr.strip().splitlines()
            raise RuntimeError(f"the world {world.name} could not be baked: {said[-1] if said else ran.returncode}")
        return exr.layer(exr.read(output), "", "RGB")


def drawn(pixels, suns, folder):
    """Writes a map with suns and returns its options."""
    if suns:
        pixels = with_suns(pixels, suns)
    path = pathlib.Path(folder) / "world.exr"
    exr.write(path, dict(zip("RGB", np.moveaxis(pixels, -1, 0), strict=True)))
    return ["--env", str(path), "--env-rotation", f"{ROTATION:g}"]
