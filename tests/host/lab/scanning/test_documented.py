"""docs/scanning.md as it is typed."""

import re
import sys
from pathlib import Path

from tests.helpers.children import gellight, run
from tests.helpers.places import CHECKOUT

TEXT = (CHECKOUT / "docs/scanning.md").read_text()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    assert found
    return found[1]


def test_the_simulated_part_is_scanned_and_the_program_reads_its_map(tmp_path: Path) -> None:
    """The board is left out, and a third press is waited for: the first may be over before frames are looked at."""
    (tmp_path / "plate.json").write_text(block("json"))
    command = re.search(r'^gellight scan plate --sensor "(sim://\?)(.*)" --presses 2$', TEXT, re.MULTILINE)
    assert command
    url = f"{command[1]}board=0&{command[2]}"
    done = gellight("scan", "plate", "--sensor", url, "--presses", "3", "--port", "0", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "plate/map.npz: 3 of 3 presses" in done.stdout
    done = run([sys.executable, "-c", block("python")], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    height, width = map(int, re.findall(r"\d+", done.stdout)[:2])
    assert (height, width) > (505, 780), "larger than a view of 480 x 640 by the shift of 2 and 9 mm"
