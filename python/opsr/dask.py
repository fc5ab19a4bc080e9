"""Renders, trainings, studies and benches on a Dask cluster: this machine's cores, hosts over SSH, or a queue such as Slurm's.

    import dask
    from dask.distributed import Client, LocalCluster       # or dask_jobqueue.SLURMCluster, and the same lines
    import opsr.dask

    dask.config.set(opsr.dask.QUIET)
    client = Client(LocalCluster(n_workers=4, threads_per_worker=1))
    film = opsr.dask.render(client, "/shared/scene.glb", size=(1920, 1080), spp=1024, table="beta-0.001")
    tables = opsr.dask.train(client, [{"preset": "smoke", "seed": seed} for seed in range(8)])

Work is split into tasks, whose results are put together in order: those of a single process, whichever worker made what. A
task whose worker dies is done again by another. Files are read by the workers: give paths that all of them see. Dask's
dashboard shows the tasks.
"""

import functools
import json
import os
import pathlib
import tempfile

from dask.distributed import as_completed, get_worker

from . import Scene, Table, merge
from . import bench as _bench
from . import record as _record
from . import render as _render
from . import train as _train

__all__ = ["QUIET", "bench", "record", "render", "train"]

QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}
"""Settings for `dask.config.set`, before a cluster is made: workers that look after themselves once a second instead of up to a
hundred times, which takes 3 % of a core from each of them."""

_PATH = "path"


def _threads():
    """Threads of this worker for a task."""
    return get_worker().state.nthreads


def _done(client, work, jobs, retries):
    """Results of work on jobs, in order. Tasks are named after the work; an error or Ctrl-C cancels those that are left."""
    futures = client.map(work, jobs, pure=False, retries=retries, key=f"opsr.{work.__name__.strip('_')}")
    try:
        return client.gather(futures)
    finally:
        client.cancel(futures)


