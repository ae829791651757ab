"""The state of a calibration on disk: what survives, what is refused, and what is never touched."""

import errno
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args
from unittest.mock import Mock

import numpy as np
import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from gellight.base.errors import BundleError, GellightError, InputError
from gellight.lab.calibration.folder import Folder
from gellight.lab.calibration.records import CheckErrors, Circle, PixelSize
from gellight.lab.calibration.state import State, discard, state_in, unfinished
from gellight.lab.report.pictures import write_png
from tests.helpers.begun_calibration import begun_in, identity

CIRCLE = Circle(center_x_px=100.0, center_y_px=80.0, contact_radius_px=20.0)
PICTURE = np.zeros((24, 32, 3), np.uint8)
SIZE = PixelSize(x_mm=0.1, y_mm=0.1, pixel_size_mm=0.1)


def test_the_state_of_a_calibration_survives_a_loss_of_power(tmp_path: Path) -> None:
    folder = begun_in(tmp_path / "state")
    reference = np.full((24, 32, 3), 120.5, np.float32)
    folder.finish(SIZE)
    folder.keep_reference(reference)
    folder.add_press(PICTURE, CIRCLE)
    folder.add_press(PICTURE, CIRCLE)
    folder.drop_press(1)
    assert unfinished(tmp_path / "state") == identity()
    again = begun_in(tmp_path / "state")
    assert again.state == folder.state
    assert again.figures(PixelSize) == SIZE
    assert [record.number for record in again.state.presses] == [2]
    assert again.presses()[0].image.is_file()
    assert np.array_equal(again.reference(), reference)


def test_a_calibration_begins_again_in_its_folder_after_a_bad_verdict(tmp_path: Path) -> None:
    folder = begun_in(tmp_path / "state")
    folder.add_press(PICTURE, CIRCLE)
    folder.add_check(PICTURE, CIRCLE, CheckErrors(depth_mm=0.2, normal_deg=9.0, indentation_mm=1.0))
    folder.want_more(12)
    left = [path.relative_to(tmp_path / "state").as_posix() for path in tmp_path.rglob("*.png")]
    assert left == ["presses/press-001.png"]
    discard(tmp_path / "state")
    assert begun_in(tmp_path / "state").state.presses == []


def test_a_circle_that_a_hand_corrected_is_drawn_not_found(tmp_path: Path) -> None:
    folder = begun_in(tmp_path)
    for _ in range(2):
        folder.add_press(PICTURE, CIRCLE)
    folder.correct_press(1, CIRCLE.model_copy(update={"contact_radius_px": 23.0}))
    assert [(press.found, press.contact_radius_px) for press in begun_in(tmp_path).presses()] == [
        (False, 23.0), (True, 20.0),
    ]  # fmt: skip


def fields_in(model: type[BaseModel], known: set[type]) -> Iterator[tuple[str, FieldInfo]]:
    """Every field of a model and of the models in it."""
    known.add(model)
    for name, info in model.model_fields.items():
        yield f"{model.__name__}.{name}", info
        parts = [info.annotation]
        while parts:
            part = parts.pop()
            parts += get_args(part)
            if isinstance(part, type) and issubclass(part, BaseModel) and part not in known:
                yield from fields_in(part, known)


def test_what_may_be_none_may_be_missing_for_none_is_not_written() -> None:
    found = dict(fields_in(State, set()))
    assert "BallPresses.held_out_um" in found
    assert [
        name for name, info in found.items() if type(None) in get_args(info.annotation) and info.is_required()
    ] == []


def test_a_press_whose_picture_was_not_written_is_dropped(tmp_path: Path) -> None:
    folder = begun_in(tmp_path)
    for _ in range(2):
        folder.add_press(PICTURE, CIRCLE)
    (tmp_path / "presses/press-002.png").unlink()
    assert [record.number for record in begun_in(tmp_path).state.presses] == [1]


def test_the_state_of_another_sensor_is_refused_and_left_alone(tmp_path: Path) -> None:
    begun_in(tmp_path).finish(SIZE)
    before = (tmp_path / "state.json").read_bytes()
    with pytest.raises(InputError, match="begun with sensor A17, not b"):
        begun_in(tmp_path, identity("b"))
    assert (tmp_path / "state.json").read_bytes() == before


@pytest.mark.parametrize(
    ("spoil", "error", "words"),
    [
        (lambda state: {**state, "steps": {"fit": 7}}, BundleError, r"state\.json is damaged \(steps\.fit"),
        (lambda state: {**state, "presses": [{"number": 1, "file": "../a.png"}]}, BundleError, r"damaged \(presses\.0"),
        (lambda state: {**state, "schema_version": 9}, BundleError, "schema version 9, this program reads 1"),
        (lambda state: [1, 2], InputError, "is not the state of a calibration: give a new folder"),
        (lambda state: {"finished": False}, InputError, "is not the state of a calibration: give a new folder"),
    ],
)
def test_a_damaged_or_foreign_state_is_named_and_left_alone(
    tmp_path: Path, spoil: Callable[[Any], Any], error: type[GellightError], words: str
) -> None:
    begun_in(tmp_path).finish(SIZE)
    place = tmp_path / "state.json"
    place.write_text(json.dumps(spoil(json.loads(place.read_text()))))
    before = place.read_bytes()
    for use in (lambda: begun_in(tmp_path), lambda: unfinished(tmp_path), lambda: discard(tmp_path)):
        with pytest.raises(error, match=words):
            use()
    assert (tmp_path / "state.json").read_bytes() == before


