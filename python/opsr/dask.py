"""Renders, films, trainings, studies and benches on a Dask cluster: this machine's cores, hosts over SSH, or a queue's.

    import dask
    from dask.distributed import Client, LocalCluster       # or dask_jobqueue.SLURMCluster, and the same lines
    import opsr.dask

    dask.config.set(opsr.dask.QUIET)
    client = Client(LocalCluster(n_workers=4, threads_per_worker=1))
    film = opsr.dask.render(client, "/shared/scene.glb", size=(1920, 1080), spp=1024, table="beta-0.001")
    tables = opsr.dask.train(client, [{"preset": "smoke", "seed": seed} for seed in range(8)])

Work is split into tasks, whose results are put together in order: those of a single process, whichever worker made what. A
task whose worker dies is done again by another. Scenes, recordings and results may be at any address of fsspec, such as
"s3://bucket/scene.glb", that the workers can read and write. Dask's dashboard shows the tasks.
"""

import functools
import hashlib
import html
import json
import math
import os
import pathlib
import queue
import tempfile
import time
import uuid

import fsspec
from dask.distributed import get_worker
from distributed.worker import thread_state

from . import Scene, Table, __version__, choose, merge
from . import bench as _bench
from . import record as _record
from . import render as _render
from . import train as _train

__all__ = ["QUIET", "animate", "bench", "estimate", "record", "render", "train"]

QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.large-graph-warning-threshold": "1GB",
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


def _remote(address):
    return "://" in os.fspath(address)


def _place(address):
    """The file system of an address, and the path in it."""
    return fsspec.url_to_fs(os.fspath(address))


def _put(data, address):
    """Writes a file, whole or not at all."""
    fs, path = _place(address)
    fs.makedirs(path.rpartition("/")[0], exist_ok=True)
    fs.pipe_file(f"{path}.begun", data)
    fs.mv(f"{path}.begun", path)


@functools.lru_cache(maxsize=2)
def _copied(address, version):
    fs, path = _place(address)
    folder, _, name = path.rpartition("/")
    # The worker removes it at its end.
    here = pathlib.Path(tempfile.mkdtemp(prefix="opsr-", dir=get_worker().local_directory))
    if name.endswith(".glb"):
        fs.get_file(path, str(here / name))
    else:
        fs.get(f"{folder}/", f"{here}/", recursive=True)
    return here / name


@functools.lru_cache(maxsize=1)
def _loaded(address, version, options):
    if not _remote(address):
        return Scene.load(address, **dict(options))
    return Scene.load(_copied(address, version), name=address, **dict(options))


def _scene(address, options):
    """A scene, with all files of its folder unless it is a .glb, loaded again when it has changed."""
    fs, path = _place(address)
    return _loaded(address, fs.checksum(path), tuple(sorted(options.items())))


def _hash(scene):
    return _scene(*scene).sha256


def _wanted():
    """Says whether the running task is wanted still: it is not when another was faster, and after Ctrl-C."""
    tasks, key = get_worker().state.tasks, thread_state.key
    return lambda progress: key in tasks and tasks[key].state != "cancelled"


def _given(options):
    """Options as `opsr.render` takes them."""
    table = options.get("table")
    return {**options, "table": _unpacked(table)} if isinstance(table, bytes) else options


def _part(job):
    """A part of a render: the bytes of its file."""
    scene, options, crop, samples, begun = job
    with tempfile.TemporaryDirectory() as folder:
        old, new = pathlib.Path(folder) / "old", pathlib.Path(folder) / "new"
        if begun is not None:
            old.write_bytes(begun)
            options = {**options, "begun": old}
        settings = {"crop": crop, "samples": samples, "threads": _threads(), "on_progress": _wanted()}
        _render(_scene(*scene), part=new, **settings, **_given(options))
        return new.read_bytes()


def _choice(job):
    """The options of the method that `opsr.choose` names, without those that have the caller's value."""
    scene, options = job
    given = _given(options)
    chosen = choose(_scene(*scene), **given)
    return {name: value for name, value in chosen.items() if name == "integrator" or value is not given.get(name)}


def _method(client, scene, load, options, folder=None):
    """The method of a render, for all of its parts: the one that the folder has begun with, or that `opsr.choose` names."""
    if folder is not None:
        fs, path = _place(f"{folder}/opsr.json")
        begun = json.loads(fs.cat_file(path)) if fs.exists(path) else {}
        if "method" in begun:
            return begun["method"]
    return client.submit(_choice, ((scene, load), options), pure=False).result()


