"""The notebook that is opened first runs from its first cell to its last, and is kept without outputs."""

import json
import os
import sys
from pathlib import Path

from tests.helpers.children import run
from tests.helpers.places import CHECKOUT

CELLS = json.loads((CHECKOUT / "docs/first_touch.ipynb").read_text())["cells"]
CODE = ["".join(cell["source"]) for cell in CELLS if cell["cell_type"] == "code"]


def test_every_cell_runs_in_its_order(tmp_path: Path) -> None:
    shown = "plt.show()\nprint('drawn', plt.gca().images[0].get_array().max())"
    code = "\n".join(CODE).replace("plt.show()", shown)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = run([sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "MPLBACKEND": "Agg", "PATH": path})
    assert done.returncode == 0, done.stderr
    for told in ("drawn 0.9", "contact 1 at (2.0", " N, give or take ", "frames, deepest 1.0"):
        assert told in done.stdout


def test_it_is_kept_without_outputs() -> None:
    assert len({cell["id"] for cell in CELLS}) == len(CELLS)
    code = [cell for cell in CELLS if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
