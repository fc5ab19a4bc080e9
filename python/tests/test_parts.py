"""Renders in parts, and what the program has that `render` has too."""

import pickle
import subprocess

import numpy as np
import pytest

import opsr
from conftest import SCENES

SCENE = SCENES / "cornell_caustics.glb"
SMALL = {"size": (24, 16), "spp": 6}


@pytest.mark.parametrize(
    "options",
    [{"aov": ["alpha", "direct"]}, {"table": 0.3, "levels": 3, "aov": True}, {"integrator": "bdpt"}, {"integrator": "mlt"}],
    ids=["path", "levels", "bdpt", "mlt"],
)
def test_parts_merge_to_the_bytes_of_the_single_render(box, tmp_path, options):
    assert opsr.render(box, part=tmp_path / "a", crop=(0, 0, 24, 5), **SMALL, **options) is None
    opsr.render(box, part=tmp_path / "b", crop=(0, 5, 24, 11), samples=(2, 6), **SMALL, **options)
    opsr.render(box, part=tmp_path / "c", crop=(0, 5, 24, 11), samples=(0, 2), **SMALL, **options)
    film = opsr.merge([tmp_path / "c", tmp_path / "a", tmp_path / "b"], spp=6)
    single = opsr.render(box, **SMALL, **options)
    film.save(tmp_path / "all.exr")
    single.save(tmp_path / "one.exr")
    assert (tmp_path / "all.exr").read_bytes() == (tmp_path / "one.exr").read_bytes()
    assert film.aovs.keys() == single.aovs.keys()
    with pytest.raises(ValueError, match=r"missing samples: 0\.\.2 within 24x11 pixels at \(0, 5\)"):
        opsr.merge([tmp_path / "a", tmp_path / "b"])
    with pytest.raises(ValueError, match="both have samples"):
        opsr.merge([tmp_path / "a", tmp_path / "a", tmp_path / "b", tmp_path / "c"])
    opsr.render(box, part=tmp_path / "d", samples=(6, 7), size=(24, 16), seed=1, **options)
    with pytest.raises(ValueError, match="belongs to other settings"):
        opsr.merge([tmp_path / name for name in "abcd"])
    with pytest.raises(FileNotFoundError):
        opsr.merge([tmp_path / "none"])


@pytest.mark.parametrize(
    "options, words",
    [
        ({"samples": (0, 2)}, "samples: needs a part"),
        ({"part": "x", "samples": (2, 2)}, "samples: expected"),
        ({"part": "x", "time": 1}, "time: a part has a number of samples"),
        ({"part": "x", "aov": "id"}, "aov: a part keeps no"),
        ({"aov": "colour"}, "no layer `colour`: there are albedo, normal"),
        ({"aov": "direct", "table": 0.3, "levels": 3}, "aov: emission, direct and indirect"),
        ({"aov": "level", "resolve": "raw"}, "aov: level needs several levels"),
        ({"consistent": 0.2}, "consistent: needs table"),
        ({"consistent": 0.7, "table": 0.2}, "between 0 and 0.5"),
        ({"filter": 2}, "filter: needs mode=filter-glossy"),
        ({"filter": -1, "mode": "filter-glossy"}, "filter: expected"),
        ({"table_scale": 2}, "table_scale: needs table"),
        ({"radius": 0, "integrator": "vcm"}, "radius: expected"),
        ({"radius": 0.1}, "radius: needs integrator vcm or sppm"),
        ({"radius_alpha": 1.5, "integrator": "sppm"}, "radius_alpha: expected"),
        ({"connections": "some", "integrator": "vcm"}, "connections: expected all or nee"),
        ({"connections": "nee"}, "connections: needs integrator vcm"),
        ({"mlt_pass": 0, "integrator": "mlt"}, "mlt_pass: expected"),
        ({"mlt_pass": 4}, "mlt_pass: needs integrator mlt"),
        ({"lens": 0.1}, "lens: needs a distance"),
        ({"lens": (0.1, 0.0)}, "lens: expected"),
        ({"integrator": "auto", "mlt_pass": 4}, "mlt_pass: is of integrator mlt, not of auto"),
        ({"table_scale": 0, "table": "beta-0.05"}, "table_scale: expected"),
        ({"target_error": 0}, "target_error: expected"),
    ],
)
def test_errors_name_the_argument(box, options, words):
    with pytest.raises(ValueError, match=words):
        opsr.render(box, **{"size": (8, 8), "spp": 2, **options})


