"""Work on a cluster of several processes, one of which is killed: the bytes of a single process."""

import contextlib
import json
import os
import pathlib
import signal
import struct
import subprocess
import threading
import time

import pytest

import opsr
from conftest import SCENES, SUITE, TINY

pytest.importorskip("dask.distributed", reason="pip install dask distributed")

SCENE = SCENES / "cornell_caustics.glb"


@pytest.fixture
def moving(tmp_path):
    """A lamp that crosses the picture in a second, of a .gltf and a file beside it."""
    corners, keys = [(-0.3, -0.3, 0), (0.3, -0.3, 0), (0, 0.3, 0)], [(-1.0, 0, -3), (1.0, 0, -3)]
    data = struct.pack("<9f", *sum(corners, ())) + struct.pack("<2f", 0, 1) + struct.pack("<6f", *sum(keys, ()))
    views = [{"buffer": 0, "byteOffset": a, "byteLength": n} for a, n in [(0, 36), (36, 8), (44, 24)]]
    floats = {"componentType": 5126}
    accessors = [
        {"bufferView": 0, "count": 3, "type": "VEC3", "min": [-0.3, -0.3, 0], "max": [0.3, 0.3, 0], **floats},
        {"bufferView": 1, "count": 2, "type": "SCALAR", "min": [0], "max": [1], **floats},
        {"bufferView": 2, "count": 2, "type": "VEC3", **floats},
    ]
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    root = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"emissiveFactor": [1, 1, 1]}],
        "animations": [{"samplers": [{"input": 1, "output": 2}], "channels": [channel]}],
        "buffers": [{"uri": "data.bin", "byteLength": len(data)}],
        "bufferViews": views,
        "accessors": accessors,
    }
    folder = tmp_path / "moving"
    folder.mkdir()
    (folder / "data.bin").write_bytes(data)
    (folder / "scene.gltf").write_text(json.dumps(root))
    return folder / "scene.gltf"


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


def saved(film, path):
    film.save(path)
    return path.read_bytes()


def times(folder):
    return {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}


