"""Renders: determinism, the program's pictures, arrays, callbacks, Ctrl-C, errors."""

import _thread
import inspect
import json
import multiprocessing
import pathlib
import pickle
import subprocess
import threading
import time

import numpy as np
import pytest

import opsr
from conftest import SCENES

SMALL = {"size": (24, 16), "spp": 4}


def test_render_arrays_have_shape_and_type(box):
    film = opsr.render(box, **SMALL, resolve="raw", aov=True)
    assert film.picture.shape == film.variance.shape == (16, 24, 3)
    assert film.picture.dtype == film.variance.dtype == np.float32
    assert film.samples.shape == (16, 24) and (film.samples == 4).all()
    assert film.samples.dtype == np.uint32
    assert film.aovs["albedo"].shape == film.aovs["normal"].shape == (16, 24, 3)
    assert film.aovs["depth"].shape == (16, 24)
    assert np.isfinite(film.picture).all() and film.picture.mean() > 0 and film.picture.flags.writeable
    assert (film.size, film.crop, film.spp, film.rejected) == ((24, 16), (0, 0, 24, 16), 4, 0)
    assert film.levels is None and opsr.render(box, **SMALL).aovs == {}
    assert 0 < film.relative_error < 10 and film.seconds > 0


def test_render_determinism_over_threads_passes_and_crops(box):
    settings = {**SMALL, "table": "beta-0.05", "resolve": "raw"}
    whole = opsr.render(box, **settings, seed=3).picture
    for threads in (1, 3):
        again = opsr.render(box, **{**settings, "table": opsr.Table.load("beta-0.05")}, seed=3, threads=threads)
        np.testing.assert_array_equal(again.picture, whole)
    crop = opsr.render(box, **settings, crop=(5, 4, 10, 7), seed=3).picture
    np.testing.assert_array_equal(crop, whole[4:11, 5:15])
    assert not np.array_equal(opsr.render(box, **settings, seed=4).picture, whole)


@pytest.mark.parametrize(
    "words, options",
    [
        ([], {}),
        (["--aov", "--seed", "9", "--crop", "3,2,12,8"], {"aov": True, "seed": 9, "crop": (3, 2, 12, 8)}),
        (["--opsr-table", "beta-0.001"], {"table": "beta-0.001"}),
        (["--opsr-table", "beta-0.001", "--resolve", "raw"], {"table": "beta-0.001", "resolve": "raw"}),
        (["--opsr-table", "0.4", "--set", "mode=reuse"], {"table": 0.4, "mode": "reuse"}),
        (["--opsr-table", "0.4"], {"table": 0.4}),
        (["--opsr-table", "beta-0.05"], {"table": "beta-0.05", "levels": 4}),
        (["--opsr-table", "0.5", "--set", "levels=0,0.25,1"], {"table": 0.5, "levels": [0, 0.25, 1]}),
        (["--set", "mode=pbrt"], {"mode": "pbrt"}),
        (["--set", "mode=filter-glossy"], {"mode": "filter-glossy"}),
        (["--integrator", "bdpt", "--set", "mode=mollifier"], {"integrator": "bdpt", "mode": "mollifier"}),
        (["--integrator", "vcm"], {"integrator": "vcm"}),
        (["--integrator", "bdpt", "--opsr-table", "beta-0.001"], {"integrator": "bdpt", "table": "beta-0.001"}),
    ],
)
def test_render_determinism_gives_the_picture_of_the_program(program, tmp_path, words, options):
    path = SCENES / "cornell_caustics.glb"
    theirs, ours = tmp_path / "theirs.exr", tmp_path / "ours.exr"
    command = [program, "render", path, "--size", "24x16", "--spp", "8", "-o", theirs]
    subprocess.run([*command, *words], check=True, capture_output=True)
    film = opsr.render(opsr.Scene.load(path), size=(24, 16), spp=8, **options)
    film.save(ours)
    # Zero only if every number is the same.
    assert opsr.compare(film, theirs)["MSE"] == 0
    assert opsr.compare(str(ours), theirs)["MSE"] == 0
    again = film.picture.copy()
    again[0, 0, 0] = np.nextafter(again[0, 0, 0], np.float32(np.inf))
    assert opsr.compare(again, theirs)["MSE"] > 0


