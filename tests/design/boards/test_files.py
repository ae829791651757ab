"""The files of the boards, read by another library than wrote them."""

import csv
import io
from hashlib import sha256
from pathlib import Path

import pytest

from gellight_design.boards.files import bill_of_materials, carrier_files, placement, shopping_list
from gellight_design.boards.strip import strip_board
from sim_reference.geometry import SensorGeometry
from tests.helpers.places import CHECKOUT

JUDGED = Path(__file__).with_name("judged.txt")


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
