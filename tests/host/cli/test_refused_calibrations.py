"""Whatever `gellight calibrate` refuses, and whatever the page's wizard refuses, the disk stays as it was."""

import hashlib
import itertools
import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from gellight.base.errors import GellightError
from gellight.base.settings import load_settings
from gellight.bundle.store import BundleStore
from gellight.daemon.assembly import open_session
from gellight.daemon.calibration_service import CalibrationRequest, CalibrationService
from tests.helpers.begun_calibration import begun_in
from tests.helpers.command_line import invoke
from tests.helpers.linear_sensor import linear_bundle

BALL = "--ball-radius-mm 4 --pixel-size-mm 0.1"
LEARNT = f"--presses presses.csv --reference untouched.png {BALL}"
"""what `fit` could learn from, were the next word not wrong"""
BAD = {
    "fit": [
        f"--presses none.csv --reference untouched.png {BALL}",
        f"--presses wrong.csv --reference untouched.png {BALL}",
        f"--presses presses.csv --reference none.png {BALL}",
        f"--presses presses.csv --reference small.png {BALL}",
        "--presses presses.csv --reference untouched.png --ball-radius-mm 0 --pixel-size-mm 0.1",
        "--presses presses.csv --reference untouched.png --ball-radius-mm nan --pixel-size-mm 0.1",
        "--presses presses.csv --reference untouched.png --ball-radius-mm 0.5 --pixel-size-mm 0.1",
        *(f"{LEARNT} {wrong}" for wrong in (
            "--recipe none", "--width 0", "--epochs 0",
            "--largest-normal-error-deg -1", "--like none", "--like old", "--lights none",
            "--lights old", "--view none.json", "--view presses.csv",
        )),
    ],
    "adapt": [
        "--calibration none --reference untouched.png", "--calibration old --reference none.png",
        "--calibration old --reference small.png", "--calibration old --reference untouched.png",
        "--sensor none.png",
    ],
    "lens": [
        "none.png --pitch-mm 1 --calibration old", "untouched.png --pitch-mm 1 --calibration old",
        "untouched.png --pitch-mm 0 --calibration old", "untouched.png --pitch-mm 1 --calibration none",
        "untouched.png --pitch-mm 1 --calibration old --overlay seen/grid.png",
    ],
    "lights": ["--sensor none.png", "--sensor untouched.png --calibration old", "--sensor sim:// --calibration none"],
    "force": [
        "none.csv --calibration old", "wrong.csv --calibration old", "presses.csv --calibration none",
    ],
    "detect": [
        f"none.png --reference untouched.png {BALL}", f"press-0.png --reference none.png {BALL}",
        f"press-0.png --reference untouched.png {BALL} --overlay seen", "press-0.png --reference untouched.png",
        f"press-0.png press-0.png {BALL}",
        f"press-0.png {BALL}", f"press-0.png {BALL} --pitch-mm -1", f"small.png --reference untouched.png {BALL}",
    ],
    "view": [
        "press-0.png", "press-0.png --crop 0,0,999,10", "none.png --crop 0,0,10,10", "press-0.png --crop 0,0,10",
        "press-0.png wrong.csv --crop 0,0,10,10", "press-0.png small.png --crop 0,0,100,60",
        "press-0.png --corners 0,0,1,1 --size 10x10", "press-0.png --grid untouched.png --spacing-px 9",
    ],
}  # fmt: skip
"""by verb: what it refuses"""
GUIDED = [
    "--sensor none.png", "--presses 3", "--presses 0", "--like none", "--like old", "--view none.json",
    "--view presses.csv", "--dots", "--preset none", "--ball-radius-mm 0", "--ball-radius-mm nan",
    "--cylinder-diameter-mm 500", "--pixel-size-mm 0", "--until-um -1",
    "--verifications 0", "--largest-depth-error-um -1",
    "--largest-normal-error-deg nan", "--recipe none", "--seed -1 --presses 3",
]  # fmt: skip
"""of `gellight calibrate --auto`"""
BY_DAY = ("--sensor none.png", "--presses 3", "--like old", "--dots", "--view presses.csv")