def test_files_have_the_bytes_of_the_program(program, tmp_path):
    path = SCENES / "cornell_caustics.glb"
    cases = [
        ([], {}, {}),
        (["--opsr-table", "0.3", "--exposure", "1"], {"table": 0.3}, {"exposure": 1}),
        (["--opsr-table", "0.3", "--aov"], {"table": 0.3, "aov": True}, {}),
    ]
    try:
        opsr.render(opsr.Scene.load(path), size=(4, 4), spp=1, denoise=True)
        cases += [([*words, "--denoise"], {**options, "denoise": True}, saved) for words, options, saved in cases]
    except ValueError as missing:
        assert "Open Image Denoise 2 was not found" in str(missing)
    for words, options, saved in cases:
        films = [opsr.render(opsr.Scene.load(path), size=(24, 16), spp=8, **options)]
        films.append(pickle.loads(pickle.dumps(films[0])))
        # Layers are kept in EXR files only.
        for ending in ("exr",) if "aov" in options else ("exr", "png"):
            theirs = tmp_path / f"theirs.{ending}"
            command = [program, "render", path, "--size", "24x16", "--spp", "8", "--reproducible", "-o", theirs]
            given = words
            if saved and ending == "exr":
                # Exposure is of PNG files, and refused without one.
                refused = subprocess.run([*command, *words], capture_output=True, text=True)
                assert refused.returncode == 2 and "--exposure: is of PNG files" in refused.stderr
                at = words.index("--exposure")
                given = words[:at] + words[at + 2 :]
            subprocess.run([*command, *given], check=True, capture_output=True)
            for film in films:
                film.save(tmp_path / f"ours.{ending}", **saved)
                assert (tmp_path / f"ours.{ending}").read_bytes() == theirs.read_bytes(), (words, ending)


def test_levels_are_four_where_there_can_be_levels(box):
    assert opsr.render(box, **SMALL, table="beta-0.05").levels.shape == (4, 16, 24, 3)
    assert opsr.render(box, **SMALL, table=0.5).levels.shape[0] == 4
    for options in ({"mode": "reuse"}, {"consistent": 0.2}, {"aov": "direct", "resolve": "raw"}, {"resolve": "raw"}, {"integrator": "bdpt", "resolve": "raw"}):
        assert opsr.render(box, **SMALL, table=0.5, **options).levels is None
    # One level, which may be blurred.
    for options in ({}, {"table": 0}, {"integrator": "bdpt"}):
        assert opsr.render(box, **SMALL, **options).levels.shape[0] == 1


def test_levels_resolve(box):
    film = opsr.render(box, **SMALL, table="beta-0.05", levels=3)
    assert film.levels.shape == (3, 16, 24, 3) and film.levels.dtype == np.float32
    plain = opsr.render(box, **SMALL).picture
    np.testing.assert_allclose(film.levels[0], film.levels[0].clip(0))
    resolved = opsr.resolve(film)
    np.testing.assert_array_equal(resolved.picture, film.picture)
    assert resolved.level.shape == (16, 24) and resolved.level.dtype == np.uint8 and resolved.level.max() < 3
    np.testing.assert_allclose(resolved.error.mean(), resolved.mean_relative_error, rtol=0.03)
    assert resolved.relative_error == film.relative_error > 0
    pictures = [opsr.resolve(film, resolve=word).picture for word in ("none", "sharp", "default")]
    assert all(picture.shape == plain.shape for picture in pictures)
    assert (pictures[1] != pictures[2]).any()
    with pytest.raises(ValueError, match="resolve"):
        opsr.resolve(film, resolve="robust")
    with pytest.raises(ValueError, match="a film of one level, there is nothing to choose"):
        opsr.resolve(opsr.render(box, **SMALL, resolve="raw"))


def test_save_png_and_names(box, tmp_path):
    film = opsr.render(box, **SMALL)
    film.save(tmp_path / "a.png")
    film.save(tmp_path / "b.png", exposure=-2)
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG" != (tmp_path / "b.png").read_bytes()
    with pytest.raises(ValueError, match=r"expected a name that ends in \.exr or \.png"):
        film.save(tmp_path / "a.jpg")
    with pytest.raises(OSError, match="cannot be written"):
        film.save(tmp_path / "none" / "a.exr")
    with pytest.raises(ValueError, match="exposure"):
        film.save(tmp_path / "a.png", exposure=float("nan"))


def test_progress_is_reported_and_false_stops(box):
    seen = []
    film = opsr.render(box, **SMALL, on_progress=seen.append)
    assert [p.samples for p in seen] == sorted({p.samples for p in seen}) and seen[-1].samples == 4
    assert seen[-1].fraction == 1 and 0 < seen[0].fraction < 1 and seen[0].seconds > 0
    film = opsr.render(box, size=(24, 16), spp=1000, on_progress=lambda p: p.samples < 5)
    assert film.spp == 7 and (film.samples == 7).all()


def test_false_of_numpy_stops_too(box):
    film = opsr.render(box, size=(24, 16), spp=1000, on_progress=lambda p: np.bool_(p.samples < 5))
    assert film.spp == 7
    assert opsr.render(box, **SMALL, on_progress=lambda p: np.True_).spp == 4


