"""KiCad as a judge: its Python module loads a board in a program of its own, since it belongs to the system's Python.

KiCad 6 is in Debian (`make tools` installs it); it is used here alone and never by what ships. After a change of a
carrier, `python -m tests.helpers.kicad` makes the archives of Gerber and drill files anew.
"""

import functools
import json
import re
import shutil
import subprocess
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.children import run
from tests.helpers.places import CHECKOUT

PYTHON = "/usr/bin/python3"
JUDGE = """
import json, sys, pcbnew
board = pcbnew.LoadBoard(sys.argv[1])
pcbnew.WriteDRCReport(board, sys.argv[2], pcbnew.EDA_UNITS_MILLIMETRES, True)
mm = pcbnew.ToMM
pads = [(p.GetParent().GetReference(), p.GetNumber(), mm(p.GetPosition().x), -mm(p.GetPosition().y), p.GetNetname())
        for p in board.GetPads()]
parts = [(f.GetReference(), mm(f.GetPosition().x), -mm(f.GetPosition().y), f.GetOrientationDegrees(), f.GetValue())
         for f in board.GetFootprints()]
plot = pcbnew.PLOT_CONTROLLER(board)
plot.GetPlotOptions().SetOutputDirectory(sys.argv[3])
plot.GetPlotOptions().SetDrillMarksType(0)
for name, layer in (
    ("F_Cu", pcbnew.F_Cu), ("B_Cu", pcbnew.B_Cu), ("F_Mask", pcbnew.F_Mask), ("B_Mask", pcbnew.B_Mask),
    ("F_Paste", pcbnew.F_Paste), ("F_Silkscreen", pcbnew.F_SilkS), ("Edge_Cuts", pcbnew.Edge_Cuts),
):
    plot.SetLayer(layer)
    plot.OpenPlotfile(name, pcbnew.PLOT_FORMAT_GERBER, name)
    plot.PlotLayer()
plot.ClosePlot()
drill = pcbnew.EXCELLON_WRITER(board)
drill.SetOptions(False, False, pcbnew.wxPoint(0, 0), False)
drill.SetFormat(True)
drill.CreateDrillandMapFilesSet(sys.argv[3], True, False)
pours = [zone for zone in board.Zones() if not zone.GetIsRuleArea()]
poured = [zone.CalculateFilledArea() for zone in pours]
pcbnew.ZONE_FILLER(board).Fill(board.Zones())
filled = [zone.CalculateFilledArea() for zone in pours]
json.dump({"pads": pads, "parts": parts, "poured": poured, "filled": filled}, open(sys.argv[4], "w"))
"""


@dataclass(frozen=True)
class Verdict:
    """What KiCad finds in a board."""

    errors: list[str]
    """of its design rules: kind and place, those of severity error"""
    warnings: list[str]
    unconnected: int
    pads: list[tuple[str, str, float, float, str]]
    """part, pad, x and y in mm (y up), net"""
    parts: list[tuple[str, float, float, float, str]]
    """reference, x, y, degrees, value"""
    plots: dict[str, Path]
    """Gerber and drill files that KiCad plots of the same file, by layer"""
    pours: list[tuple[float, float]]
    """mm2 of each pour as its file has it, and as KiCad would fill it"""


@functools.cache
def has_kicad() -> bool:
    try:
        return subprocess.run([PYTHON, "-c", "import pcbnew"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def judge(folder: Path, name: str) -> Verdict:
    """Let KiCad check and plot a project that lies in a folder; skips the test where KiCad is missing."""
    if not has_kicad():
        pytest.skip("needs KiCad: sudo apt-get install --no-install-recommends kicad")
    script, report, facts = folder / "judge.py", folder / "report.txt", folder / "facts.json"
    script.write_text(JUDGE)
    run([PYTHON, script, folder / f"{name}.kicad_pcb", report, folder / "plots", facts], check=True)
    text, found = report.read_text(), json.loads(facts.read_text())
    violations = re.findall(r"^\[(\w+)\]: (.*)\n.*severity: (\w+)((?:\n    @.*)+)", text, re.I | re.M)
    by_severity: dict[str, list[str]] = {"error": [], "warning": []}
    for kind, says, severity, places in violations:
        by_severity[severity].append(f"{kind}: {says}{places}")
    unconnected = re.search(r"Found (\d+) unconnected", text)
    assert unconnected is not None, text
    counted = re.search(r"Found (\d+) DRC", text)
    assert counted is not None
    assert len(violations) == int(counted[1]), text
    plots = {path.stem.removeprefix(f"{name}-"): path for path in (folder / "plots").iterdir()}
    as_tuples: Any = [tuple(pad) for pad in found["pads"]]
    return Verdict(
        by_severity["error"], by_severity["warning"], int(unconnected[1]), as_tuples,
        [tuple(part) for part in found["parts"]], plots,
        [(ours / 1e12, theirs / 1e12) for ours, theirs in zip(found["poured"], found["filled"], strict=True)],
    )  # fmt: skip


CARRIERS = CHECKOUT / "host/gellight_design/gellight_design/boards/carriers"
LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""in an archive: the same board gives the same bytes"""


def archive(verdict: Verdict, path: Path) -> None:
    """Pack what KiCad plots, without the dates in it."""
    with zipfile.ZipFile(path, "w") as packed:
        for plot in sorted(verdict.plots.values()):
            name = plot.stem + (".drl" if plot.suffix == ".drl" else ".gbr")
            lines = plot.read_text().splitlines(keepends=True)
            text = "".join(line for line in lines if "CreationDate" not in line and " date " not in line)
            packed.writestr(zipfile.ZipInfo(name, LONG_AGO), text, zipfile.ZIP_DEFLATED)


def main() -> None:
    for folder in sorted(CARRIERS.iterdir()):
        name = f"gellight-carrier-{folder.name}"
        with tempfile.TemporaryDirectory() as copied:
            here = Path(shutil.copytree(folder, copied, dirs_exist_ok=True))
            archive(judge(here, name), folder / f"{name}-gerbers.zip")


if __name__ == "__main__":
    main()
