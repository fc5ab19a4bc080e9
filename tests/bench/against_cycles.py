"""Three scenes of Blender by F12, beside Cycles: means of regions, and pictures to look at.

    python tests/bench/against_cycles.py --opsr target/release/opsr --out compared [--spp 256] [glass rings room]

Needs the packages bpy (4.2 or later) and numpy. Writes SCENE.png, with Cycles left and opsr right, and prints a row per region.
"""

import argparse
import math
import os
import pathlib
import sys
import tempfile
import time

try:
    import bpy
    import numpy as np
    from mathutils import Vector
except ImportError as missing:
    sys.exit(f"skipped: {missing}; pip install bpy numpy")

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "python" / "blender"))
import opsr_blender
from opsr_blender import exr

SIZE = (160, 120)
# Microfacets of Cycles: those of one bounce, which opsr has too, or Blender's default.
DISTRIBUTION = "GGX"


def principled(name, **values):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    node.distribution = DISTRIBUTION
    for key, value in values.items():
        socket = node.inputs[key.replace("_", " ")]
        socket.default_value = (*value, 1) if isinstance(value, tuple) else value
    return material


def matt(name, colour):
    return principled(name, Base_Color=colour, Roughness=1.0, Specular_IOR_Level=0.0)


def shader(name, kind, **values):
    """A material of one shader node; returns it and its tree."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    node = tree.nodes.new(kind)
    for key, value in values.items():
        node.inputs[key].default_value = (*value, 1) if isinstance(value, tuple) else value
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return material


def shown(material, smooth=True):
    """Gives the object that was just made a material."""
    made = bpy.context.object
    made.data.materials.append(material)
    if smooth:
        bpy.ops.object.shade_smooth()
    return made


def camera(at, towards, lens=50):
    bpy.ops.object.camera_add(location=at)
    made = bpy.context.object
    made.data.lens = lens
    made.rotation_euler = (made.location - Vector(towards)).to_track_quat("Z", "Y").to_euler()
    bpy.context.scene.camera = made
    return made


def lamp(kind, at, towards, watts, **values):
    bpy.ops.object.light_add(type=kind, location=at)
    made = bpy.context.object
    made.rotation_euler = (made.location - Vector(towards)).to_track_quat("Z", "Y").to_euler()
    made.data.energy = watts
    for key, value in values.items():
        setattr(made.data, key, value)
    return made


def sky_map(folder):
    """A grey sky with two bright panels, as a file."""
    v, u = np.mgrid[0:128, 0:256] / np.array([128, 256]).reshape(2, 1, 1)
    sky = np.stack([0.3 + 0.2 * (1 - v), 0.35 + 0.25 * (1 - v), 0.45 + 0.4 * (1 - v)], axis=-1).astype(np.float32)
    sky[(np.abs(u - 0.3) < 0.05) & (np.abs(v - 0.3) < 0.1)] = (9, 8, 6)
    sky[(np.abs(u - 0.8) < 0.1) & (np.abs(v - 0.35) < 0.05)] = (3, 4, 6)
    path = folder / "sky.exr"
    exr.write(path, dict(zip("RGB", np.moveaxis(sky, -1, 0), strict=True)))
    return path


def world_of(map_file=None, turn=0.0, colour=(0, 0, 0), strength=1.0):
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    tree = world.node_tree
    background = tree.nodes["Background"]
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (*colour, 1), strength
    if map_file is not None:
        texture, mapping, coordinates = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord"))
        texture.image = bpy.data.images.load(str(map_file))
        mapping.inputs["Rotation"].default_value[2] = turn
        tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
        tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    bpy.context.scene.world = world
    return world


def glass(folder):
    """A ball of a Principled BSDF, one of a Glass BSDF that absorbs, and a mixture, on a table under a map that is turned."""
    world_of(sky_map(folder), turn=0.7, strength=1.2)
    bpy.ops.mesh.primitive_cylinder_add(radius=2.2, depth=0.1, location=(0, 0, -0.05), vertices=64)
    shown(matt("table", (0.6, 0.45, 0.3)), smooth=False)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(-0.75, 0, 0.5), segments=64, ring_count=32)
    shown(principled("clear", Base_Color=(0.8, 0.95, 0.9), Transmission_Weight=1.0, Roughness=0.0, IOR=1.45))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0.75, 0, 0.5), segments=64, ring_count=32)
    tinted = shader("tinted", "ShaderNodeBsdfGlass", Color=(1.0, 1.0, 1.0), Roughness=0.0, IOR=1.5)
    tree = tinted.node_tree
    inside = tree.nodes.new("ShaderNodeVolumeAbsorption")
    inside.inputs["Color"].default_value, inside.inputs["Density"].default_value = (0.9, 0.3, 0.2, 1), 0.8
    tree.links.new(inside.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    shown(tinted)
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(0, 1.0, 0.3))
    mixed = shader("mixed", "ShaderNodeMixShader", Fac=0.3)
    tree = mixed.node_tree
    mix = next(node for node in tree.nodes if node.type == "MIX_SHADER")
    for place, colour in ((1, (0.8, 0.1, 0.1, 1)), (2, (0.1, 0.1, 0.8, 1))):
        part = tree.nodes.new("ShaderNodeBsdfPrincipled")
        part.distribution = DISTRIBUTION
        part.inputs["Base Color"].default_value, part.inputs["Roughness"].default_value = colour, 0.6
        tree.links.new(part.outputs[0], mix.inputs[place])
    shown(mixed, smooth=False)
    made = camera((0, -4.2, 2.2), (0, 0.1, 0.35))
    made.data.dof.use_dof, made.data.dof.focus_distance, made.data.dof.aperture_fstop = True, 4.4, 1.4
    return {
        "clear ball": (0.2, 0.38, 0.42, 0.68),
        "tinted ball": (0.58, 0.38, 0.8, 0.68),
        "mixed cube": (0.43, 0.3, 0.57, 0.42),
        "table before": (0.3, 0.72, 0.7, 0.84),
        "sky": (0.0, 0.0, 1.0, 0.12),
        "all": (0, 0, 1, 1),
    }


def rings(_):
    """Three rings of metal under two spots with a radius and an area lamp."""
    world_of()
    bpy.ops.mesh.primitive_plane_add(size=12)
    shown(matt("floor", (0.5, 0.5, 0.55)), smooth=False)
    metals = [((1.0, 0.77, 0.34), 0.2), ((0.9, 0.9, 0.92), 0.25), ((0.95, 0.6, 0.5), 0.3)]
    for k, (colour, roughness) in enumerate(metals):
        at = (1.3 * (k - 1), 0.3 * (k % 2), 0.25)
        bpy.ops.mesh.primitive_torus_add(major_radius=0.5, minor_radius=0.12, location=at, major_segments=96, minor_segments=32)
        shown(principled(f"ring {k}", Base_Color=colour, Metallic=1.0, Roughness=roughness))
        bpy.context.object.scale.z = 2.0
    lamp("SPOT", (-2, -1.5, 3), (-0.6, 0, 0), 300, shadow_soft_size=0.1, spot_size=0.7, spot_blend=0.5, color=(1, 0.85, 0.7))
    lamp("SPOT", (2.2, 1, 3), (0.6, 0, 0), 250, shadow_soft_size=0.15, spot_size=0.8, spot_blend=0.2, color=(0.7, 0.85, 1))
    lamp("AREA", (0, 3, 2.5), (0, 0, 0), 80, shape="RECTANGLE", size=1.5, size_y=0.5)
    camera((0, -3.6, 2.8), (0, 0.1, 0.1))
    return {
        "left ring": (0.1, 0.4, 0.36, 0.7),
        "middle ring": (0.38, 0.4, 0.62, 0.65),
        "right ring": (0.64, 0.4, 0.9, 0.7),
        "floor before": (0.3, 0.75, 0.7, 0.95),
        "floor behind": (0.3, 0.05, 0.7, 0.25),
        "all": (0, 0, 1, 1),
    }


def room(_):
    """A room with a window, a sun of half a degree through it, and a sky of one colour."""
    world_of(colour=(0.5, 0.7, 1.0), strength=1.5)
    walls = matt("walls", (0.75, 0.73, 0.7))
    boxes = [
        ((0, 0, -0.05), (4, 5, 0.1)),
        ((0, 0, 2.55), (4, 5, 0.1)),
        ((-2.05, 0, 1.25), (0.1, 5.2, 2.7)),
        ((0, 2.55, 1.25), (4.2, 0.1, 2.7)),
        ((0, -2.55, 1.25), (4.2, 0.1, 2.7)),
        ((2.05, 0, 0.4), (0.1, 5.2, 1.0)),
        ((2.05, 0, 2.3), (0.1, 5.2, 0.6)),
        ((2.05, 1.75, 1.45), (0.1, 1.7, 1.1)),
        ((2.05, -1.75, 1.45), (0.1, 1.7, 1.1)),
    ]
    for at, size in boxes:
        bpy.ops.mesh.primitive_cube_add(size=1, location=at)
        bpy.context.object.scale = size
        shown(walls, smooth=False)
    bpy.ops.mesh.primitive_cube_add(size=0.7, location=(-0.6, 0.9, 0.35), rotation=(0, 0, 0.5))
    shown(principled("box", Base_Color=(0.2, 0.5, 0.3), Roughness=0.4), smooth=False)
    lamp("SUN", (6, -2, 5), (0, 0.3, 0), 5, angle=math.radians(0.53))
    camera((-0.2, -2.3, 1.4), (0.1, 1.5, 0.9), lens=20)
    return {
        "far wall": (0.4, 0.2, 0.6, 0.45),
        "ceiling": (0.3, 0.02, 0.7, 0.15),
        "floor": (0.25, 0.7, 0.85, 0.95),
        "left wall": (0.02, 0.25, 0.2, 0.6),
        "all": (0, 0, 1, 1),
    }


SCENES = {"glass": glass, "rings": rings, "room": room}


def render(engine, folder, spp):
    """The picture of an engine, and its seconds."""
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    if engine == "CYCLES":
        cycles = scene.cycles
        cycles.device, cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = "CPU", spp, False, False
        # All light: without clamping, filter glossy, or light that is cut off.
        cycles.pixel_filter_type, cycles.sample_clamp_indirect, cycles.blur_glossy = "BOX", 0, 0
        cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 15
    else:
        scene.opsr.spp, scene.opsr.table = spp, ""
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "ZIP"
    scene.render.filepath = str(folder / f"{engine}.exr")
    begun = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    seconds = time.perf_counter() - begun
    return exr.layer(exr.read(scene.render.filepath), "", "RGB"), seconds


def compare(name, folder, spp):
    """Renders a scene twice; returns ratios of regions, both pictures and their seconds."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    regions = SCENES[name](folder)
    (theirs, slow), (ours, fast) = (render(engine, folder, spp) for engine in ("CYCLES", "OPSR"))
    ratios = {}
    for region, (left, top, right, bottom) in regions.items():
        across, down = slice(int(left * SIZE[0]), int(right * SIZE[0])), slice(int(top * SIZE[1]), int(bottom * SIZE[1]))
        ratios[region] = float(ours[down, across].mean() / theirs[down, across].mean())
    return ratios, (theirs, ours), (slow, fast)