def _frame(job):
    """Renders a frame of an animation into its file."""
    scene, options, address = job
    wanted = _wanted()
    film = _render(_scene(*scene), threads=_threads(), on_progress=wanted, **_given(options))
    # A task that was cancelled has the samples so far.
    if wanted(None):
        _save(film, address)
    return b""


def _save(film, address):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / f"film{pathlib.PurePosixPath(address).suffix}"
        film.save(file)
        _put(file.read_bytes(), address)


def _timed(work, job):
    begin, cpu = time.monotonic(), time.process_time()
    result = work(job)
    return result, time.monotonic() - begin, time.process_time() - cpu


_PATIENCE = 2.0
"""A task is late after so many times the longest that any other has taken."""


def _results(client, work, jobs, retries):
    """Numbers, results and CPU seconds of work on jobs, as they are done.

    Tasks that are late when workers have nothing else to do are sent once more. The first result counts, and the other task
    ends after its pass. An error or Ctrl-C cancels all.
    """
    done, sent, left = queue.SimpleQueue(), {}, {number: 1 for number in range(len(jobs))}

    def send(number):
        key = f"opsr.{work.__name__.strip('_')}-{number}-{uuid.uuid4().hex[:8]}"
        future = client.submit(_timed, work, jobs[number], pure=False, retries=retries, key=key)
        sent.setdefault(number, []).append(future)
        future.add_done_callback(lambda future: done.put((number, future)))

    try:
        for number in left:
            send(number)
        last, longest = time.monotonic(), math.inf
        while left:
            try:
                number, future = done.get(timeout=0.5)
            except queue.Empty:
                idle = sum(client.nthreads().values()) - len(left)
                if idle > 0 and time.monotonic() - last > _PATIENCE * longest:
                    for number in [number for number, times in left.items() if times == 1][:idle]:
                        left[number] = 2
                        send(number)
                continue
            if number not in left:
                continue
            # Waits for the task to be done again if its worker died in between.
            result, seconds, cpu = future.result()
            del left[number]
            client.cancel(sent.pop(number))
            last = time.monotonic()
            longest = max(seconds, 0.0 if longest == math.inf else longest)
            yield number, result, cpu
    finally:
        client.cancel([future for futures in sent.values() for future in futures])


def _claim(folder, settings):
    """Makes a folder that of a work, or finds that it is."""
    text = json.dumps(settings, indent=1, sort_keys=True, default=str)
    address = f"{folder}/opsr.json"
    fs, path = _place(address)
    if not fs.exists(path):
        _put(text.encode(), address)
        return
    before, now = json.loads(fs.cat_file(path)), json.loads(text)
    other = [name for name in sorted(before.keys() | now.keys()) if before.get(name) != now.get(name)]
    if other:
        raise ValueError(f"folder: {folder} has another work, of other {', '.join(other)}")


def _work(client, scene, load, options):
    """All that a picture depends on but its samples."""
    table = options.get("table")
    if isinstance(table, bytes):
        options = {**options, "table": hashlib.sha256(table).hexdigest()}
    sha256 = client.submit(_hash, (scene, load), pure=False).result()
    return {"opsr": __version__, "scene": sha256, "load": load, **options}


def _checked(options, names):
    """Options for workers."""
    for name in names:
        if name in options:
            raise TypeError(f"{name}: not known to a render on a cluster")
    if isinstance(options.get("table"), Table):
        options = {**options, "table": _packed(options["table"])}
    return options


