"""Tables, training and metrics: arrays, files, the program's bytes, errors."""

import _thread
import subprocess

import numpy as np
import pytest

import opsr
from conftest import ROOT, SUITE, TINY


def test_table_round_trip_and_lookup(tmp_path):
    table = opsr.Table.load("beta-0.001")
    assert table.gammas.shape == (1360,) and table.gammas.dtype == np.float32
    assert table.provenance["beta"] == pytest.approx(0.001) and len(table.sha256) == 64
    table.save(tmp_path / "copy.json")
    assert (tmp_path / "copy.json").read_bytes() == (ROOT / "params" / "beta-0.001.json").read_bytes()
    # Both vertices in the first bin; the first in the last bin, the last in the first.
    assert table.lookup([0.01, 0.01]) == pytest.approx(table.gammas[0])
    assert table.lookup((0.9, 0.01)) == pytest.approx(table.gammas[12])
    paths = np.random.default_rng(0).random((7, 4))
    many = table.lookup(paths)
    assert many.shape == (7,) and many.dtype == np.float32
    assert [table.lookup(path) for path in paths] == list(many)
    assert table.lookup(np.linspace(0, 1, 30)) >= 0
    assert table.lookup(np.empty((0, 3))).shape == (0,)


def test_table_from_numbers_and_tuned(tmp_path):
    gammas = np.linspace(0, 1, 1360)
    table = opsr.Table(gammas[::-1], interpolation="linear", scale=2)
    np.testing.assert_array_equal(table.gammas, gammas[::-1].astype(np.float32))
    assert (table.interpolation, table.scale, table.provenance) == ("linear", 2, None)
    table.save(tmp_path / "mine.json")
    again = opsr.Table.load(tmp_path / "mine.json")
    assert again.sha256 == table.sha256 and "made by hand" in repr(again)
    half = opsr.Table.constant(0.5).tuned(0.5)
    assert half.lookup([0.3, 0.3]) == 0.25 and half.gammas[0] == 0.5


@pytest.mark.parametrize(
    "make, error, message",
    [
        (lambda: opsr.Table(np.zeros(7)), ValueError, r"gammas: expected 1360 numbers, got shape \[7\]"),
        (lambda: opsr.Table(np.zeros((1360, 1))), ValueError, "gammas: expected 1360 numbers"),
        (lambda: opsr.Table(np.full(1360, np.nan)), ValueError, r"gammas\[0\]: NaN is outside \[0, 1\]"),
        (lambda: opsr.Table(["a"]), ValueError, ""),
        (lambda: opsr.Table(np.zeros(1360), scale=0), ValueError, "scale: expected a number above 0"),
        (lambda: opsr.Table(np.zeros(1360), interpolation="x"), ValueError, "interpolation: expected nearest"),
        (lambda: opsr.Table.constant(-1), ValueError, "gamma: expected a number from 0 to 1"),
        (lambda: opsr.Table.load("none"), FileNotFoundError, "none: cannot be read"),
        (lambda: opsr.Table.load(ROOT / "README.md"), ValueError, "README.md"),
        (lambda: opsr.Table.constant(0).lookup([0.5]), ValueError, "alphas: expected two vertices or more"),
        (lambda: opsr.Table.constant(0).lookup(0.5), ValueError, "alphas: expected two vertices or more"),
        (lambda: opsr.Table.constant(0).lookup(np.zeros((1, 2, 2))), ValueError, "alphas: expected two"),
        (lambda: opsr.Table.constant(0).lookup([0.5, np.nan]), ValueError, r"alphas: NaN is outside \[0, 1\]"),
        (lambda: opsr.Table.constant(1).tuned(scale=np.nan), ValueError, "scale: expected a number above 0"),
        (lambda: opsr.Table.constant(1).save("none/a.json"), OSError, "cannot be written"),
    ],
)
def test_wrong_tables_are_exceptions(make, error, message):
    with pytest.raises(error, match=message or None):
        make()


