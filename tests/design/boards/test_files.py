"""The files of the boards, read by another library than wrote them."""

import csv
import io
from collections import Counter
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from gellight_design.boards.files import bill_of_materials, carrier_files, placement, shopping_list
from gellight_design.boards.gerbers import gerber_archive
from gellight_design.boards.strip import strip_board
from sim_reference.geometry import SensorGeometry
from tests.helpers.boards import objects, ring_of, rolled_up, spot, table
from tests.helpers.places import CHECKOUT

JUDGED = Path(__file__).with_name("judged.txt")


@pytest.mark.nightly
def test_the_gerbers_have_the_leds_where_the_table_has_them(made: Path) -> None:
    from gerbonara.graphic_objects import Flash

    geometry = SensorGeometry()
    flashes = [one for one in objects(made / "gellight-strip-F_Paste.gbr") if isinstance(one, Flash)]
    wide = np.array([[one.x, one.y] for one in flashes[: 4 * len(table(geometry)[0])]])
    flat = wide.reshape(12, 4, 2).mean(axis=1)
    assert np.linalg.norm(rolled_up(flat, geometry) - table(geometry)[0], axis=1).max() < 0.05


@pytest.mark.nightly
def test_the_holes_are_those_of_vias(made: Path) -> None:
    from gerbonara.excellon import ExcellonFile

    board = strip_board(SensorGeometry())
    drilled = ExcellonFile.open(made / f"{board.name}-PTH.drl")
    read = Counter((spot(hole.x, hole.y), round(hole.tool.diameter, 3)) for hole in drilled.drills())
    assert read == Counter((spot(*via.at), round(via.drill_mm, 3)) for via in board.vias)


@pytest.mark.nightly
def test_the_outline_is_closed(made: Path) -> None:
    for name in ("gellight-strip", "gellight-carrier-pico"):
        ends = Counter(
            end for one in objects(made / f"{name}-Edge_Cuts.gbr")
            for end in (spot(one.x1, one.y1), spot(one.x2, one.y2))
        )  # fmt: skip
        assert set(ends.values()) == {2}


def test_bill_and_placement_agree() -> None:
    board = strip_board(SensorGeometry())
    bill = list(csv.DictReader(io.StringIO(bill_of_materials(board))))
    placed = list(csv.DictReader(io.StringIO(placement(board))))
    assert all(row["Manufacturer"] and row["Manufacturer Part Number"] for row in bill)
    assert all(len(row["Designator"].split(",")) == int(row["Quantity"]) for row in bill)
    assert {one for row in bill for one in row["Designator"].split(",")} == {row["Designator"] for row in placed}
    at = {part.reference: part for part in board.parts}
    assert all(float(row["Mid X"]) == pytest.approx(at[row["Designator"]].at[0], abs=1e-4) for row in placed)
    assert {row["Comment"] for row in bill} >= {row["Val"] for row in placed}


def test_the_picture_of_the_documents_is_current(made: Path) -> None:
    """The carrier of the Pico, with the strip of the default sensor."""
    assert (CHECKOUT / "docs/pictures/wiring.svg").read_text() == (made / "wiring.svg").read_text()


def test_the_shopping_list_has_all_parts_of_both_boards_for_one_and_for_ten() -> None:
    strip, carrier = strip_board(SensorGeometry()), carrier_files("pico")["gellight-carrier-pico-bom.csv"].decode()
    rows = {row["Order number"]: row for row in csv.DictReader(io.StringIO(shopping_list(strip, carrier)))}
    assert all(part.item.number in rows for part in strip.parts if part.item.number)
    assert all(row["Manufacturer Part Number"] in rows for row in csv.DictReader(io.StringIO(carrier)))
    capacitors = rows["CL10B104KB8NNNC"]
    assert (capacitors["For one"], capacitors["For ten"]) == ("14", "140"), "one a LED and two on the carrier"
    assert (rows["Ease Release 200"]["For one"], rows["Ease Release 200"]["For ten"]) == ("1", "1")
    assert rows["XP-565"]["For ten"] == "150"


def test_the_files_are_those_that_other_programs_have_judged(made: Path) -> None:
    """KiCad and gerbonara judge at night. After a wanted change let them judge, and write judged.txt anew."""
    judged = dict(line.split() for line in JUDGED.read_text().splitlines())
    found = {path.name: sha256(path.read_bytes()).hexdigest()[:16] for path in made.iterdir() if path.name in judged}
    assert found == judged


def test_the_same_board_gives_the_same_bytes() -> None:
    assert gerber_archive(strip_board(ring_of(3))) == gerber_archive(strip_board(ring_of(3)))