def test_rounds_end_at_the_error_of_one_process(client, tmp_path):
    import opsr.dask

    settings = {"size": (48, 36), "table": "beta-0.001", "levels": 3, "aov": True}
    seen = []
    film = opsr.dask.render(
        client, SCENE, target_error=0.3, spp=512, parts=4, on_part=lambda *part: seen.append(part), **settings
    )
    assert 16 < film.spp < 512 and film.error_bound <= 0.3
    assert len(seen) >= 8, "several rounds of four parts"
    single = opsr.render(opsr.Scene.load(SCENE), spp=film.spp, **settings)
    assert saved(film, tmp_path / "all.exr") == saved(single, tmp_path / "one.exr")
    # The round before was not enough, by more than the rounding of its samples.
    shorter = opsr.render(opsr.Scene.load(SCENE), spp=max(16, film.spp // 2), **settings)
    assert shorter.error_bound > 0.3


@pytest.mark.parametrize("integrator", ["path", "bdpt"])
def test_stopped_driver_goes_on_with_finished_parts(client, tmp_path, integrator):
    import opsr.dask

    folder = tmp_path / "work"
    settings = {"size": (48, 36), "integrator": integrator, "folder": folder}
    seen = []

    def stop(done, parts, moved):
        seen.append(done)
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        opsr.dask.render(client, SCENE, spp=16, parts=8, on_part=stop, **settings)
    assert seen == [1, 2, 3] and len(list((folder / "parts").iterdir())) == 3
    assert "so-far.png" in (folder / "index.html").read_text()
    assert (folder / "so-far.png").read_bytes().startswith(b"\x89PNG")
    kept = times(folder / "parts")
    film = opsr.dask.render(client, SCENE, spp=16, **settings)
    assert kept.items() <= times(folder / "parts").items(), "finished parts were done again"
    single = {"size": (48, 36), "integrator": integrator}
    scene = opsr.Scene.load(SCENE)
    assert saved(film, tmp_path / "a.exr") == saved(opsr.render(scene, spp=16, **single), tmp_path / "b.exr")
    # More samples of it: those that are there count.
    output = tmp_path / "c.exr"
    opsr.dask.render(client, SCENE, spp=24, output=output, **settings)
    assert output.read_bytes() == saved(opsr.render(scene, spp=24, **single), tmp_path / "d.exr")
    with pytest.raises(ValueError, match="another work, of other seed"):
        opsr.dask.render(client, SCENE, spp=24, seed=7, **settings)


def test_late_task_is_sent_twice(client, tmp_path):
    import opsr.dask

    processes = client.run(os.getpid)
    slow = list(processes.values())[-1]
    settings = {"size": (64, 48), "spp": 32}

    def stop(done, parts, moved):
        if done == 2:
            os.kill(slow, signal.SIGSTOP)

    try:
        film = opsr.dask.render(client, SCENE, parts=9, on_part=stop, **settings)
    finally:
        os.kill(slow, signal.SIGCONT)
    single = opsr.render(opsr.Scene.load(SCENE), **settings)
    assert saved(film, tmp_path / "all.exr") == saved(single, tmp_path / "one.exr")


def test_frames_are_those_of_one_process(client, moving, tmp_path):
    import opsr.dask

    output = str(tmp_path / "film" / "{:03}.exr")
    settings = {"size": (32, 24), "spp": 4}
    load = {"fps": 4.0, **settings}
    seen = []

    def stop(frame, address):
        seen.append(frame)
        if len(seen) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        opsr.dask.animate(client, moving, range(5), output, on_frame=stop, **load)
    there = times(tmp_path / "film")
    addresses = opsr.dask.animate(client, moving, range(5), output, **load)
    there = {name: time for name, time in there.items() if name.endswith((".exr", ".json"))}
    assert len(there) >= 3 and there.items() <= times(tmp_path / "film").items()
    assert len({pathlib.Path(address).read_bytes() for address in addresses.values()}) == 5
    frames = [pathlib.Path(addresses[frame]).read_bytes() for frame in range(5)]
    # The method of all frames is that of the first.
    method = opsr.choose(opsr.Scene.load(moving, at="0@4"), **settings)
    singles = (opsr.render(opsr.Scene.load(moving, at=f"{frame}@4"), seed=frame, **settings, **method) for frame in range(5))
    assert frames == [saved(film, tmp_path / "one.exr") for film in singles]
    with pytest.raises(ValueError, match="output: no place"):
        opsr.dask.animate(client, moving, range(5), "film.exr", **settings)


def test_averaged_frames_are_those_of_one_film(client, moving, program, tmp_path):
    import opsr.dask

    settings = {"size": (32, 24), "spp": 8, "seed": 3, "integrator": "path"}
    opsr.dask.animate(client, moving, range(2, 8), str(tmp_path / "frames" / "{:04}.exr"), fps=12, **settings)
    film = [program, "film", moving, tmp_path / "frames" / "####.exr", "--reproducible", "-o", tmp_path / "many_####.exr"]
    subprocess.run(film, check=True, capture_output=True)
    words = ["--size", "32x24", "--spp", "8", "--seed", "3", "--integrator", "path", "--reproducible", "--frames", "2..7@12"]
    single = [program, "render", moving, *words, "-o", tmp_path / "one_####.exr"]
    subprocess.run(single, check=True, capture_output=True)
    files = {name: [file.read_bytes() for file in sorted(tmp_path.glob(f"{name}_*.exr"))] for name in ("many", "one")}
    assert len(files["one"]) == 6 and files["many"] == files["one"]


def test_estimate_is_near(client):
    import opsr.dask

    settings = {"size": (160, 120), "spp": 96}
    settings.update(integrator="path", resolve="raw")
    guess = opsr.dask.estimate(client, SCENE, **settings)
    client.run(opsr.Scene.load, SCENE)
    before = sum(client.run(time.process_time).values())
    opsr.dask.render(client, SCENE, parts=6, **settings)
    used = (sum(client.run(time.process_time).values()) - before) / 3600
    assert used / 2 < guess["cpu_hours"] < 2 * used
    assert guess["worker_bytes"] > 2e7 and 56 * 160 * 120 <= guess["moved_bytes"] < 60 * 160 * 120
    wanted = opsr.dask.estimate(client, SCENE, size=(160, 120), target_error=0.2, integrator="path", resolve="raw")
    assert wanted["spp"] > 16


@pytest.fixture
def bucket(client, monkeypatch):
    """A bucket of a server of this machine."""
    server = pytest.importorskip("moto.server", reason="pip install 'moto[server]' s3fs")
    fs = pytest.importorskip("s3fs")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    address = "http://{}:{}".format(*running.get_host_and_port())
    names = {"AWS_ENDPOINT_URL": address, "AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b", "AWS_DEFAULT_REGION": "us-east-1"}
    for name, value in names.items():
        monkeypatch.setenv(name, value)
    client.run(lambda: os.environ.update(names))
    fs.S3FileSystem.clear_instance_cache()
    s3 = fs.S3FileSystem()
    s3.mkdir("renders")
    yield s3
    running.stop()


def test_scenes_recordings_and_results_have_addresses(client, bucket, moving, tmp_path):
    import opsr.dask

    bucket.put_file(str(SCENE), "renders/scenes/box.glb")
    settings = {"size": (32, 24), "spp": 8}
    opsr.dask.render(
        client,
        "s3://renders/scenes/box.glb",
        folder="s3://renders/work",
        output="s3://renders/out.exr",
        parts=3,
        **settings,
    )
    single = opsr.render(opsr.Scene.load(SCENE, name="s3://renders/scenes/box.glb"), **settings)
    assert bucket.cat_file("renders/out.exr") == saved(single, tmp_path / "one.exr")
    assert len(bucket.ls("renders/work/parts")) == 3
    assert bucket.exists("renders/work/index.html") and bucket.exists("renders/work/so-far.png")
    # A scene of several files, and frames.
    bucket.put(f"{moving.parent}/", "renders/moving/", recursive=True)
    frames = opsr.dask.animate(client, "s3://renders/moving/scene.gltf", [0, 2], "s3://renders/film/{}.png", **settings)
    assert all(bucket.cat_file(frame).startswith(b"\x89PNG") for frame in frames.values())
    crops = opsr.dask.record(client, TINY, "s3://renders/paths")
    assert len(bucket.ls("renders/paths")) == len(crops)
    [[table]] = opsr.dask.train(client, [TINY], recordings="s3://renders/paths")
    assert table.sha256 == opsr.train(TINY)[0].sha256


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
    with pytest.raises(ValueError, match="table"):
        opsr.dask.render(client, SCENE, size=(8, 8), spp=2, table=3, retries=0)
    with pytest.raises(TypeError, match="threads"):
        opsr.dask.render(client, SCENE, size=(8, 8), spp=2, threads=3)
    with pytest.raises(ValueError, match="spp: expected"):
        opsr.dask.train(client, [{**TINY, "spp": 1}], retries=0)
    with pytest.raises(FileNotFoundError, match="missing recordings"):
        opsr.dask.train(client, [TINY], recordings=tmp_path, retries=0)
