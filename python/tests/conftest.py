import os
import pathlib
import signal

import pytest

import opsr

ROOT = pathlib.Path(__file__).parents[2]
SCENES = ROOT / "training_scenes"

# A training of a second.
TINY = {
    "manifest": SCENES / "manifest.toml",
    "scenes": ["cornell_caustics"],
    "spp": 2,
    "steps": 3,
    "optimiser": "log",
    "start": 0.1,
    "validate_every": 2,
}

# A bench of a second.
SUITE = """
seeds = 2
samples = [4, 8]
[[scene]]
name = "plane"
builtin = "plane"
size = [16, 16]
reference_spp = 16
[[scene]]
name = "box"
builtin = "cornell-box"
size = [24, 24]
reference_spp = 64
[[scene]]
name = "caustics"
builtin = "caustic-box"
size = [24, 24]
reference_spp = 64
[[method]]
name = "plain"
[[method]]
name = "table"
table = "beta-0.05"
"""


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


@pytest.fixture
def two_families(tmp_path):
    """A training of one crop of each of two scenes."""
    manifest = ""
    for name, family, x, y in [("cornell_caustics", "box", 94, 92), ("rings", "rings", 112, 72)]:
        manifest += f'[[scene]]\nname = "{name}"\nfile = "{name}.glb"\nrole = "train"\nfamily = "{family}"\n'
        manifest += f"frame = [160, 160]\ncrops = [[{x}, {y}]]\nmax_vertices = 12\nexposure = 1.0\n"
        (tmp_path / f"{name}.glb").symlink_to(SCENES / f"{name}.glb")
    (tmp_path / "references").symlink_to(SCENES / "references")
    (tmp_path / "manifest.toml").write_text(manifest)
    return {**TINY, "manifest": tmp_path / "manifest.toml", "scenes": []}
