"""Work on a cluster of several processes, one of which is killed: the bytes of a single process."""

import contextlib
import os
import signal
import subprocess
import threading
import time

import pytest

import opsr
from conftest import SCENES, SUITE, TINY

pytest.importorskip("dask.distributed", reason="pip install dask distributed")

SCENE = SCENES / "cornell_caustics.glb"


@pytest.fixture(scope="module")
def client():
    from dask.distributed import Client, LocalCluster

    with LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        yield client


@pytest.mark.parametrize(
    "options",
    [
        {"table": "beta-0.001", "levels": 5, "aov": True},
        {"integrator": "bdpt", "seed": 3, "crop": (3, 2, 40, 30)},
    ],
    ids=["path", "bdpt"],
)
def test_render_resumes_where_a_worker_is_killed(client, tmp_path, options):
    import opsr.dask

    settings = {"size": (64, 48), "spp": 24, **options}
    opsr.render(opsr.Scene.load(SCENE), **settings).save(tmp_path / "one.exr")
    seen, processes = [], client.run(os.getpid)

    def kill(done, parts, moved):
        seen.append((done, parts, moved))
        if done == 2:
            os.kill(next(iter(processes.values())), signal.SIGKILL)

    film = opsr.dask.render(client, SCENE, parts=12, on_part=kill, **settings)
    film.save(tmp_path / "all.exr")
    assert (tmp_path / "one.exr").read_bytes() == (tmp_path / "all.exr").read_bytes()
    assert [done for done, *_ in seen] == list(range(1, 13)) and all(parts == 12 for _, parts, _ in seen)
    assert film.spp == 24


@contextlib.contextmanager
def killing(client):
    """Kills a worker in the middle of a task."""
    processes, killed = client.run(os.getpid), []

    def kill():
        end = time.monotonic() + 60
        while time.monotonic() < end:
            busy = [worker for worker, tasks in client.processing().items() if tasks and worker in processes]
            if busy:
                time.sleep(0.05)
                os.kill(processes[busy[0]], signal.SIGKILL)
                killed.append(busy[0])
                return
            time.sleep(0.005)

    thread = threading.Thread(target=kill)
    thread.start()
    yield
    thread.join()
    assert killed


def test_render_takes_a_table_of_numbers(client):
    import opsr.dask

    table = opsr.Table.load("beta-0.05").tuned(scale=0.5)
    settings = {"size": (16, 12), "spp": 2, "table": table}
    film = opsr.dask.render(client, SCENE, parts=2, **settings)
    single = opsr.render(opsr.Scene.load(SCENE), **settings)
    assert (film.picture == single.picture).all() and film.metadata == single.metadata


def test_train_resumes_where_a_worker_is_killed(client, tmp_path):
    import opsr.dask

    configs = [{**TINY, "spp": 48, "steps": 20, "beta": beta} for beta in ([0.001, 0.05], [0.01])]
    with killing(client):
        tables = opsr.dask.train(client, configs)
    expected = [opsr.train(config) for config in configs]
    for mine, theirs in zip(sum(tables, []), sum(expected, []), strict=True):
        mine.save(tmp_path / "mine.json")
        theirs.save(tmp_path / "theirs.json")
        assert (tmp_path / "mine.json").read_bytes() == (tmp_path / "theirs.json").read_bytes()
    # Recorded by tasks of their own, once for both.
    crops = opsr.dask.record(client, configs[0], tmp_path / "paths")
    assert len(crops) == len(list((tmp_path / "paths").iterdir()))
    again = opsr.dask.train(client, configs, recordings=tmp_path / "paths")
    assert [t.sha256 for t in sum(again, [])] == [t.sha256 for t in sum(tables, [])]


def test_record_resumes_where_a_worker_is_killed(client, two_families, tmp_path):
    import opsr.dask

    config = {**two_families, "spp": 8}
    with killing(client):
        opsr.dask.record(client, config, tmp_path / "paths")
    files = {file.name: file.read_bytes() for file in (tmp_path / "paths").iterdir()}
    crops = opsr.record(config, tmp_path / "single")
    assert [crop["file"] for crop in crops] == sorted(files)
    assert files == {file.name: file.read_bytes() for file in (tmp_path / "single").iterdir()}


def without_times(results):
    """What does not depend on the machine's speed."""
    for cell in results["cells"]:
        cell.pop("memory")
        for point in cell["points"]:
            point.pop("wall"), point.pop("cpu")
    for inset in results["insets"]:
        inset.pop("seconds")
    return {key: results[key] for key in ("suite", "scenes", "cells", "products", "insets")}


def test_bench_resumes_where_a_worker_is_killed(client, tmp_path, program):
    import opsr.dask

    (tmp_path / "suite.toml").write_text(SUITE)
    with killing(client):
        results = opsr.dask.bench(client, tmp_path / "suite.toml", tmp_path / "all.json")
    single = opsr.bench(tmp_path / "suite.toml", tmp_path / "one.json", threads=1)
    assert without_times(results) == without_times(single)
    report = [program, "report", tmp_path / "all.json", "-o", tmp_path / "all.html"]
    subprocess.run(report, check=True, capture_output=True)


def test_quiet_settings_are_known_to_dask():
    import dask

    import opsr.dask

    for key in opsr.dask.QUIET:
        # KeyError for another.
        dask.config.get(key)


def test_errors_of_workers_arrive(client, tmp_path):
    import opsr.dask

    with pytest.raises(FileNotFoundError):
        opsr.dask.render(client, "none.glb", size=(8, 8), spp=2, retries=0)
    with pytest.raises(ValueError, match="gamma"):
        opsr.dask.render(client, SCENE, size=(8, 8), spp=2, gamma=3, retries=0)
    with pytest.raises(TypeError, match="threads"):
        opsr.dask.render(client, SCENE, size=(8, 8), spp=2, threads=3)
    with pytest.raises(ValueError, match="spp: expected"):
        opsr.dask.train(client, [{**TINY, "spp": 1}], retries=0)
    with pytest.raises(FileNotFoundError, match="missing recordings"):
        opsr.dask.train(client, [TINY], recordings=tmp_path, retries=0)