def test_a_folder_with_pictures_of_somebody_else_is_refused_and_nothing_is_changed(tmp_path: Path) -> None:
    mine = tmp_path / "presses/press-001.png"
    mine.parent.mkdir()
    mine.write_bytes(b"a picture of my own")
    with pytest.raises(InputError, match="holds 'presses' and no calibration: give a new or an empty folder"):
        begun_in(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["presses"]
    assert mine.read_bytes() == b"a picture of my own"


def test_pictures_that_a_calibration_did_not_take_are_neither_removed_nor_overwritten(tmp_path: Path) -> None:
    folder = begun_in(tmp_path)
    folder.add_press(PICTURE, CIRCLE)
    mine = [tmp_path / kind / "press-002.png" for kind in ("presses", "checks")]
    for picture in mine:  # under names that it would use
        picture.write_bytes(b"a picture of my own")
    again = begun_in(tmp_path)
    assert again.add_press(PICTURE, CIRCLE).file == "presses/press-003.png"
    discard(tmp_path)
    assert [picture.read_bytes() for picture in mine] == [b"a picture of my own"] * 2
    assert sorted(path.name for path in (tmp_path / "presses").iterdir()) == ["press-002.png"]
    assert not (tmp_path / "state.json").exists()


def test_discarding_a_calibration_leaves_nothing_of_it(tmp_path: Path) -> None:
    folder = begun_in(tmp_path / "state")
    folder.add_press(PICTURE, CIRCLE)
    folder.keep_reference(np.zeros((24, 32, 3), np.float32))
    discard(tmp_path / "state")
    assert list(tmp_path.iterdir()) == []
    discard(tmp_path / "state")


def test_a_finished_calibration_is_not_taken_up_again(tmp_path: Path) -> None:
    folder = begun_in(tmp_path)
    folder.finish(SIZE)
    old = tmp_path / folder.add_press(PICTURE, CIRCLE).file
    folder.close()
    assert unfinished(tmp_path) is None
    again = begun_in(tmp_path, identity("b"))
    assert again.done("pixel_size") is None
    assert not old.exists()


def test_a_full_disk_is_told_and_what_was_measured_before_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse = Mock(side_effect=OSError(errno.ENOSPC, "No space left on device"))

    folder = begun_in(tmp_path)
    folder.finish(SIZE)
    monkeypatch.setattr("gellight.lab.calibration.folder.write_png", refuse)
    with pytest.raises(BundleError, match=r"No space left on device.: free some space and go on"):
        folder.add_press(PICTURE, CIRCLE)
    monkeypatch.setattr("gellight.lab.calibration.folder.write_file", refuse)
    for keep in (
        lambda: folder.finish(SIZE.model_copy(update={"x_mm": 0.2})),
        lambda: folder.keep_reference(np.zeros((4, 4, 3), np.float32)),
        lambda: folder.add_press(PICTURE, CIRCLE),
    ):
        with pytest.raises(BundleError, match=r"No space left on device.: free some space and go on"):
            keep()
    monkeypatch.undo()
    again = begun_in(tmp_path)
    assert (again.figures(PixelSize), again.state.presses) == (SIZE, [])
    assert not (tmp_path / "reference.npy").exists()


def test_what_an_older_version_began_is_read(tmp_path: Path) -> None:
    begun = {"sensor": "A17", "image_size_px": [320, 240], "ball_radius_mm": 60.0, "cylinder_diameter_mm": 6.0}
    errors = {"depth_mm": 0.01, "normal_deg": 0.5, "indentation_mm": 1.0, "picture_grey": 2.0}
    circle = {"center_x_px": 9, "center_y_px": 8, "contact_radius_px": 7}
    light = {"mean_grey": 159.0, "sigma_grey": 6.7, "within_1_sigma": 0.64, "within_2_sigma": 0.96,
             "within_3_sigma": 0.99, "darkest_grey": 140.0, "brightest_grey": 180.0}  # fmt: skip
    steps = {
        "without_prism": True,
        "lens": {"pictures": 1, "pitch_mm": 2.0},
        "prepare": {"camera": {}, "uniformity": dict.fromkeys(("average", "red", "green", "blue"), light),
                    "lights": {"leds": [], "groups": [{"group": 0, "leds": [0], "error": 0.01}], "dark_grey": 0.2},
                    "advice": ""},
        "verify": {"presses": 1, **errors, "second_opinions": {}},
    }  # fmt: skip
    checks = [{"number": 1, "file": "checks/press-001.png", **circle, "figures": errors}]
    state = {"schema_version": 1, "prisms": [], "steps": steps}
    state["identity"] = {**begun, "prism_angle_deg": 45, "pin_pitch_mm": 2.0}
    grids = [{"number": 1, "file": "grids/press-001.png"}]
    (tmp_path / "state.json").write_text(json.dumps({**state, "checks": checks, "grids": grids}))
    read = state_in(tmp_path)
    assert read.steps.prepare.uniformity["red"].brightest_grey == 180
    assert (read.steps.verify.normal_deg, read.checks[0].figures.indentation_mm) == (0.5, 1.0)
    identity = unfinished(tmp_path)
    assert identity.sizes() == {"ball_radius_mm": 60.0, "cylinder_diameter_mm": 6.0, "pixel_size_mm": None}
    for picture in (*checks, *grids):
        (tmp_path / picture["file"]).parent.mkdir()
        write_png(tmp_path / picture["file"], PICTURE)
    assert Folder.open(tmp_path, identity).state.checks == read.checks
    discard(tmp_path)
    assert not tmp_path.exists()
