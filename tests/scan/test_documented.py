"""docs/scanning.md as it is typed."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from tests.helpers.children import gellight, run
from tests.helpers.doc_examples import examples
from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.nightly
DOCUMENT = "docs/scanning.md"
TEXT = (CHECKOUT / DOCUMENT).read_text()


def test_the_simulated_part_is_scanned_and_the_program_reads_its_map(tmp_path: Path) -> None:
    """Without the board. A third press is waited for: the first may be over before frames are looked at."""
    (tmp_path / "plate.json").write_text(examples(DOCUMENT, "json")[0])
    command = re.search(r'^gellight scan plate --sensor "(sim://\?)(.*)" --presses 2$', TEXT, re.MULTILINE)
    assert command
    url = f"{command[1]}board=0&{command[2]}"
    done = gellight("scan", "plate", "--sensor", url, "--presses", "3", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "plate/map.npz: 3 of 3 presses" in done.stdout
    done = run([sys.executable, "-c", examples(DOCUMENT)[0]], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    height, width = map(int, re.findall(r"\d+", done.stdout)[:2])
    assert (height, width) > (505, 780), "larger than a view of 480 x 640 by the shift of 2 and 9 mm"


def test_a_body_that_rolls_becomes_a_mesh(tmp_path: Path) -> None:
    """Without the board."""
    (tmp_path / "roll.json").write_text(examples(DOCUMENT, "json")[1])
    command = re.search(r'^gellight scan bead --body --sensor "(sim://\?)(.*)" --presses 3$', TEXT, re.MULTILINE)
    assert command
    url = f"{command[1]}board=0&{command[2]}"
    done = gellight(
        "scan", "bead", "--body", "--sensor", url, "--presses", "3", "--set", "dashboard.port=0", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "bead/body.ply: 3 of 3 touches" in done.stdout


def test_a_plate_is_measured_and_written(tmp_path: Path) -> None:
    measuring = re.search(r"## Measuring\n.*?```sh\n(.*?)```", TEXT, re.DOTALL)
    assert measuring
    record, *measures, write = (shlex.split(line, comments=True)[1:] for line in measuring[1].splitlines())
    for words in (record, write):
        done = gellight(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"plate.mcap", "plate.png", "plate.x3p", "plate.stl"}
    area, line = (gellight(*words, cwd=tmp_path) for words in measures)
    assert re.match(r"Sa +1\d\.\d\d um ± 1\.30 um as felt; 1[89]\.\d\d um with", area.stdout), area
    assert re.match(r"Ra +1\d\.\d\d um ± 1\.30 um as felt; 1[89]\.\d\d um", line.stdout), line
    ra, error, plate = (float(line.stdout.split()[at]) for at in (1, 4, 8))
    assert ra < 0.03 * 2e3 / 3.1416 < plate + error
