import os
import pathlib
import signal

import pytest

import opsr

ROOT = pathlib.Path(__file__).parents[2]
SCENES = ROOT / "training_scenes"


@pytest.fixture(scope="session", autouse=True)
def interrupts():
    # What a shell runs in the background inherits an ignored SIGINT, and Python would leave it ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def box():
    return opsr.Scene.load(SCENES / "cornell_caustics.glb")


@pytest.fixture(scope="session")
def program():
    """The program; OPSR names another than that of the target folder."""
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = pathlib.Path(os.environ.get("OPSR", target / "release" / "opsr"))
    if not path.exists():
        pytest.skip(f"{path}: no program to compare with")
    return path
