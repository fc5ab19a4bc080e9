"""Notebooks: no outputs in the repository, and every cell runs."""

import json
import pathlib
import shutil

import pytest

EXAMPLES = pathlib.Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib").use("Agg")
    book = json.loads(path.read_text())
    cells = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    assert cells and not any(cell["outputs"] or cell["execution_count"] for cell in cells)
    # A folder as deep as that of the notebook, beside the scenes; what a notebook writes stays in it.
    folder = tmp_path / "python" / "examples"
    folder.mkdir(parents=True)
    (tmp_path / "training_scenes").symlink_to(EXAMPLES.parents[1] / "training_scenes")
    monkeypatch.chdir(folder)
    names = {}
    for cell in cells:
        exec(compile("".join(cell["source"]), path.name, "exec"), names)
    shutil.rmtree(folder)
