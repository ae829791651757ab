"""What docs/simulators.md says is typed."""

import re
import sys
from pathlib import Path

import cv2
import pytest

from tests.helpers.children import run
from tests.helpers.doc_examples import examples
from tests.helpers.places import CHECKOUT
from tests.helpers.pressed_unit import pressed_unit

pytestmark = pytest.mark.nightly
EXAMPLES = CHECKOUT / "docs/examples/simulators"
DOCUMENT = "docs/simulators.md"
PAGE = (CHECKOUT / DOCUMENT).read_text()


def test_the_program_of_the_page_draws_a_picture_of_touch() -> None:
    block, _, environment = examples(DOCUMENT)
    assert run([sys.executable, "-c", environment], check=True).stdout.startswith("(32, 32) ")
    assert block.strip() in (EXAMPLES / "look.py").read_text()
    assert run([sys.executable, "-c", block], check=True).stdout == "0.49 N, 0.59 mm deep, picture (480, 640, 3)\n"


def test_a_calibrated_unit_draws_what_the_page_presses(tmp_path: Path) -> None:
    pressed_unit(tmp_path / "my-sensor")
    (block,) = (one for one in examples(DOCUMENT) if "my-sensor" in one)
    shown = "print(picture.shape, abs(picture - sensor.grey(sensor.feel(ball + 1))).max() > 20)"
    assert run([sys.executable, "-c", block + shown], check=True, cwd=tmp_path).stdout == "(60, 80, 3) True\n"


def test_the_gripper_lifts_and_is_filmed(tmp_path: Path) -> None:
    (command,) = re.findall(r"```sh\npython (\S+) (\S+)\n```", PAGE)
    said = run([sys.executable, CHECKOUT / command[0], tmp_path / command[1]], check=True, timeout_s=200).stdout
    assert said == "lifted by 49 mm; the gels carry 0.1962 N of 0.1962 N\n"
    read, film = cv2.imreadanimation(str(tmp_path / command[1]))
    assert read
    assert len(film.frames) > 15
    assert film.frames[0].shape[:2] == (240, 880)


def test_the_agent_learns_and_its_curve_is_drawn(tmp_path: Path) -> None:
    """Shortly: the page's figures take two minutes a seed."""
    (command,) = re.findall(r"```sh\n.*\npython (\S+learn.py) (\S+)\n```", PAGE)
    few = ["--seeds", "1", "--presses", "2048"]
    said = run([sys.executable, CHECKOUT / command[0], tmp_path / command[1], *few], check=True, timeout_s=280).stdout
    (touch, without) = re.findall(r"seed 0: 2048 presses, (\d+)% right", said)
    assert int(touch) > 12, "a guess is right in 9 %"
    assert int(without) < 20
    drawn = (tmp_path / command[1]).read_text()
    assert "with touch, seed 0" in drawn
    assert "without, seed 0" in drawn
