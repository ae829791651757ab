"""docs/tracking.md as it is typed."""

import re
import sys
from pathlib import Path

from tests.helpers.children import gellight, run
from tests.helpers.places import CHECKOUT

TEXT = (CHECKOUT / "docs/tracking.md").read_text()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    assert found
    return found[1]


def test_the_sequence_is_simulated_and_the_program_tells_where_the_object_is(tmp_path: Path) -> None:
    (tmp_path / "peg.json").write_text(block("json"))
    command = re.search(r"^gellight (simulate sequence .*)$", TEXT, re.MULTILINE)
    assert command
    done = gellight(*command[1].split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "peg").iterdir()) == [
        "00000.png", "00001.png", "00002.png", "poses.csv",
    ]  # fmt: skip
    program = block("python").replace("sim://", "sim://?board=0&sequence=peg.json").replace("range(100)", "range(3)")
    assert "peg.json" in program
    done = run([sys.executable, "-c", program], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("object 1 at (")
