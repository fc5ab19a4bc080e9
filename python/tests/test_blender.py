"""The Blender add-on, where there is the package `bpy`: scenes of Blender's own by F12."""

import importlib
import math
import pathlib
import subprocess
import sys
import time
import types
import zipfile

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip install bpy")

FOLDER = pathlib.Path(__file__).parents[1] / "blender"
sys.path.insert(0, str(FOLDER))
import opsr_blender  # noqa: E402
from opsr_blender import engine, export, exr, world  # noqa: E402


@pytest.fixture(scope="module", autouse=True)
def addon():
    opsr_blender.register()
    yield
    opsr_blender.unregister()


def matt(name, value):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (value, value, value, 1)
    inputs["Specular IOR Level"].default_value, inputs["Roughness"].default_value = 0, 1
    return material


@pytest.fixture
def scene(program, monkeypatch):
    """A floor of albedo 1/2 under a point lamp of 100 W, one metre above it, and a black ball that is out of sight at frame 1."""
    monkeypatch.setenv("OPSR", str(program))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=20)
    bpy.context.object.data.materials.append(matt("floor", 0.5))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3)
    ball = bpy.context.object
    ball.data.materials.append(matt("ball", 0.0))
    for frame, height in ((1, -9), (10, 0.4)):
        ball.location.z = height
        ball.keyframe_insert("location", frame=frame)
    bpy.ops.object.light_add(type="POINT", location=(0, 0, 1))
    bpy.context.object.data.energy = 100
    bpy.ops.object.camera_add(location=(0, 0, 4))
    bpy.context.object.name = "above"
    scene.camera = bpy.context.object
    scene.frame_set(1)
    scene.render.engine = "OPSR"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 50
    # Means of samples: blurs lower peaks, and know nothing beyond a region.
    scene.opsr.spp, scene.opsr.table, scene.opsr.denoise, scene.opsr.more = 16, "", False, "--resolve raw"
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "ZIP"
    return scene