def _packed(table):
    """The bytes of a table's file."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "table.json"
        table.save(file)
        return file.read_bytes()


def _unpacked(data):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "table.json"
        file.write_bytes(data)
        return Table.load(file)


@functools.lru_cache(maxsize=1)
def _scene(path, changed, options):
    return Scene.load(path, **dict(options))


def _part(job):
    """A part of a render: the bytes of its file."""
    path, load, options, crop, samples = job
    if isinstance(options.get("table"), bytes):
        options = {**options, "table": _unpacked(options["table"])}
    scene = _scene(path, os.stat(path).st_mtime_ns, load)
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "part"
        _render(scene, crop=crop, part=file, samples=samples, threads=_threads(), **options)
        return file.read_bytes()


def _edges(length, parts):
    parts = min(parts, length)
    return [(k * length // parts, (k + 1) * length // parts) for k in range(parts)]


def _split(crop, spp, integrator, parts):
    """Crops and samples of the parts."""
    x, y, width, height = crop
    if integrator == _PATH:
        return [((x, y + a, width, b - a), (0, spp)) for a, b in _edges(height, parts)]
    # Every crop would trace all light paths again.
    return [(crop, samples) for samples in _edges(spp, parts)]


def render(client, scene, *, size, spp, crop=None, integrator=_PATH, parts=None, load=None, retries=3, on_part=None, **options):
    """Renders a scene on a cluster: the Film of `opsr.render` with the same options, bit by bit.

    client: a dask.distributed.Client.
    scene: path of the scene, for the workers to read.
    size: (width, height) of the whole frame in pixels.
    spp: samples per pixel.
    crop: (x, y, width, height) of the part to render.
    parts: number of tasks, by default four for each worker: bands of rows, and ranges of samples for integrators that trace
        light paths. These move 12 bytes for each pixel and sample, bands no more than a film of their pixels.
    load: options of `Scene.load`, as a dictionary.
    retries: further attempts at a task that fails, or whose worker dies, beyond those that the scheduler allows.
    on_part: called with (parts done, parts in all, bytes moved so far) after each part.
    options: as of `opsr.render`; no time, target_error, samples, part, threads and on_progress.

    Raises what `opsr.render` raises on a worker. Ctrl-C cancels the tasks.
    """
    for name in ("time", "target_error", "samples", "part", "threads", "on_progress"):
        if name in options:
            raise TypeError(f"{name}: not known to a render on a cluster")
    options.update(size=size, spp=spp, integrator=integrator)
    if isinstance(options.get("table"), Table):
        options["table"] = _packed(options["table"])
    workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    whole = crop or (0, 0, *size)
    load = tuple(sorted((load or {}).items()))
    split = _split(whole, spp, integrator, parts or 4 * workers)
    jobs = [(os.fspath(scene), load, options, *part) for part in split]
    futures = client.map(_part, jobs, pure=False, retries=retries, key="opsr.part")
    moved, files = 0, []
    try:
        with tempfile.TemporaryDirectory() as folder:
            for future in as_completed(futures):
                # Waits for the task to be done again if its worker died in between.
                data = future.result()
                files.append(pathlib.Path(folder) / f"{len(files)}.part")
                files[-1].write_bytes(data)
                moved += len(data)
                future.release()
                if on_part is not None:
                    on_part(len(files), len(jobs), moved)
            return merge(files, spp=spp, crop=whole)
    finally:
        client.cancel(futures)


def _crop(job):
    config, folder, index = job
    _record(config, folder, crops=(index, index + 1), threads=_threads())


def record(client, config, folder, *, retries=3):
    """Records a training on a cluster, one task for each crop: the files of `opsr.record`, whose result it returns.

    folder: for the workers to write; recordings that it has whole are kept.
    """
    crops = _record(config, folder, crops=(0, 0))
    _done(client, _crop, [(config, os.fspath(folder), index) for index in range(len(crops))], retries)
    return crops


def _learn(job):
    """Trains tables: the bytes of their files."""
    config, recordings = job
    return [_packed(table) for table in _train(config, recordings=recordings, threads=_threads())]


def train(client, configs, *, recordings=None, retries=3):
    """Trains tables on a cluster, one task for each configuration of `opsr.train`: a list of lists of Tables.

    recordings: a folder of recordings for all of them, such as `record` makes; without it each records anew.
    """
    jobs = [(config, recordings and os.fspath(recordings)) for config in configs]
    return [[_unpacked(data) for data in tables] for tables in _done(client, _learn, jobs, retries)]


def _measure(job):
    suite, scene = job
    with tempfile.TemporaryDirectory() as folder:
        return _bench(suite, pathlib.Path(folder) / "results.json", scenes=[scene], threads=_threads())


def bench(client, suite, output, *, retries=3):
    """Measures methods against each other on a cluster, one task for each scene: the results of `opsr.bench`.

    All methods of a scene are measured by one worker, in turns, so that their times can be compared. Let nothing else run
    beside it: one worker for each machine, with as many threads as it has cores.

    suite: path of the suite, for the workers to read.
    output: file of the results (.json), for `opsr report`; it is replaced.

    Returns the results. Errors of pictures are those of a single bench; "cpu" in "machine" names all processors.
    """
    with tempfile.TemporaryDirectory() as folder:
        results = _bench(suite, pathlib.Path(folder) / "results.json", scenes=[])
    jobs = [(os.fspath(suite), scene["name"]) for scene in results["suite"]["scene"]]
    parts = _done(client, _measure, jobs, retries)
    for key in ("scenes", "cells", "products", "insets"):
        results[key] = [item for part in parts for item in part[key]]
    processors = dict.fromkeys(part["machine"]["cpu"] for part in parts)
    results["machine"] = {**parts[0]["machine"], "cpu": ", ".join(processors)}
    text = json.dumps(results, separators=(",", ":"), allow_nan=False) + "\n"
    whole = pathlib.Path(output)
    begun = whole.with_name(whole.name + ".begun")
    begun.write_text(text)
    begun.replace(whole)
    return results