def test_compare_agrees_with_numpy():
    rng = np.random.default_rng(1)
    a, f = (rng.random((9, 13, 3), dtype=np.float32) for _ in range(2))
    metrics = opsr.compare(a, f)
    assert metrics["MSE"] == pytest.approx(((a - f) ** 2).mean(), rel=1e-5)
    assert metrics["relMSE"] == pytest.approx(((a - f) ** 2 / (f**2 + 0.01)).mean(), rel=1e-4)
    assert {"MAPE", "FLIP", "HDR-FLIP"} <= set(metrics)
    strided = np.zeros((9, 26, 4), np.float32)
    strided[:, ::2, 1:] = a
    assert opsr.compare(strided[:, ::2, 1:], np.asfortranarray(f)) == metrics
    assert opsr.compare(a[::-1], f[::-1])["MSE"] == pytest.approx(metrics["MSE"])
    assert "HDR-FLIP" not in opsr.compare(a, np.zeros_like(f))


def test_wrong_pictures_are_exceptions(tmp_path):
    a = np.ones((4, 5, 3), np.float32)
    nan = a.copy()
    nan[1, 2, 0] = np.nan
    cases = [
        (a.astype(float), TypeError, "picture: expected an array of float32, got float64"),
        (a.astype(">f4"), TypeError, "picture: expected an array of float32, got >f4"),
        (a.tolist(), TypeError, "picture: expected a numpy array, a Film or a file, got list"),
        (None, TypeError, "got NoneType"),
        (a[..., 0], ValueError, "picture: expected an array of height x width x 3"),
        (a[:3], ValueError, "sizes differ: picture 5x3, reference 5x4"),
        (nan, ValueError, r"picture: pixel \(2, 1\) is not finite"),
        ("none.exr", FileNotFoundError, "none.exr: cannot be read"),
        (tmp_path / "a.txt", ValueError, "not a picture this program reads"),
    ]
    for wrong, error, message in cases:
        with pytest.raises(error, match=message or None):
            opsr.compare(wrong, a)
    with pytest.raises(ValueError, match="pictures without pixels"):
        opsr.compare(a[:0], a[:0])
    for options in ({"ppd": 0}, {"ppd": float("nan")}, {"exposure": float("inf")}):
        with pytest.raises(ValueError):
            opsr.compare(a, a, **options)


def test_train_determinism_gives_the_table_of_the_program(program, tmp_path):
    seen = []
    (table,) = opsr.train(TINY, on_step=seen.append)
    assert [step.step for step in seen] == [0, 1, 2, 3]
    assert seen[0].beta == 0.001 and seen[0].loss > 0 and seen[0].log["step"] == 0 and seen[1].log is None
    assert table.provenance["steps"] == 3
    table.save(tmp_path / "ours.json")
    settings = tmp_path / "settings.toml"
    text = [f'manifest = "{TINY["manifest"]}"', 'scenes = ["cornell_caustics"]', 'optimiser = "log"']
    text += [f"{key} = {TINY[key]}" for key in ("spp", "steps", "start", "validate_every")]
    settings.write_text("\n".join(text))
    command = [program, "train", "--config", settings, "--out", tmp_path, "--run"]
    subprocess.run([*command, tmp_path / "run"], check=True, capture_output=True)
    (theirs,) = tmp_path.glob("beta-*.json")
    assert (tmp_path / "ours.json").read_bytes() == theirs.read_bytes()
    (again,) = opsr.train(settings, threads=1)
    assert again.sha256 == table.sha256


def test_train_presets_are_those_of_the_program(program, tmp_path):
    small = {"manifest": TINY["manifest"], "scenes": ["cornell_caustics"], "spp": 4, "steps": 2}
    words = [f"--set=manifest='{TINY['manifest']}'", "--set=scenes=['cornell_caustics']", "--spp=4", "--steps=2"]
    found = set()
    for preset in ("full", "published", "fast", "smoke"):
        (table,) = opsr.train({**small, "preset": preset})
        command = [program, "train", "--preset", preset, *words, "--out", tmp_path, "--run", tmp_path / preset]
        subprocess.run(command, check=True, capture_output=True)
        name = "beta-0.001.json" if preset == "full" else f"{preset}-beta-0.001.json"
        table.save(tmp_path / "ours.json")
        assert (tmp_path / "ours.json").read_bytes() == (tmp_path / name).read_bytes(), preset
        found.add(table.sha256)
    # Fast and smoke differ in what is set here only.
    assert len(found) == 3
    (default,) = opsr.train(small)
    assert default.sha256 == opsr.train({**small, "preset": "full"})[0].sha256