def picture(scene, folder):
    scene.render.filepath = str(folder / "picture.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    read = exr.layer(exr.read(scene.render.filepath), "", "RGB")
    assert read.shape == (24, 32, 3)
    return read


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_lamps_have_the_brightness_of_blender(scene, tmp_path, radius):
    next(o for o in scene.objects if o.type == "LIGHT").data.shadow_soft_size = radius
    seen = picture(scene, tmp_path)[11:13, 15:17].mean()
    # A lamp of W watts has the radiant intensity W / (4 pi), as in Cycles; one metre below it a white floor has 1 / pi of
    # that, this one half. The camera above does not see the lamp.
    assert seen == pytest.approx(100 / (4 * math.pi) / math.pi / 2, rel=0.03)


def test_animations_show_their_frames(scene, tmp_path):
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 10, 9
    scene.render.filepath = str(tmp_path / "frame_")
    assert bpy.ops.render.render(animation=True) == {"FINISHED"}
    first, last = (exr.layer(exr.read(tmp_path / f"frame_{n:04}.exr"), "", "RGB") for n in (1, 10))
    assert first[11:13, 15:17].mean() > 1 and last[11:13, 15:17].mean() < 0.1


def test_passes_come_along(scene, tmp_path):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type, settings.use_exr_interleave = "MULTI_LAYER_IMAGE", True
    settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.filepath = str(tmp_path / "layers.exr")
    bpy.ops.render.render(write_still=True)
    layers = exr.read(scene.render.filepath)
    layers = {name.split(".", 1)[1]: values for name, values in layers.items()}
    assert layers["Normal.Z"] == pytest.approx(1, abs=1e-3) and layers["Albedo.R"] == pytest.approx(0.5, abs=1e-3)
    assert layers["Depth.Z"][12, 16] == pytest.approx(4, rel=0.01)
    assert 0 < layers["Error.X"].mean() < 1


@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_a_map_lights_the_floor(scene, tmp_path, turn):
    sky = np.full((8, 16, 3), (0.25, 0.5, 1.0), np.float32)
    exr.write(tmp_path / "sky.exr", dict(zip("RGB", np.moveaxis(sky, -1, 0), strict=True)))
    nodes = a_world(scene)
    texture, mapping = nodes.nodes.new("ShaderNodeTexEnvironment"), nodes.nodes.new("ShaderNodeMapping")
    texture.image = bpy.data.images.load(str(tmp_path / "sky.exr"))
    mapping.inputs["Rotation"].default_value[2] = turn
    nodes.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    nodes.links.new(texture.outputs["Color"], nodes.nodes["Background"].inputs["Color"])
    nodes.nodes["Background"].inputs["Strength"].default_value = 2
    options = world.options(scene.world, [], tmp_path, [])
    assert float(options[3]) == pytest.approx(-90 - math.degrees(turn), abs=0.01) and options[-1] == "2"
    # A sky of twice that over a floor of albedo 1/2.
    np.testing.assert_allclose(picture(scene, tmp_path).mean(axis=(0, 1)), [0.25, 0.5, 1.0], rtol=0.05)


def a_world(scene):
    """A world with nodes; the lamp goes."""
    for lamp in [each for each in scene.objects if each.type == "LIGHT"]:
        bpy.data.objects.remove(lamp)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    return scene.world.node_tree


def test_other_worlds_are_baked_as_blender_turns_them(scene, monkeypatch):
    monkeypatch.setattr(world, "COLUMNS", 256)
    nodes = a_world(scene)
    gradient, coordinates, split = (nodes.nodes.new(f"ShaderNode{kind}") for kind in ("CombineXYZ", "TexCoord", "SeparateXYZ"))
    nodes.links.new(coordinates.outputs["Generated"], split.inputs[0])
    for place in range(3):
        nodes.links.new(split.outputs[place], gradient.inputs[place])
    nodes.links.new(gradient.outputs[0], nodes.nodes["Background"].inputs["Color"])
    baked = world.baked(scene.world)
    # The colour is the direction: +x is in the middle of Blender's maps, +y a quarter to the left, and up is up.
    assert baked.shape == (128, 256, 3)
    for (row, column), axis in {(64, 128): 0, (64, 64): 1, (0, 0): 2}.items():
        assert baked[row, column] == pytest.approx(np.eye(3)[axis], abs=0.03)
    assert world.baked(scene.world) is baked


def test_what_is_lost_is_listed(scene, tmp_path, capfd):
    tree = bpy.data.materials["floor"].node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.ops.object.light_add(type="AREA", location=(3, 0, 3))
    bpy.context.object.data.spread = 0.5
    scene.render.use_motion_blur = True
    picture(scene, tmp_path)
    listed = capfd.readouterr().out
    for said in ("Base Color comes from Noise Texture", "its spread is shown as 180", "motion blur"):
        assert said in listed


def test_lens_and_shift_go_along(scene, tmp_path):
    data = scene.camera.data
    data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop, data.lens = True, 2.5, 2.0, 80
    data.shift_x, data.shift_y = 0.25, -0.125
    out = export.scene(bpy.context.evaluated_depsgraph_get(), tmp_path)
    words = export.camera(out, scene.camera, (32, 24), (0, 0, 32, 24), out.notes)
    assert words == ["--camera", "above", "--size", "48x32", "--crop", "16,8,32,24"]
    (made,) = out.glb.json["cameras"]
    assert made["extras"] == pytest.approx({"apertureRadius": 0.02, "focusDistance": 2.5})
    assert made["perspective"]["yfov"] == pytest.approx(2 * math.atan(32 / 32 * 36 / 80 / 2), rel=1e-5)


def test_a_region_is_a_part_of_the_picture(scene, tmp_path):
    whole = picture(scene, tmp_path)
    render = scene.render
    render.use_border, render.use_crop_to_border = True, True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
    render.filepath = str(tmp_path / "part.exr")
    bpy.ops.render.render(write_still=True)
    part = exr.layer(exr.read(render.filepath), "", "RGB")
    np.testing.assert_array_equal(part, whole[:12, 8:24])
    render.use_crop_to_border = False
    bpy.ops.render.render(write_still=True)
    framed = exr.layer(exr.read(render.filepath), "", "RGB")
    np.testing.assert_array_equal(framed[:12, 8:24], whole[:12, 8:24])
    assert framed.shape == whole.shape and framed[13:].max() == 0


def test_a_scene_of_nothing_and_another_scene(scene, tmp_path):
    other = bpy.data.scenes.new("other")
    other.camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    other.collection.objects.link(other.camera)
    other.world = bpy.data.worlds.new("grey")
    other.world.use_nodes = True
    background = other.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = (0.5, 0.5, 0.5, 1), 0.5
    other.render.engine, other.opsr.spp, other.opsr.table, other.opsr.denoise = "OPSR", 2, "", False
    for name in ("resolution_x", "resolution_y", "resolution_percentage"):
        setattr(other.render, name, getattr(scene.render, name))
    other.render.image_settings.file_format, other.render.image_settings.color_depth = "OPEN_EXR", "32"
    other.render.filepath = str(tmp_path / "other.exr")
    bpy.ops.render.render(write_still=True, scene="other")
    assert exr.layer(exr.read(other.render.filepath), "", "RGB") == pytest.approx(0.25, abs=1e-3)


def test_pictures_are_denoised_where_blender_has_the_library(scene, tmp_path, monkeypatch):
    next(o for o in scene.objects if o.type == "LIGHT").data.shadow_soft_size = 0.9
    scene.opsr.property_unset("denoise")
    scene.opsr.spp, scene.opsr.more = 4, "--resolve none"
    assert engine.library() is not None and "--denoise" in engine.settings(scene)
    denoised = picture(scene, tmp_path)
    monkeypatch.setattr(engine, "library", lambda: None)
    assert "--denoise" not in engine.settings(scene)
    noisy = picture(scene, tmp_path)
    rough = [np.abs(np.diff(seen[..., 0], n=2, axis=1)).mean() for seen in (denoised, noisy)]
    assert rough[0] < 0.5 * rough[1] and denoised.mean() == pytest.approx(noisy.mean(), rel=0.03)
    # A choice by hand stands without the library: it is an error there. Another by words is the same.
    scene.opsr.denoise = True
    assert "--denoise" in engine.settings(scene)
    scene.opsr.more = "--denoise"
    assert engine.settings(scene).count("--denoise") == 1
    scene.opsr.more = ""
    scene.opsr.denoise = False
    monkeypatch.undo()
    assert "--denoise" not in engine.settings(scene)


def test_errors_are_the_first_line_of_the_program(scene, monkeypatch):
    scene.opsr.more = "--none"
    with pytest.raises(RuntimeError, match="unexpected argument '--none'"):
        bpy.ops.render.render()
    monkeypatch.setenv("OPSR", "/none/opsr")
    with pytest.raises(RuntimeError, match="/none/opsr: no such program"):
        bpy.ops.render.render()


def test_motion_of_a_film_is_the_vector_pass(program, tmp_path):
    # A camera that travels and turns, and a box that moves otherwise.
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=20)
    bpy.ops.mesh.primitive_cube_add(size=0.6)
    box = bpy.context.object
    bpy.ops.object.camera_add(location=(0, -3, 3), rotation=(math.radians(45), 0, 0))
    scene.camera = bpy.context.object
    for frame, side in ((0, -1), (4, 1)):
        box.location = (-0.3 * side, 0, 0.4 + 0.1 * side)
        scene.camera.location.x, scene.camera.rotation_euler.z = 0.2 * side, -0.05 * side
        for moving, path in ((box, "location"), (scene.camera, "location"), (scene.camera, "rotation_euler")):
            moving.keyframe_insert(path, frame=frame)
    for moving in (box, scene.camera):
        for curve in moving.animation_data.action.fcurves:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
    render, size = scene.render, (64, 48)
    render.fps, scene.frame_start, scene.frame_end = 24, 0, 4
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1, False
    # Blender's only sample is near the centre of its pixel then.
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    scene.view_layers[0].use_pass_vector = True
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    render.image_settings.exr_codec, render.filepath = "ZIP", str(tmp_path / "theirs.exr")
    scene.frame_set(2)
    bpy.ops.render.render(write_still=True)
    theirs = exr.layer(exr.read(tmp_path / "theirs.exr"), "ViewLayer.Vector", "XYZW")
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "scene.glb"), export_cameras=True, export_frame_range=False)
    words = ["--size", "{}x{}".format(*size), "--spp", "1", "--integrator", "path", "--frames", "1..3", "--aov", "motion"]
    words = [program, "render", tmp_path / "scene.glb", *words, "-o", tmp_path / "ours_#.exr"]
    subprocess.run(words, check=True, capture_output=True)
    ours = exr.layer(exr.read(tmp_path / "ours_2.exr"), "motion", "XYZW")
    # Their way to the next frame points back from it. At edges of the box the rays of a pixel meet another surface.
    difference = np.abs(theirs * [1, 1, -1, -1] - ours).max(-1)
    assert np.ptp(ours[..., 0]) > 2 and (difference < 1e-3).mean() > 0.98, np.sort(difference.ravel())[-80:]


