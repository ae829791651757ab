"""KiCad judges the boards: its design rules find no fault, and it plots and reads what our files say."""

import re
from collections import Counter
from math import radians
from pathlib import Path

import numpy as np
import pytest

from gellight_design.boards.catalogue import CARRIERS
from gellight_design.boards.files import carrier_files
from gellight_design.boards.strip import strip_board
from sim_reference.geometry import SensorGeometry
from tests.helpers.boards import objects, ring_of, rolled_up, spot, table, write_files, write_project
from tests.helpers.kicad import Verdict, judge

pytestmark = [pytest.mark.kicad, pytest.mark.nightly]
DANGLING = "track_dangling: Track has unconnected end"


def shapes(path: Path) -> Counter[tuple[str, ...]]:
    """Count what a Gerber draws: kind, places in 0.01 mm, width; a line counts from either end."""
    from gerbonara.graphic_objects import Flash, Region

    found: Counter[tuple[str, ...]] = Counter()
    for one in objects(path):
        if isinstance(one, Flash):
            found["flash", *(spot(*corner) for corner in one.bounding_box("mm"))] += 1
        elif isinstance(one, Region):
            found["region", *sorted({spot(*point) for point in one.outline})] += 1
        elif (one.x1, one.y1) != (one.x2, one.y2):
            ends = sorted((spot(one.x1, one.y1), spot(one.x2, one.y2)))
            found[type(one).__name__, *ends, f"{one.aperture.equivalent_width():.2f}"] += 1
    return found


@pytest.fixture(scope="module")
def strip(made: Path) -> Verdict:
    return judge(made, "gellight-strip")


@pytest.fixture(scope="module", params=CARRIERS)
def carrier(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Verdict:
    folder = tmp_path_factory.mktemp("carrier")
    write_files(folder, dict(carrier_files(request.param)))
    return judge(folder, f"gellight-carrier-{request.param}")


def rules_hold(verdict: Verdict) -> None:
    assert verdict.errors == []
    assert verdict.unconnected == 0
    # The rails of the strip are wider than what ends on them: KiCad misses something at their ends.
    assert all(one.startswith(DANGLING) and "(arc)" in one and "on B.Cu" in one for one in verdict.warnings)
    assert len(verdict.warnings) <= 2


def test_kicad_finds_no_fault_in_the_strip(strip: Verdict) -> None:
    rules_hold(strip)


def test_kicad_finds_no_fault_in_a_carrier(carrier: Verdict) -> None:
    rules_hold(carrier)
    assert carrier.warnings == []


def test_the_ground_plane_is_that_which_kicad_would_pour(carrier: Verdict) -> None:
    assert len(carrier.pours) == 2
    assert [ours for ours, _ in carrier.pours] == pytest.approx([theirs for _, theirs in carrier.pours], rel=1e-3)


def test_the_archive_of_a_carrier_is_what_kicad_plots(carrier: Verdict) -> None:
    layers = {layer: path for layer, path in carrier.plots.items() if not layer.endswith("PTH")}
    assert len(layers) == 7
    for layer, path in layers.items():
        (kept,) = path.parent.parent.glob(f"gellight-carrier-*-{layer}.gbr")
        assert shapes(kept) == shapes(path), layer
    for layer in ("PTH", "NPTH"):
        (kept,) = carrier.plots[layer].parent.parent.glob(f"gellight-carrier-*-{layer}.drl")
        holes = [re.findall(r"^[XT].*", one.read_text(), re.M) for one in (kept, carrier.plots[layer])]
        assert holes[0] == holes[1] != []


TIGHT = ring_of(12, ring_radius_mm=14.4, incident_angle_rad=0.0)
STEEP = ring_of(19, ring_radius_mm=17.5, incident_angle_rad=radians(67))
WIDE = ring_of(16, ring_radius_mm=32.1, incident_angle_rad=radians(58), gel_diameter_mm=70.0)


@pytest.mark.parametrize(
    ("geometry", "package"),
    [
        pytest.param(ring_of(3), "2020", id="3"),
        pytest.param(ring_of(24), "2020", id="24"),
        pytest.param(ring_of(13), "5050", id="13-5050"),
        pytest.param(TIGHT, "2020", id="tight"),
        pytest.param(STEEP, "2020", id="steep"),
        pytest.param(WIDE, "5050", id="wide"),
    ],
)
def test_kicad_finds_no_fault_in_strips_at_the_limits(geometry: SensorGeometry, package: str, tmp_path: Path) -> None:
    write_project(tmp_path, strip_board(geometry, package))
    rules_hold(judge(tmp_path, "gellight-strip"))


def test_kicad_has_the_leds_where_the_table_has_them(strip: Verdict) -> None:
    geometry = SensorGeometry()
    flat = np.array([part[1:3] for part in strip.parts if part[0].startswith("D")])
    assert np.linalg.norm(rolled_up(flat, geometry) - table(geometry)[0], axis=1).max() < 0.05
    assert {value for name, *_, value in strip.parts if name.startswith("D")} == {"WS2812B"}


def test_kicad_reads_the_netlist(strip: Verdict) -> None:
    read: dict[str, set[tuple[str, str]]] = {}
    for part, pad, _, _, net in strip.pads:
        if net:
            read.setdefault(net, set()).add((part, pad))
    assert read == strip_board(SensorGeometry()).nets()


@pytest.mark.parametrize("layer", ["F_Cu", "B_Cu"])
def test_the_gerbers_are_what_kicad_plots(made: Path, strip: Verdict, layer: str) -> None:
    assert shapes(made / f"gellight-strip-{layer}.gbr") == shapes(strip.plots[layer])