ALONE = {
    "camera": 0,
    "lens": (0.1, 2.0),
    "integrator": "bdpt",
    "table": "beta-0.05",
    "levels": 3,
    "mode": "pbrt",
    "sampler": "independent",
    "max_vertices": 3,
    "seed": 5,
}
"""Values of options that are not numbers above 0; the others are taken as 0.4 or 2."""


@pytest.mark.parametrize("option", json.loads(opsr._opsr._options("render")), ids=lambda option: option["name"])
def test_options_alone_are_refused_or_recorded(box, option):
    name = option["name"]
    if name in {"size", "crop", "spp", "time", "target_error", "aov"}:
        return
    value = ALONE.get(name, 2 if option["type"] == "int" else 0.4 if option["type"] == "float" else True)
    if option["type"].startswith("Literal") and name not in ALONE:
        value = option["type"].split('"')[1]
    plain = opsr.render(box, **SMALL)
    try:
        film = opsr.render(box, **SMALL, **{name: value})
    except ValueError as error:
        assert str(error).startswith(f"{name}: "), error
        return
    if name == "camera":
        assert film.metadata["camera"] == "0"
        return
    assert not np.array_equal(film.picture, plain.picture), name
    assert film.metadata != plain.metadata, name


def test_callback_errors_stop_the_render(box):
    def fail(_):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        opsr.render(box, size=(24, 16), spp=1 << 20, on_progress=fail)
    with pytest.raises(TypeError):
        opsr.render(box, **SMALL, on_progress=lambda: None)


def test_ctrl_c_stops_a_render(box):
    timer = threading.Timer(0.5, _thread.interrupt_main)
    timer.start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        opsr.render(box, size=(64, 64), time=120)
    assert time.monotonic() - begin < 60
    timer.join()
    assert opsr.render(box, **SMALL).spp == 4


def test_gil_is_released_and_scenes_are_shared(box):
    films = {}

    def work(seed):
        films[seed] = opsr.render(box, **SMALL, seed=seed, threads=1).picture

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    ticks = 0
    stop = time.monotonic() + 0.3
    film = threading.Thread(target=lambda: opsr.render(box, size=(64, 64), time=0.3))
    film.start()
    while time.monotonic() < stop:
        ticks += 1
        time.sleep(0.001)
    for thread in [*threads, film]:
        thread.join()
    assert ticks > 3
    for seed, picture in films.items():
        np.testing.assert_array_equal(picture, opsr.render(box, **SMALL, seed=seed).picture)


def test_render_inside_a_callback(box):
    inner = []
    opsr.render(box, size=(8, 8), spp=1, on_progress=lambda p: inner.append(opsr.render(box, size=(8, 8), spp=2)))
    assert inner[0].spp == 2


def _render(box, results):
    results.put(opsr.render(box, **SMALL).picture.sum())


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_render_after_fork(box):
    mine = opsr.render(box, **SMALL).picture.sum()
    context = multiprocessing.get_context("fork")
    results = context.Queue()
    process = context.Process(target=_render, args=(box, results))
    process.start()
    assert results.get(timeout=60) == mine
    process.join()


