"""What docs/scanning.md measures, as it is typed."""

import re
import shlex
from pathlib import Path

from tests.helpers.children import gellight
from tests.helpers.places import CHECKOUT

TEXT = (CHECKOUT / "docs/scanning.md").read_text()


def test_a_plate_is_measured_and_written(tmp_path: Path) -> None:
    block = re.search(r"## Measuring\n.*?```sh\n(.*?)```", TEXT, re.DOTALL)
    assert block
    record, *measures, write = (shlex.split(line, comments=True)[1:] for line in block[1].splitlines())
    for words in (record, write):
        done = gellight(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"plate.mcap", "plate.png", "plate.x3p", "plate.stl"}
    area, line = (gellight(*words, cwd=tmp_path) for words in measures)
    assert re.match(r"Sa +1\d\.\d\d um ± 1\.30 um as felt; 18\.\d\d um with what the blur takes\n", area.stdout), area
    assert re.match(r"Ra +1\d\.\d\d um ± 1\.30 um as felt; 18\.\d\d um", line.stdout), line
    ra, error, plate = (float(line.stdout.split()[at]) for at in (1, 4, 8))
    assert ra < 0.03 * 2e3 / 3.1416 < plate + error