def _edges(begin, end, parts):
    length = end - begin
    parts = min(parts, length)
    return [(begin + k * length // parts, begin + (k + 1) * length // parts) for k in range(parts)]


class _Parts:
    """Finished parts by (crop, samples): files here, and copies in a folder, with a page of the picture so far."""

    def __init__(self, here, folder):
        self.here, self.folder, self.files = pathlib.Path(here), folder, {}
        self.moved = self.cpu = self.shown = 0.0
        self.cost = 0.1
        if folder is not None:
            fs, path = _place(f"{folder}/parts")
            for name in fs.glob(f"{path}/*.part"):
                file = self.here / name.rpartition("/")[2]
                numbers = tuple(map(int, file.stem.split("-")))
                fs.get_file(name, str(file))
                self.files[numbers[:4], numbers[4:]] = file

    def add(self, crop, samples, data, cpu):
        """Keeps a part. One of the same pixels and of fewer samples from 0 on has become it."""
        file = self.here / f"{'-'.join(map(str, (*crop, *samples)))}.part"
        file.write_bytes(data)
        self.moved, self.cpu = self.moved + len(data), self.cpu + cpu
        if self.folder is not None:
            _put(data, f"{self.folder}/parts/{file.name}")
        self.files[crop, samples] = file
        for old in [old for old in self.files if old[0] == crop and old[1][0] == samples[0] and old[1] != samples]:
            file = self.files.pop(old)
            file.unlink()
            if self.folder is not None:
                fs, path = _place(f"{self.folder}/parts/{file.name}")
                fs.rm_file(path)

    def jobs(self, crop, integrator, parts, spp):
        """Crops, samples and begun parts of what is missing from this many samples."""
        x, y, width, height = crop
        if integrator == _PATH:
            bands = [(x, a, width, b - a) for a, b in _edges(y, y + height, parts)]
            most = {band: samples[1] for band, samples in sorted(self.files)}
            begun = {band: self.files[band, (0, n)].read_bytes() for band, n in most.items() if n < spp}
            return [(band, (0, spp), begun.get(band)) for band in bands if most.get(band, 0) < spp]
        # Every crop would trace all light paths again.
        next, gaps = 0, []
        for begin, end in [*sorted(samples for _, samples in self.files), (spp, spp)]:
            gaps += [(next, begin)] if begin > next else []
            next = max(next, end)
        left = sum(b - a for a, b in gaps)
        share = [range for a, b in gaps for range in _edges(a, b, max(1, round(parts * (b - a) / left)))]
        return [(crop, samples, None) for samples in share]

    def show(self, client, crop, text):
        """The picture so far, seldom enough to cost a hundredth of the time."""
        if self.folder is None or time.monotonic() < self.shown + 100 * self.cost:
            return
        begin = time.monotonic()
        _save(merge(list(self.files.values()), crop=crop, partial=True), f"{self.folder}/so-far.png")
        link = html.escape(client.dashboard_link)
        page = f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="10"><title>opsr</title><p>{html.escape(text)}'
        page += f', {self.cpu / 3600:.2f} h of CPU; <a href="{link}">tasks</a></p><img src="so-far.png" alt="the picture so far">'
        _put(page.encode(), f"{self.folder}/index.html")
        self.shown = time.monotonic()
        self.cost = self.shown - begin


_FIRST = 16
"""Samples of the first round: fewer know their error too badly."""


def _next_round(spp, error, target, most):
    """Samples at which a picture that has this error after spp may have less than target: noise falls with their root."""
    ratio = (error / target) ** 2 if math.isfinite(error) else 2.0
    return min(most, math.ceil(spp * min(2.0, max(1.125, ratio))))


def render(
    client, scene, *, size, spp=None, target_error=None, crop=None, integrator=None, parts=None, load=None, retries=3,
    folder=None, output=None, on_part=None, **options,
):
    """Renders a scene on a cluster: the Film of `opsr.render` with the same options, bit by bit.

    client: a dask.distributed.Client.
    scene: path or address of the scene, for the workers to read: of a .glb alone, of others all files of the folder.
    size: (width, height) of the whole frame in pixels.
    spp: samples per pixel; with a target_error the most.
    target_error: ends the render at this `Film.error_bound`, in rounds of at most twice the samples before. The film has the
        bytes of `opsr.render` with as many samples.
    crop: (x, y, width, height) of the part to render.
    integrator: name; by default the one that `opsr.choose` names, chosen once, on a worker.
    parts: number of tasks, by default eight for each worker: bands of rows, and ranges of samples for integrators that trace
        light paths. These move 12 bytes for each pixel and sample, bands no more than a film of their pixels.
    load: options of `Scene.load`, as a dictionary.
    retries: further attempts at a task that fails, or whose worker dies, beyond those that the scheduler allows.
    folder: path or address of a folder for finished parts and a page, index.html, with the picture so far. The same call goes
        on with what is there, with other spp and target_error too.
    output: path or address of a file for the film: .exr or .png.
    on_part: called with (parts done, parts of the round, bytes moved so far) after each part.
    options: as of `opsr.render`; no time, samples, part, begun, threads and on_progress.

    Raises what `opsr.render` raises on a worker, ValueError for a folder of another work. Ctrl-C cancels the tasks.
    """
    options = _checked(options, ("time", "samples", "part", "begun", "threads", "on_progress"))
    if spp is None and target_error is None:
        raise TypeError("render() needs spp or target_error")
    if target_error is not None and not target_error > 0:
        raise ValueError("target_error: expected a number above 0")
    scene, load, whole = os.fspath(scene), load or {}, tuple(crop or (0, 0, *size))
    options.update(size=size, integrator=integrator)
    if folder is not None:
        folder = os.fspath(folder).rstrip("/")
    bounds = {"spp": spp, "target_error": target_error, "crop": crop}
    method = _method(client, scene, load, {**options, **bounds}, folder)
    if folder is not None:
        fs, path = _place(f"{folder}/opsr.json")
        if parts is None and fs.exists(path):
            parts = json.loads(fs.cat_file(path)).get("parts")
    parts = parts or 8 * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    if folder is not None:
        _claim(folder, {**_work(client, scene, load, options), "method": method, "crop": whole, "parts": parts})
    options.update(method)
    integrator = method["integrator"]
    most = spp if spp is not None else math.inf
    samples = most if target_error is None else min(_FIRST, most)
    with tempfile.TemporaryDirectory() as here:
        kept = _Parts(here, folder)
        while True:
            todo = kept.jobs(whole, integrator, parts, samples)
            jobs = [((scene, load), {**options, "spp": samples}, *job) for job in todo]
            for done, (number, data, cpu) in enumerate(_results(client, _part, jobs, retries), 1):
                kept.add(*todo[number][:2], data, cpu)
                kept.show(client, whole, f"{samples} samples, {done} of {len(jobs)} parts")
                if on_part is not None:
                    on_part(done, len(jobs), int(kept.moved))
            film = merge(list(kept.files.values()), spp=samples, crop=whole)
            if target_error is None or samples == most or film.error_bound <= target_error:
                break
            samples = _next_round(samples, film.error_bound, target_error, most)
        if output is not None:
            _save(film, os.fspath(output))
        kept.shown = -math.inf
        kept.show(client, whole, f"done, {samples} samples, error {film.relative_error:.3g}")
        return film


def animate(client, scene, frames, output, *, fps=24, load=None, retries=3, on_frame=None, **options):
    """Renders frames of an animation on a cluster, one task for each, into the files of `opsr.render` and `Film.save`.

    A method that is not named is the one that `opsr.choose` names for the first frame. Frame N has the seed `seed` + N, so that
    `opsr film` averages their noise.

    scene: path or address of the scene, for the workers to read, as of `render`.
    frames: numbers of the frames, from 0 at the start of the animations.
    fps: frames per second.
    output: path or address of a frame's file, .exr or .png, with a place for its number: "s3://bucket/film/{:04}.exr". Files
        that are there are left alone, so that the same call goes on after an end; opsr.json beside them says what they are of.
    load: options of `Scene.load`, as a dictionary.
    on_frame: called with (number, address) after each frame.
    options: as of `opsr.render`; no part, samples, begun, threads and on_progress.

    Returns the addresses by the frames' numbers. Raises what `render` raises.
    """
    options = _checked(options, ("samples", "part", "begun", "threads", "on_progress"))
    frames = list(frames)
    addresses = {frame: os.fspath(output).format(frame) for frame in frames}
    if len(set(addresses.values())) < len(frames):
        raise ValueError("output: no place for the number of a frame, such as {:04}")
    scene, load = os.fspath(scene), load or {}
    if frames:
        first, folder = {**load, "at": f"{frames[0]}@{fps}"}, os.fspath(output).rpartition("/")[0] or "."
        method = _method(client, scene, first, options, folder)
        _claim(folder, {**_work(client, scene, first, options), "load": load, "fps": fps, "method": method})
        options.update(method)
    todo = [frame for frame, address in addresses.items() if not _exists(address)]
    seeded = lambda frame: {**options, "seed": ((options.get("seed") or 0) + frame) % 2**64}
    jobs = [((scene, {**load, "at": f"{frame}@{fps}"}), seeded(frame), addresses[frame]) for frame in todo]
    for number, _, _ in _results(client, _frame, jobs, retries):
        if on_frame is not None:
            on_frame(todo[number], addresses[todo[number]])
    return addresses


def _exists(address):
    fs, path = _place(address)
    return fs.exists(path)


def _probe(job):
    """CPU seconds of a path, bytes of a pixel's part, the error after some samples, and the memory of this process."""
    import psutil

    scene, options, (width, height) = job
    scene = _scene(*scene)
    scale = min(1.0, math.sqrt(4096 / (width * height)))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    ranges = options["integrator"] != _PATH
    samples, cpu = 8, 0.0
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "part"
        while True:
            begin = time.process_time()
            span = (0, samples)
            _render(scene, part=file, samples=span, threads=_threads(), **_given({**options, "size": size, "spp": samples}))
            cpu = time.process_time() - begin
            if cpu > 1.0 or samples == 256:
                break
            samples *= 2
        film = merge([file])
        if ranges:
            _render(scene, part=file, samples=(1, 2), threads=_threads(), **_given({**options, "size": size, "spp": 2}))
        pixels = size[0] * size[1]
        memory = psutil.Process().memory_info().rss
        return cpu / (pixels * samples), file.stat().st_size / pixels, film.error_bound, samples, memory


def estimate(client, scene, *, size, spp=None, target_error=None, crop=None, integrator=None, parts=None, load=None, **options):
    """What a `render` of these arguments will take, from a small one on a worker: about a second and a half beside loading.

    Returns a dict: "spp", with a target_error from the law that noise falls with the root of the samples; "cpu_hours"; "hours",
    of all threads of this cluster; "worker_bytes", memory of a worker with one task; "driver_bytes", of the merge; "moved_bytes",
    from workers to here.
    """
    options = {**_checked(options, ("time", "samples", "part", "begun", "threads", "on_progress")), "integrator": integrator}
    bounds = {"spp": spp, "target_error": target_error, "size": tuple(size)}
    options.update(_method(client, os.fspath(scene), load or {}, {**options, **bounds}))
    integrator = options["integrator"]
    _, _, width, height = crop or (0, 0, *size)
    pixels = width * height
    probe = client.submit(_probe, ((os.fspath(scene), load or {}), options, tuple(size)), pure=False)
    seconds, bytes_each, error, samples, memory = probe.result()
    if target_error is not None:
        guess = max(_FIRST, math.ceil(samples * (error / target_error) ** 2)) if math.isfinite(error) else None
        spp = guess if spp is None else min(spp, guess or spp)
    if spp is None:
        raise TypeError("estimate() needs spp, or a target_error of a scene with light")
    workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    parts = parts or 8 * workers
    hours = seconds * pixels * spp / 3600
    whole = bytes_each * pixels * (spp if integrator != _PATH else 1)
    return {
        "spp": spp,
        "cpu_hours": hours,
        "hours": hours / sum(client.nthreads().values()),
        "worker_bytes": int(memory + 3 * whole / parts),
        "driver_bytes": int(3 * whole if integrator == _PATH else whole / parts + 250 * pixels),
        "moved_bytes": int(whole),
    }


def _crop(job):
    config, folder, index, name = job
    if not _remote(folder):
        _record(config, folder, crops=(index, index + 1), threads=_threads())
    elif not _exists(f"{folder}/{name}"):
        with tempfile.TemporaryDirectory() as here:
            _record(config, here, crops=(index, index + 1), threads=_threads())
            _put((pathlib.Path(here) / name).read_bytes(), f"{folder}/{name}")


def record(client, config, folder, *, retries=3):
    """Records a training on a cluster, one task for each crop: the files of `opsr.record`, whose result it returns.

    folder: path or address, for the workers to write; recordings that it has whole are kept.
    """
    folder = os.fspath(folder).rstrip("/")
    with tempfile.TemporaryDirectory() as here:
        crops = _record(config, here if _remote(folder) else folder, crops=(0, 0))
    _done(client, _crop, [(config, folder, index, crop["file"]) for index, crop in enumerate(crops)], retries)
    return crops


def _learn(job):
    """Trains tables: the bytes of their files."""
    config, recordings = job
    with tempfile.TemporaryDirectory() as here:
        if recordings and _remote(recordings):
            fs, path = _place(recordings)
            fs.get(f"{path}/", f"{here}/", recursive=True)
            recordings = here
        return [_packed(table) for table in _train(config, recordings=recordings, threads=_threads())]


def train(client, configs, *, recordings=None, retries=3):
    """Trains tables on a cluster, one task for each configuration of `opsr.train`: a list of lists of Tables.

    recordings: path or address of recordings for all of them, such as `record` makes; without it each records anew.
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
    output: path or address of the results (.json), for `opsr report`; it is replaced.

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
    _put(text.encode(), output)
    return results