def save_png(path, pictures):
    """Pictures side by side, with one exposure."""
    both = np.concatenate([pictures[0], np.ones((SIZE[1], 4, 3), np.float32), pictures[1]], axis=1)
    both = both / np.percentile(pictures[0], 97)
    shown = np.clip(both, 0, 1)
    shown = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
    image = bpy.data.images.new("both", both.shape[1], both.shape[0])
    image.pixels.foreach_set(np.dstack([shown, np.ones(shown.shape[:2])])[::-1].astype(np.float32).reshape(-1))
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--opsr", default="target/release/opsr")
    parser.add_argument("--out", default="compared", type=pathlib.Path)
    parser.add_argument("--spp", default=256, type=int)
    parser.add_argument("--defaults", action="store_true", help="with the microfacets that Blender has by default, of many bounces")
    args = parser.parse_args()
    if args.defaults:
        global DISTRIBUTION
        DISTRIBUTION = "MULTI_GGX"
    os.environ["OPSR"] = str(pathlib.Path(args.opsr).absolute())
    args.out.mkdir(parents=True, exist_ok=True)
    opsr_blender.register()
    for name in args.scenes:
        with tempfile.TemporaryDirectory() as folder:
            ratios, pictures, seconds = compare(name, pathlib.Path(folder), args.spp)
        save_png(args.out / f"{name}.png", pictures)
        for region, ratio in ratios.items():
            print(f"| {name} | {region} | {ratio:.3f} |")
        print(f"| {name} | seconds, Cycles and opsr | {seconds[0]:.1f}, {seconds[1]:.1f} |", flush=True)
    opsr_blender.unregister()


if __name__ == "__main__":
    main()
