import os
import pathlib

import pytest

import opsr

ROOT = pathlib.Path(__file__).parents[2]
SCENES = ROOT / "training_scenes"


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