def test_train_stops_at_false_errors_and_ctrl_c():
    (table,) = opsr.train({**TINY, "beta": [0.001, 0.05]}, on_step=lambda step: step.step < 1)
    assert table.provenance["steps"] == 1

    def interrupt(step):
        _thread.interrupt_main()

    with pytest.raises(KeyboardInterrupt):
        opsr.train(TINY, on_step=interrupt)
    with pytest.raises(ZeroDivisionError):
        opsr.train(TINY, on_step=lambda step: 1 / 0)


@pytest.mark.parametrize(
    "config, error, message",
    [
        ({"none": 1}, ValueError, "config: unknown field `none`"),
        ({"preset": "quick"}, ValueError, "config: preset: unknown variant `quick`"),
        ({"preset": 3}, ValueError, "config: preset: "),
        ({"spp": 1}, ValueError, "spp: expected 2 to 1048576 samples"),
        ({"spp": "many"}, ValueError, "config: "),
        ({"start": float("nan")}, ValueError, ""),
        ({"beta": None}, ValueError, "config"),
        ({"beta": object()}, TypeError, ""),
        ({"scenes": ["none"]}, ValueError, "no training scene `none`"),
        ({"replicates": 2}, ValueError, "replicates"),
        ({"manifest": "none.toml"}, FileNotFoundError, "none.toml"),
        (3, TypeError, ""),
        ("none.toml", FileNotFoundError, "none.toml: cannot be read"),
    ],
)
def test_wrong_configurations_are_exceptions(config, error, message):
    if isinstance(config, dict):
        config = {"manifest": TINY["manifest"], "steps": 1, **config}
    with pytest.raises(error, match=message or None):
        opsr.train(config)


def test_train_from_recordings_gives_the_same_table(tmp_path):
    config = TINY
    (whole,) = opsr.train(config)
    crops = opsr.record(config, tmp_path / "paths", crops=(0, 0))
    assert crops[0]["scene"] == "cornell_caustics" and crops[0]["training"] and not crops[-1]["training"]
    assert list((tmp_path / "paths").iterdir()) == []
    half = len(crops) // 2
    assert opsr.record(config, tmp_path / "paths", crops=(half, len(crops)), threads=1) == crops
    with pytest.raises(FileNotFoundError, match="missing recordings.* 000-cornell-caustics-"):
        opsr.train(config, recordings=tmp_path / "paths")
    opsr.record({**config, "beta": [7.0]}, tmp_path / "paths", crops=(0, half))
    (table,) = opsr.train(config, recordings=tmp_path / "paths")
    table.save(tmp_path / "a.json")
    whole.save(tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    with pytest.raises(ValueError, match="other settings"):
        opsr.train({**config, "seed": 1}, recordings=tmp_path / "paths")
    with pytest.raises(ValueError, match="crops: expected"):
        opsr.record(config, tmp_path / "paths", crops=(0, 99))


def test_bench_measures_and_keeps(tmp_path):
    suite, output = tmp_path / "suite.toml", tmp_path / "results.json"
    suite.write_text(SUITE)
    seen = []
    results = opsr.bench(suite, output, scenes=["plane"], on_progress=lambda *status: seen.append(status))
    assert {cell["scene"] for cell in results["cells"]} == {"plane"} and len(results["cells"]) == 4
    assert seen[-1][2] == 4 and any("table" in what for what, *_ in seen)
    assert results["cells"][0]["points"][-1]["samples"] == 8
    assert len(results["suite"]["scene"]) == 3
    whole = opsr.bench(suite, output)
    assert whole["cells"][:4] == results["cells"] and len(whole["cells"]) == 12
    with pytest.raises(ValueError, match="scenes: no scene `none`"):
        opsr.bench(suite, output, scenes=["none"])
    with pytest.raises(FileNotFoundError):
        opsr.bench(tmp_path / "none.toml", output)
