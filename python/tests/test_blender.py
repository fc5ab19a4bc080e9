"""The Blender add-on, where there is the package `bpy`: a scene of Blender's own, exported, rendered and loaded back."""

import importlib.util
import math
import pathlib

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip install bpy")

ADDON = pathlib.Path(__file__).parents[1] / "blender" / "opsr_blender.py"


@pytest.fixture(scope="module")
def addon():
    spec = importlib.util.spec_from_file_location("opsr_blender", ADDON)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.register()
    yield module
    module.unregister()


@pytest.fixture
def scene(addon, program, monkeypatch):
    """A floor under a point lamp of 100 W, one metre above it, and a glass ball that is out of sight at frame 1."""
    monkeypatch.setenv("OPSR", str(program))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=20)
    floor = bpy.data.materials.new("floor")
    floor.use_nodes = True
    floor.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1)
    floor.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0
    floor.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 1
    bpy.context.object.data.materials.append(floor)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(0, 0, 0.4))
    ball, glass = bpy.context.object, bpy.data.materials.new("glass")
    glass.use_nodes = True
    glass.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1
    glass.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0
    ball.data.materials.append(glass)
    ball.location.z = -9
    ball.keyframe_insert("location", frame=1)
    ball.location.z = 0.4
    ball.keyframe_insert("location", frame=10)
    bpy.ops.object.light_add(type="POINT", location=(0, 0, 1))
    bpy.context.object.data.energy = 100
    bpy.ops.object.camera_add(location=(0, 0, 4))
    bpy.context.object.name = "above"
    scene.camera = bpy.context.object
    scene.frame_set(1)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 50
    scene.opsr.spp, scene.opsr.table = 16, ""
    return scene


def picture(scene, folder):
    """Renders and returns the radiance of the image, rows from the bottom."""
    assert bpy.ops.render.opsr() == {"FINISHED"}
    image = bpy.data.images[f"opsr {scene.name}"]
    # Of images with several layers Blender gives the pixels to files only.
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    image.save_render(str(folder / "combined.exr"))
    bpy.data.images.remove(image)
    plain = bpy.data.images.load(str(folder / "combined.exr"))
    assert tuple(plain.size) == (32, 24) and plain.is_float
    pixels = np.array(plain.pixels[:]).reshape(24, 32, 4)
    bpy.data.images.remove(plain)
    return pixels[..., :3]


def test_addon_renders_a_lamp_with_the_brightness_of_blender(scene, tmp_path):
    seen = picture(scene, tmp_path)[11:13, 15:17].mean()
    # A lamp of W watts has the radiant intensity W / (4 pi), as in Cycles; one metre below it a white floor has 1 / pi of
    # that, this one half.
    assert seen == pytest.approx(100 / (4 * math.pi) / math.pi / 2, rel=0.05)


def test_addon_exports_the_current_frame_and_its_options(scene, addon, tmp_path):
    plain = picture(scene, tmp_path)
    scene.frame_set(10)
    scene.opsr.table, scene.opsr.integrator, scene.opsr.more = "beta-0.05", "bdpt", "--seed 3 --max-vertices 6"
    ball = picture(scene, tmp_path)
    assert abs(ball - plain)[8:16, 12:20].mean() > 0.1 * plain.mean()
    words = addon.command(scene, "opsr", "scene.glb", "out.exr")
    assert words[words.index("--opsr-table") + 1] == "beta-0.05" and words[-2:] == ["--max-vertices", "6"]
    assert words[words.index("--size") + 1] == "32x24" and words[words.index("--camera") + 1] == "above"
    assert "--solid-glass" in words and "--denoise" not in words


def test_addon_exports_an_environment_map(scene, addon, tmp_path):
    sky = tmp_path / "sky.hdr"
    # (0.25, 0.5, 1) as mantissas of 8 bits under the exponent 1.
    sky.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n" + bytes([32, 64, 128, 129]) * 8)
    image = bpy.data.images.load(str(sky))
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    nodes = scene.world.node_tree
    texture = nodes.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    nodes.links.new(texture.outputs["Color"], nodes.nodes["Background"].inputs["Color"])
    nodes.nodes["Background"].inputs["Strength"].default_value = 2
    for lamp in [each for each in scene.objects if each.type == "LIGHT"]:
        bpy.data.objects.remove(lamp)
    assert addon.environment(scene.world)[-2:] == ["--env-intensity", "2.0"]
    seen = picture(scene, tmp_path)
    # A sky of twice that over a floor of albedo 1/2.
    np.testing.assert_allclose(seen.mean(axis=(0, 1)), [0.25, 0.5, 1.0], rtol=0.05)


def test_addon_reports_errors_of_the_program(scene, monkeypatch):
    scene.opsr.more = "--none"
    with pytest.raises(RuntimeError, match="--help"):
        bpy.ops.render.opsr()
    monkeypatch.setenv("OPSR", "/none/opsr")
    with pytest.raises(RuntimeError, match="/none/opsr: no such program"):
        bpy.ops.render.opsr()
