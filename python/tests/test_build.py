"""Scenes of numpy arrays, changes, pickles, and files of other renderers."""

import copy
import pathlib
import pickle

import numpy as np
import pytest

import opsr

SCENES = pathlib.Path(__file__).parents[2] / "tests" / "data" / "scenes"

QUAD = {"positions": np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]), "triangles": [[0, 1, 2], [0, 2, 3]]}
CAMERA = {"position": [0, 1, 0], "target": [0, 0, 0], "up": [0, 0, -1], "fov": 60}


def plane(**more):
    return opsr.Scene.build(
        [QUAD | {"material": {"color": [0.5, 0.25, 1.0], "name": "floor"}}],
        lights=[{"type": "directional", "direction": [0, -1, 0], "irradiance": 2}],
        cameras=[CAMERA],
        **more,
    )


def mean(scene, **options):
    return opsr.render(scene, spp=4, size=(8, 8), **options).picture.mean((0, 1))


def test_built_plane_has_the_radiance_of_the_closed_form():
    np.testing.assert_allclose(mean(plane()), np.array([0.5, 0.25, 1.0]) * 2 / np.pi, rtol=1e-5)
    lit = plane(environment=[0.1, 0.2, 0.3])
    expected = np.array([0.5, 0.25, 1.0]) * (2 / np.pi + np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(opsr.render(lit, spp=256, size=(8, 8)).picture.mean((0, 1)), expected, rtol=0.02)


def test_changes_leave_the_scene_alone():
    scene = plane()
    before = mean(scene)
    dark = scene.changed(materials={"floor": {"color": 0.1}})
    np.testing.assert_allclose(mean(dark), 0.2 / np.pi, rtol=1e-5)
    assert dark.materials == ["floor"] and dark.sha256 != scene.sha256
    dim = scene.changed(lights=[{"type": "directional", "direction": [0, -1, 0], "irradiance": 1}])
    np.testing.assert_allclose(mean(dim), before / 2, rtol=1e-5)
    away = scene.changed(cameras=[CAMERA | {"position": [0, 1, 50], "target": [0, 9, 99], "up": [0, 1, 0]}])
    assert not mean(away).any()
    np.testing.assert_array_equal(mean(scene), before)


def test_shapes_and_poses():
    pose = np.diag([2.0, 2.0, 2.0, 1.0])
    scene = opsr.Scene.build(
        [{"shape": "sphere", "to_world": pose, "flip": True, "material": {"color": 0.5, "emission": 0.5}}],
        cameras=[CAMERA],
    )
    # A furnace: 0.5 emitted, half of all reflected.
    np.testing.assert_allclose(opsr.render(scene, spp=64, size=(8, 8)).picture.mean(), 1.0, rtol=0.01)


@pytest.mark.parametrize("kind", ["glass", "metal", "wall", "coated", "diffuse"])
def test_every_material_renders(kind):
    scene = opsr.Scene.build(
        [{"shape": "cube", "material": {"type": kind, "alpha": 0.2, "color": 0.9}}],
        cameras=[CAMERA | {"position": [0, 4, 3], "up": [0, 1, 0]}],
        environment=1.0,
    )
    picture = opsr.render(scene, spp=8, size=(16, 16)).picture
    assert np.isfinite(picture).all() and 0.3 < picture.mean() <= 1.02


@pytest.mark.parametrize(
    "mesh, message",
    [
        ({"positions": [[0, 0, 0]], "triangles": [[0, 0, 1]]}, r"meshes\[0\].*triangles"),
        ({"shape": "torus"}, "no `torus`"),
        ({"shape": "cube", "colour": 1}, "no `colour`"),
        ({"shape": "cube", "material": {"type": "wood"}}, "no `wood`"),
        ({"shape": "cube", "material": {"alpha": 2}}, "alpha"),
        ({"shape": "cube", "to_world": np.ones((3, 4))}, "to_world"),
        ({"positions": [[0, 0, np.nan]], "triangles": []}, "not finite"),
    ],
)
def test_what_is_no_scene_is_an_error(mesh, message):
    with pytest.raises(ValueError, match=message):
        opsr.Scene.build([mesh])


def test_pickles_are_the_same():
    loaded = opsr.Scene.load(SCENES / "pool.xml")
    for scene in (plane(), plane().changed(materials={0: {"color": 0.2}}), loaded):
        again = pickle.loads(pickle.dumps(scene))
        assert again.sha256 == scene.sha256
        np.testing.assert_array_equal(mean(again), mean(scene))
    table = opsr.Table.load("beta-0.001").tuned(0.5)
    again = copy.deepcopy(table)
    assert again.scale == table.scale and again.sha256 == table.sha256


def test_foreign_scenes_are_loaded(tmp_path):
    scenes = [opsr.Scene.load(SCENES / f"glass.{kind}") for kind in ("xml", "pbrt")]
    pictures = [opsr.render(scene, spp=64).picture for scene in scenes]
    assert pictures[0].shape == pictures[1].shape == (32, 48, 3)
    np.testing.assert_allclose(pictures[0].mean((0, 1)), pictures[1].mean((0, 1)), rtol=0.02)
    path = tmp_path / "a.xml"
    path.write_text('<scene version="3.0.0"><shape type="sphere"><bsdf type="hair"/></shape></scene>')
    with pytest.raises(ValueError, match="line 1: bsdf `hair`"):
        opsr.Scene.load(path, unsupported="error")
    with pytest.warns(UserWarning, match="`hair` is not supported: shown as a glossy surface of its colour"):
        opsr.Scene.load(path)
    path.write_text('<scene version="3.0.0"><shape type="heightfield"/></scene>')
    with pytest.raises(ValueError, match="line 1: shape `heightfield`"):
        opsr.Scene.load(path)
    with pytest.warns(UserWarning, match="shape `heightfield` is not supported"):
        opsr.Scene.load(path, unsupported="skip")


def test_example_of_a_caustic_runs(tmp_path, monkeypatch):
    render = opsr.render
    monkeypatch.setattr(opsr, "render", lambda scene, **more: render(scene, **more | {"spp": 1, "size": (32, 24)}))
    monkeypatch.chdir(tmp_path)
    example = pathlib.Path(__file__).parents[1] / "examples" / "caustic.py"
    exec(compile(example.read_text(), example.name, "exec"), {})
    assert (tmp_path / "caustic.png").exists()


def test_media_dim_what_is_behind_them_and_keep_what_they_scatter():
    sigma = np.array([0.1, 0.5, 2.0])
    wall = QUAD | {"material": {"color": 0, "emission": 1}}
    dimmed = opsr.Scene.build([wall], cameras=[CAMERA | {"fov": 0.5}], medium={"absorption": sigma})
    np.testing.assert_allclose(mean(dimmed), np.exp(-sigma), rtol=1e-3)
    cloud = {"type": "glass", "ior": 1, "medium": {"scattering": [1, 2, 4], "g": 0.6}}
    ball = {"shape": "sphere", "material": cloud}
    camera = {"position": [0, 0, 4], "target": [0, 0, 0], "fov": 20}
    furnace = opsr.Scene.build([ball], cameras=[camera], environment=1)
    picture = opsr.render(furnace, spp=256, size=(8, 8), max_vertices=200).picture
    np.testing.assert_allclose(picture.mean((0, 1)), 1, rtol=0.03)
    with pytest.raises(ValueError, match="medium"):
        opsr.Scene.build([QUAD | {"material": {"medium": {"scattering": 1}}}])
    with pytest.raises(ValueError, match="integrator: guided knows no media"):
        opsr.render(furnace, spp=1, size=(8, 8), integrator="guided")