@pytest.fixture(scope="module")
def things(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with pictures, csv files, a bundle, and a calibration that was interrupted."""
    place = tmp_path_factory.mktemp("things")
    random = np.random.default_rng(0)
    for name, shape in {"untouched": (96, 128), "press-0": (96, 128), "press-1": (96, 128), "small": (48, 64)}.items():
        cv2.imwrite(str(place / f"{name}.png"), random.integers(90, 110, (*shape, 3), np.uint8))
    head = "image,center_x_px,center_y_px,contact_radius_px\n"
    (place / "presses.csv").write_text(f"{head}press-0.png,60,40,15\npress-1.png,50,50,15\n")
    (place / "wrong.csv").write_text(f"{head}press-0.png,60,40,x\n")
    linear_bundle(place / "old", (96, 128))
    begun_in(place / "old.state")
    (place / "old.state/presses").mkdir(exist_ok=True)
    (place / "foreign.state").mkdir()
    (place / "foreign.state/notes.txt").write_text("somebody else's")
    return place


@pytest.fixture
def place(things: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of these things, and go there."""
    shutil.copytree(things, tmp_path / "things")
    monkeypatch.chdir(tmp_path / "things")
    return tmp_path / "things"


def contents(folder: Path) -> Mapping[str, str]:
    """Return what is on the disk: each folder, and each file by its hash."""
    return {
        str(path.relative_to(folder)): "" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
    }


def outs(verb: str) -> Iterator[str]:
    """Yield where a verb may be asked to write: to new places, and onto what is there."""
    yield from ("--out new", "--out deep/er/new", "--out old --overwrite", "--out old", "--out presses.csv")
    if verb in ("detect", "view"):
        yield "--out presses.csv --overwrite"


@pytest.mark.parametrize("verb", BAD)
def test_a_refused_verb_leaves_the_disk_as_it_was(verb: str, place: Path) -> None:
    before = contents(place)
    for wrong, out in itertools.product(BAD[verb], outs(verb)):
        done = invoke("calibrate", verb, *wrong.split(), *out.split())
        assert done.exit_code != 0, f"{wrong} {out} is taken"
        assert contents(place) == before, f"{wrong} {out}: {done.output}{done.exception}"


@pytest.mark.parametrize(
    "wrong", [wrong if wrong in BY_DAY else pytest.param(wrong, marks=pytest.mark.nightly) for wrong in GUIDED]
)
def test_a_refused_guided_calibration_leaves_the_disk_as_it_was(wrong: str, place: Path) -> None:
    before = contents(place)
    sensor = "" if "--sensor" in wrong else "--sensor sim://?programme=0"
    for out in ("--out new", "--out old --restart", "--out old --resume", "--out old", "--out foreign --restart"):
        done = invoke("calibrate", "--auto", *sensor.split(), *wrong.split(), *out.split(), "--no-install")
        assert done.exit_code != 0, f"{wrong} {out} is taken"
        assert contents(place) == before, f"{wrong} {out}: {done.output}{done.exception}"


WISHES = [
    {"presses": 3}, {"presses": 0}, {"like": "0" * 16}, {"like": "x"}, {"dots": True},
    {"view": {"taken_width_px": 9, "taken_height_px": 9, "width_px": 4, "height_px": 4}},
    {"ball_radius_mm": 0}, {"ball_radius_mm": 400}, {"cylinder_diameter_mm": -1}, {"pin_pitch_mm": 2},
    {"more": 1}, {"view": {"name": "view.json", "content": "none"}},
]  # fmt: skip


def test_a_refused_wish_of_the_wizard_leaves_the_disk_as_it_was(place: Path) -> None:
    with (
        open_session(load_settings({"sensor.url": "sim://?programme=0"})) as sensor,
        CalibrationService(sensor, store=BundleStore(place / "store"), folder=place / "old.state") as service,
    ):
        sensor.wait_frame(-1, 30)
        before = contents(place)
        for wish, anew, hand in itertools.product(WISHES, (True, False), (True, False)):
            with pytest.raises((GellightError, ValidationError)):
                service.begin(CalibrationRequest.model_validate_json(json.dumps({**wish, "anew": anew, "hand": hand})))
            assert contents(place) == before, wish
            assert not service.calibrating
        for refused in (lambda: service.act("next"), lambda: service.restore("0" * 16), lambda: service.report("x")):
            with pytest.raises(GellightError):
                refused()
            assert contents(place) == before
