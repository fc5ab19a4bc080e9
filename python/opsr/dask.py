"""Renders and trainings on a Dask cluster: this machine's cores, hosts over SSH, or a queue such as Slurm's.

    from dask.distributed import Client, LocalCluster       # or dask_jobqueue.SLURMCluster, and the same lines
    import opsr.dask

    client = Client(LocalCluster(n_workers=4, threads_per_worker=1))
    film = opsr.dask.render(client, "/shared/scene.glb", size=(1920, 1080), spp=1024, table="beta-0.001")
    tables = opsr.dask.train(client, [{"preset": "smoke", "seed": seed} for seed in range(8)])

A render is split into parts, each a task; its film has the bytes of the single render, whichever worker made what. A task
whose worker dies is done again by another. Files are read by the workers: give paths that all of them see. Dask's dashboard
shows the tasks.
"""

import functools
import os
import pathlib
import tempfile

from dask.distributed import as_completed, get_worker

from . import Scene, Table, merge
from . import render as _render
from . import train as _train

__all__ = ["render", "train"]

_PATH = "path"


@functools.lru_cache(maxsize=1)
def _scene(path, changed, options):
    return Scene.load(path, **dict(options))


def _part(path, load, options, crop, samples):
    """A part of a render: the bytes of its file."""
    scene = _scene(path, os.stat(path).st_mtime_ns, load)
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "part"
        _render(scene, crop=crop, part=file, samples=samples, threads=get_worker().state.nthreads, **options)
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
    workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    whole = crop or (0, 0, *size)
    jobs = _split(whole, spp, integrator, parts or 4 * workers)
    load = tuple(sorted((load or {}).items()))
    futures = [
        client.submit(_part, os.fspath(scene), load, options, *job, pure=False, retries=retries, key=f"opsr-{id(jobs)}-{k}")
        for k, job in enumerate(jobs)
    ]
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


def _learn(config):
    """Trains tables: the bytes of their files."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "table.json"
        saved = []
        for table in _train(config, threads=get_worker().state.nthreads):
            table.save(file)
            saved.append(file.read_bytes())
        return saved


def train(client, configs, *, retries=3):
    """Trains tables on a cluster, one task for each configuration of `opsr.train`: a list of lists of Tables."""
    futures = client.map(_learn, list(configs), pure=False, retries=retries)
    try:
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "table.json"

            def table(data):
                file.write_bytes(data)
                return Table.load(file)

            return [[table(data) for data in saved] for saved in client.gather(futures)]
    finally:
        client.cancel(futures)