@pytest.mark.parametrize(
    "words, options",
    [
        ("--opsr-table 0.4 --set consistent=0.2", {"table": 0.4, "consistent": 0.2}),
        ("--opsr-table beta-0.05 --set consistent=0.2", {"table": "beta-0.05", "consistent": 0.2}),
        ("--set mode=filter-glossy --set filter=2", {"mode": "filter-glossy", "filter": 2}),
        ("--opsr-table beta-0.05 --set table_scale=3", {"table": "beta-0.05", "table_scale": 3}),
        (
            "--integrator vcm --set radius=0.05 --set radius_alpha=0.8 --set connections=nee",
            {"integrator": "vcm", "radius": 0.05, "radius_alpha": 0.8, "connections": "nee"},
        ),
        ("--integrator mlt --set mlt_pass=4", {"integrator": "mlt", "mlt_pass": 4}),
        ("--lens 0.05,2", {"lens": (0.05, 2)}),
        ("--integrator auto", {"integrator": "auto"}),
        ("--integrator auto --opsr-table beta-0.05", {"integrator": "auto", "table": "beta-0.05"}),
        ("--aov alpha,position,id,emission,indirect", {"aov": ["alpha", "position", "id", "emission", "indirect"]}),
    ],
)
def test_render_determinism_gives_the_file_of_the_program(program, tmp_path, words, options):
    theirs, ours = tmp_path / "theirs.exr", tmp_path / "ours.exr"
    command = [program, "render", SCENE, "--size", "24x16", "--spp", "6", "--reproducible", "-o", theirs]
    subprocess.run([*command, *words.split()], check=True, capture_output=True)
    film = opsr.render(opsr.Scene.load(SCENE), **SMALL, **options)
    film.save(ours)
    assert ours.read_bytes() == theirs.read_bytes()
    if "aov" in options:
        assert film.aovs["id"].shape == (16, 24, 2) and film.aovs["alpha"].shape == (16, 24)
        assert film.aovs["position"].shape == (16, 24, 3)


def test_target_error_ends_a_render(box):
    film = opsr.render(box, size=(24, 16), target_error=0.5)
    assert film.relative_error <= 0.5 and film.spp >= 16
    assert np.isfinite(film.picture).all()


def test_auto_names_the_integrator_that_a_pilot_chose(box):
    film = opsr.render(box, size=(24, 16), spp=4, integrator="auto")
    chosen = opsr.choose(box, size=(24, 16), spp=4)
    assert film.metadata["integrator"] == chosen["integrator"]
    single = opsr.render(box, size=(24, 16), spp=4, **chosen)
    np.testing.assert_array_equal(film.picture, single.picture)
    assert film.metadata == single.metadata == opsr.render(box, size=(24, 16), spp=4).metadata
    table = opsr.Table.load("beta-0.05")
    named = opsr.choose(box, size=(24, 16), spp=4, table=table)
    assert named["integrator"] == "path" and named["table"] is table
    other = opsr.choose(box, size=(24, 16), spp=4, table=table, integrator="auto")
    assert other["integrator"] == "path" or other["table"] is None
    timed = opsr.render(box, size=(24, 16), time=0.2, integrator="auto", table=0.1, levels=3, aov=True)
    assert timed.spp > 0 and timed.seconds < 5


@pytest.mark.parametrize("options", [{"aov": True}, {"table": 0.3, "levels": 3}, {"integrator": "bdpt"}], ids=["path", "levels", "bdpt"])
def test_part_that_is_gone_on_with_is_that_of_one_render(box, tmp_path, options):
    settings = {**SMALL, **options}
    opsr.render(box, part=tmp_path / "a", samples=(0, 2), **settings)
    opsr.render(box, part=tmp_path / "b", samples=(0, 6), begun=tmp_path / "a", **settings)
    opsr.render(box, part=tmp_path / "c", samples=(0, 6), **settings)
    assert (tmp_path / "b").read_bytes() == (tmp_path / "c").read_bytes()
    with pytest.raises(ValueError, match=r"samples 0\.\.6 of 24x16 .* cannot become samples 0\.\.2"):
        opsr.render(box, part=tmp_path / "d", samples=(0, 2), begun=tmp_path / "c", **settings)
    with pytest.raises(ValueError, match="belongs to other settings"):
        opsr.render(box, part=tmp_path / "d", begun=tmp_path / "a", seed=4, **settings)
    with pytest.raises(ValueError, match="begun: needs a part"):
        opsr.render(box, begun=tmp_path / "a", **settings)
    assert not (tmp_path / "d").exists()


def test_partial_merge_is_black_where_nothing_is(box, tmp_path):
    raw = {**SMALL, "resolve": "raw"}
    opsr.render(box, part=tmp_path / "a", crop=(0, 0, 24, 5), **raw)
    opsr.render(box, part=tmp_path / "b", crop=(0, 10, 24, 6), samples=(2, 6), **raw)
    film = opsr.merge([tmp_path / "a", tmp_path / "b"], partial=True)
    single = opsr.render(box, **raw)
    assert (film.picture[:5] == single.picture[:5]).all()
    assert (film.samples[5:10] == 0).all() and (film.picture[5:10] == 0).all()
    assert (film.samples[10:] == 4).all() and film.picture[10:].any()


@pytest.mark.parametrize(
    "options", [{"aov": ["id", "depth", "alpha"]}, {"levels": 3, "table": 0.3, "resolve": "sharp"}, {"integrator": "bdpt", "crop": (3, 2, 9, 9)}], ids=["path", "levels", "bdpt"]
)
def test_pickled_film_is_the_film(box, tmp_path, options):
    film = opsr.render(box, **SMALL, **options)
    again = pickle.loads(pickle.dumps(film))
    film.save(tmp_path / "a.exr")
    again.save(tmp_path / "b.exr")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    for name in ("size", "crop", "spp", "seconds", "metadata", "rejected", "relative_error", "error_bound", "mean_error", "light_missing"):
        assert getattr(film, name) == getattr(again, name), name
    assert film.aovs.keys() == again.aovs.keys()
    assert (film.picture == again.picture).all() and (film.variance == again.variance).all()
