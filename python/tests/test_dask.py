"""Renders on a cluster of several processes, one of which is killed: the bytes of the single render."""

import os
import signal

import pytest

import opsr
from conftest import SCENES

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


def test_errors_of_workers_arrive(client):
    import opsr.dask

    with pytest.raises(FileNotFoundError):
        opsr.dask.render(client, "none.glb", size=(8, 8), spp=2, retries=0)
    with pytest.raises(ValueError, match="gamma"):
        opsr.dask.render(client, SCENE, size=(8, 8), spp=2, gamma=3, retries=0)
    with pytest.raises(TypeError, match="threads"):
        opsr.dask.render(client, SCENE, size=(8, 8), spp=2, threads=3)