@pytest.mark.parametrize(
    "options, error, message",
    [
        ({"spp": 0}, ValueError, "spp: expected a whole number from 1"),
        ({"spp": -1}, ValueError, "spp: expected a whole number"),
        ({"spp": "8"}, TypeError, "spp"),
        ({"time": float("nan")}, ValueError, "time: expected a number of seconds"),
        ({"time": -1.0}, ValueError, "time: expected a number of seconds"),
        ({"size": (0, 4)}, ValueError, "size: expected"),
        ({"size": 4}, ValueError, "size: expected"),
        ({"size": (65536, 65536)}, (ValueError, MemoryError), ""),
        ({"crop": (0, 0, 25, 4)}, ValueError, "crop: the window of 25x4 pixels at"),
        ({"crop": (0, 0, 0, 0)}, ValueError, "crop: the window"),
        ({"crop": (4294967295, 0, 4294967295, 1)}, ValueError, "crop: the window"),
        ({"camera": "none"}, ValueError, "no camera `none`: the scene has camera 0"),
        ({"camera": 7}, ValueError, "no camera `7`"),
        ({"camera": -1}, ValueError, "camera: expected a name or a number"),
        ({"camera": 1.5}, ValueError, "camera: expected a name or a number"),
        ({"table": 1.5}, ValueError, "table: expected a table, or a factor from 0 to 1"),
        ({"table": float("nan")}, ValueError, "table: expected a table, or a factor from 0 to 1"),
        ({"table": "none.json"}, FileNotFoundError, "none.json: cannot be read"),
        ({"table": 3}, ValueError, "table: expected a table, or a factor from 0 to 1"),
        ({"table": "beta\0"}, (OSError, ValueError), ""),
        ({"mode": "none"}, ValueError, "mode: expected default, reuse, pbrt"),
        ({"mode": "pbrt", "table": 0.5}, ValueError, "mode: pbrt has a rule of its own: no table or consistent"),
        ({"mode": "reuse"}, ValueError, "mode: reuse needs table"),
        ({"integrator": "none"}, ValueError, "integrator: expected path, guided"),
        ({"integrator": "bdpt", "table": 0.5, "mode": "reuse"}, ValueError, "mode: integrator bdpt takes no mode but mollifier"),
        ({"integrator": "light", "table": "beta-0.05"}, ValueError, "table: is of integrator path, guided, bdpt, vcm and mlt, not of light"),
        ({"integrator": "light", "mode": "pbrt"}, ValueError, "mode: integrator light takes no mode"),
        ({"levels": 3, "table": 0.5, "integrator": "bdpt"}, ValueError, "levels: "),
        ({"levels": 3}, ValueError, "levels: several levels scale the factors of table, and there are none"),
        ({"levels": 3, "mode": "filter-glossy"}, ValueError, "levels: several levels scale the factors of table, and there are none"),
        ({"levels": 9, "table": 0.5}, ValueError, "levels: expected 2 to 8 levels"),
        ({"levels": -1, "table": 0.5}, ValueError, "levels: expected 2 to 8 levels"),
        ({"levels": [0, float("nan")], "table": 0.5}, ValueError, "levels: expected a number of levels, scales such as 0,0.25,1, or none"),
        ({"levels": "all", "table": 0.5}, ValueError, "levels: expected a number of levels, scales such as 0,0.25,1, or none"),
        ({"max_vertices": 0}, ValueError, "max_vertices: expected a whole number from 1 to 65536"),
        ({"threads": 0}, ValueError, "threads: expected a whole number of at least 1"),
        ({"seed": -1}, ValueError, "seed: expected a whole number"),
        ({"threads": -1}, ValueError, "threads: expected"),
        ({"levels": True, "table": 0.5}, ValueError, "levels: expected"),
        ({"levels": [], "table": 0.5}, ValueError, "levels: expected"),
        ({"levels": [0, 0.5, 0.2], "table": 0.5}, ValueError, "levels: expected 2 to 8 scales"),
        ({"crop": (0, -1, 4, 4)}, ValueError, "crop: expected"),
        ({"resolve": "raw", "levels": 3, "table": 0.5}, ValueError, "levels: resolve raw has no levels"),
        ({"none": 1}, TypeError, "none"),
        ({"gamma": 0.3}, TypeError, "unexpected keyword argument 'gamma'; it is table X now"),
    ],
)
def test_wrong_settings_are_exceptions(box, options, error, message):
    with pytest.raises(error, match=message or None):
        opsr.render(box, **{**SMALL, **options})


def test_scene_cameras_and_errors(box, tmp_path):
    assert len(box.cameras) == 1 and len(box.sha256) == 64
    assert "cornell_caustics.glb" in repr(box) and str(box.path).endswith("cornell_caustics.glb")
    by_name = opsr.render(box, **SMALL, camera=box.cameras[0]).picture
    np.testing.assert_array_equal(by_name, opsr.render(box, **SMALL, camera=0).picture)
    with pytest.raises(FileNotFoundError, match="none.glb: cannot be read"):
        opsr.Scene.load("none.glb")
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF\2\0\0\0")
    with pytest.raises(ValueError, match="broken.glb"):
        opsr.Scene.load(broken)
    with pytest.raises(OSError):
        opsr.Scene.load(tmp_path)
    with pytest.raises(FileNotFoundError, match="none.hdr"):
        opsr.Scene.load(box.path, env="none.hdr")
    with open(broken) as file:
        pass
    for wrong in (None, 3, file):
        with pytest.raises(TypeError):
            opsr.Scene.load(wrong)
    for options in ({"env_intensity": 0}, {"env_rotation": float("inf")}, {"distribution": "none"}):
        with pytest.raises(ValueError, match=next(iter(options))):
            opsr.Scene.load(box.path, **options)
    with pytest.raises(TypeError):
        opsr.render(str(box.path))
    with pytest.raises(TypeError):
        opsr.Scene()


def test_stub_and_docstrings_are_complete():
    stub = pathlib.Path(opsr.__file__).with_suffix(".pyi").read_text()
    for name in set(opsr.__all__) - {"__version__"}:
        item = getattr(opsr, name)
        assert item.__doc__ and f" {name}" in stub, name
        if inspect.isclass(item):
            members = [m for m in vars(item) if not m.startswith("_")]
            assert members and all(f"def {m}(" in stub for m in members), name
        else:
            words = inspect.signature(item).parameters
            assert all(f"{word}: " in stub for word in words), name
