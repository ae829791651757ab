"""The notebook that is opened first runs from its first cell to its last."""

import json
import os
import re
import sys
from pathlib import Path

import pytest

from tests.helpers.children import run
from tests.helpers.places import CHECKOUT

CELLS = json.loads((CHECKOUT / "docs/first_touch.ipynb").read_text())["cells"]
CODE = ["".join(cell["source"]) for cell in CELLS if cell["cell_type"] == "code"]


@pytest.mark.nightly
def test_every_cell_runs_in_its_order(tmp_path: Path) -> None:
    shown = "plt.show()\nprint('drawn', plt.gca().images[0].get_array().max())"
    code = "\n".join(CODE).replace("plt.show()", shown)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = run([sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "MPLBACKEND": "Agg", "PATH": path})
    assert done.returncode == 0, done.stderr
    for told in ("drawn 0.9", "contact 1 at (2.0", " N, give or take "):
        assert told in done.stdout
    (deepest_mm,) = re.findall(r"frames, deepest (\S+) mm", done.stdout)
    assert float(deepest_mm) == pytest.approx(1.0, abs=0.015)