def test_viewports_show_what_f12_shows(scene, tmp_path):
    viewport = pytest.importorskip("opsr_blender.viewport", reason="no module gpu")
    scene.opsr.view_spp = 16
    shown = viewport.Viewport()
    projection = scene.camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=32, y=24)
    pose = scene.camera.matrix_world.inverted()
    seen = types.SimpleNamespace(view_matrix=pose, window_matrix=projection, view_perspective="CAMERA")
    context = types.SimpleNamespace(region=types.SimpleNamespace(width=32, height=24), region_data=seen, scene=scene)
    shown.refiner.quiet = 0.0
    shown.refiner.changed()
    shown.refiner.look(viewport.view_of(context))
    begun = time.monotonic()
    while (shown.refiner.running or shown.refiner.pending) and time.monotonic() < begun + 30:
        shown.refiner.tick()
        time.sleep(0.02)
    # The same seed and view make the same picture, rows from the bottom.
    np.testing.assert_allclose(shown.refiner.picture[::-1, :, :3], picture(scene, tmp_path), rtol=1e-3)
    shown.close()
    assert not shown.folder.exists()


def test_the_folder_installs_as_an_extension(tmp_path):
    archive = tmp_path / "opsr_blender.zip"
    with zipfile.ZipFile(archive, "w") as written:
        for path in (FOLDER / "opsr_blender").iterdir():
            if path.suffix in (".py", ".toml"):
                written.write(path, f"opsr_blender/{path.name}")
    utils = importlib.import_module("addon_utils")
    known = {module.__name__ for module in utils.modules(refresh=True)}
    bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=False)
    new = {module.__name__ for module in utils.modules(refresh=True)} - known
    try:
        assert any(name.endswith("opsr_blender") for name in new | known)
    finally:
        bpy.ops.extensions.package_uninstall(repo_index=repository(), pkg_id="opsr_blender")


def repository():
    names = [repo.module for repo in bpy.context.preferences.extensions.repos]
    return names.index("user_default")
