"""The simulated sensor: what is pressed is what is seen, and rubbish is refused."""

import itertools
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BoardError, CameraError, InputError
from gellight.frames.camera import ReconnectingError
from gellight.frames.frames import CameraFrame
from gellight.lab.simulator import simulated_camera
from gellight.lab.simulator.scene import Press
from gellight.lab.simulator.simulated_camera import SimulatedCamera, open_simulated
from gellight.lab.simulator.stage import PROGRAMME, Stage, programme_of_presses
from gellight.opening import open_camera
from sim_reference.geometry import SensorGeometry
from tests.helpers import children
from tests.helpers.terminal_board import cut_power
from tests.helpers.waiting import eventually


def open_quiet(parameters: str = "") -> SimulatedCamera:
    return open_camera(f"sim://?programme=0&fps=1000{parameters}")


def first_under(camera: SimulatedCamera, colours: np.ndarray) -> CameraFrame:
    """The first frame that was exposed wholly under a light (12, 3), however long the board takes to show it."""
    eventually(lambda: (camera.read().light == colours).all())
    return camera.read()


def test_the_untouched_gel_is_still_but_for_noise() -> None:
    with open_quiet("&noise=1.5") as camera:
        frames = [camera.read() for _ in range(6)]
    stack = np.array([frame.image for frame in frames], dtype=np.float32)
    assert [frame.sequence for frame in frames] == [1, 2, 3, 4, 5, 6]
    assert stack.std(axis=0, ddof=1).mean() == pytest.approx(np.sqrt(1.5**2 + 1 / 12), rel=0.06)
    assert all(later.time_s > earlier.time_s for earlier, later in itertools.pairwise(frames))
    assert not frames[0].truth.depth_mm.any()


def test_a_press_is_in_the_very_next_frame_and_gone_after_release() -> None:
    with open_quiet() as camera:
        camera.stage.press("BALL", 0.7, 4.0, -2.0)
        pressed = camera.read()
        camera.stage.release()
        released = camera.read()
    assert pressed.truth.depth_mm.max() == pytest.approx(0.7, abs=0.01)
    row, column = np.unravel_index(pressed.truth.depth_mm.argmax(), (480, 640))
    assert ((column - 319.5) * 0.0588, (row - 239.5) * 0.0588) == pytest.approx((4.0, -2.0), abs=0.06)
    assert np.abs(pressed.image.astype(int) - released.image).max() > 30
    assert not released.truth.contact.any()


def test_two_sensors_with_one_seed_are_one() -> None:
    with open_quiet("&seed=7") as one, open_quiet("&seed=7") as twin, open_quiet("&seed=8") as other:
        image = one.read().image
        assert (image == twin.read().image).all()
        assert (image != other.read().image).any()


def test_a_press_held_by_the_url_stays() -> None:
    with open_quiet("&object=SCROWN&depth=0.5&x=1&y=2") as camera:
        assert all(camera.read().truth.depth_mm.max() > 0.45 for _ in range(3))
        assert camera.stage.status() == {"object": "SCROWN", "depth_mm": 0.5, "x_mm": 1.0, "y_mm": 2.0, "visitor": True,
                                         "preparing": ""}  # fmt: skip


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ("&colour=red", r"unknown parameter colour: choose one of fps, seed, noise, object"),
        ("&crosstlk=0.2", r"unknown parameter crosstlk: did you mean crosstalk\?"),
        ("&crosstalk=loud", "crosstalk = loud is not allowed: give a number at least 0 and at most 0.5"),
        ("&depth=-1", "depth = -1 is not allowed: give a number at least 0"),
        ("&depth=nan", "depth = nan is not allowed"),
        ("&x=1e9", "off the gel"),
        ("&depth=9", "choose 0 to 2 mm"),
        ("&object=CUBE&depth=1", "no object 'CUBE': choose one of BALL"),
        ("&object=SINE-0.1-0.01&depth=1", "waves can be 0.5 to 12 mm long"),
        ("&fps=0", "fps"),
        *((f"&board=0&{dots}", "dots|friction")
          for dots in ("dots=9", "dots=0x7", "dots=9x7&dot_diameter=2.5", "dots=9x7&friction=0")),
        *((f"&{ring}", "ring_c") for ring in ("ring_c=31&board=0", "ring_c=200", "ring_c=warm")),
        ("&strobe=1&board=0", "a strobe needs the board"),
        ("&bundle=synthetic", "no real unit: leave it out"),
        ("&bundle=", "bundle = "),
    ],
)  # fmt: skip
def test_a_wrong_url_says_which_parameter(parameters: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        open_quiet(parameters)


@pytest.mark.parametrize(
    ("press", "words"),
    [
        (("CUBE", 1.0, 0.0, 0.0), "no object 'CUBE'"),
        (("BALL", 2.1, 0.0, 0.0), "press depth 2.1 mm: choose 0 to 2 mm"),
        (("BALL", float("nan"), 0.0, 0.0), "press depth nan"),
        (("BALL", 1.0, 30.0, 0.0), "off the gel"),
        (("BALL", 1.0, 0.0, float("inf")), "off the gel"),
    ],
)
def test_an_impossible_press_is_refused_and_changes_nothing(press: tuple[str, float, float, float], words: str) -> None:
    stage = Stage(SensorGeometry(), programme=False)
    stage.press("BALL", 0.5, 1.0, 1.0)
    with pytest.raises(InputError, match=words):
        stage.press(*press)
    assert stage.next_press() == Press("BALL", 0.5, 1.0, 1.0)


def test_an_object_is_turned_by_a_third_of_a_radian_at_most() -> None:
    stage = Stage(SensorGeometry(), programme=False)
    stage.press("BALL", 0.5, 1.0, 1.0)
    for turn_rad in (0.351, -0.351):
        with pytest.raises(InputError, match="a turn of"):
            stage.drag(0.0, 0.0, turn_rad)
    stage.drag(0.0, 0.0, -0.349)


def test_a_closed_camera_gives_no_frame() -> None:
    with open_quiet() as camera:
        pass
    with pytest.raises(CameraError, match="closed"):
        camera.read()


def test_the_programme_presses_everything_on_its_list_and_lets_go_in_between() -> None:
    presses = list(itertools.islice(programme_of_presses(), 2000))
    deepest = [p for p, n in itertools.groupby(presses) if len(list(n)) > 50]
    assert deepest[: len(PROGRAMME)] == list(PROGRAMME)
    assert None in presses


def test_a_visitor_stops_the_programme_and_it_returns_when_the_visitor_is_gone() -> None:
    stage = Stage(SensorGeometry())
    stage.press("TSTEP", 0.6, 0.0, 0.0)
    assert {stage.next_press() for _ in range(900)} == {Press("TSTEP", 0.6)}
    assert stage.status()["visitor"]
    stage.release()
    assert {stage.next_press() for _ in range(300)} == {None}
    assert not stage.status()["visitor"]
    assert stage.next_press() is not None


def test_no_programme_plays_after_a_press_that_is_held() -> None:
    stage = Stage(SensorGeometry())
    stage.hold("TSTEP", 0.6, 0.0, 0.0)
    assert {stage.next_press() for _ in range(600)} == {Press("TSTEP", 0.6)}
    stage.release()
    assert {stage.next_press() for _ in range(600)} == {None}


def test_the_picture_is_lit_by_what_the_pin_of_the_board_says() -> None:
    with open_quiet() as camera:
        steady = open_quiet("&board=0").read().image.astype(int)
        lit = camera.read()
        assert lit.light is not None
        assert np.abs(lit.image.astype(int) - steady).mean() < 2.0, "the ring as designed, pulsed, is the steady ring"
        ring = camera.ring
        blue = np.zeros((12, 3), np.uint8)
        blue[8:] = (0, 0, 255)
        ring.set_leds(blue)
        changed = first_under(camera, blue)
        assert changed.image[..., 2].mean() > 50
        assert changed.image[..., 0].mean() < 8, "what is left of red is crosstalk"
        ring.blank()
        dark = first_under(camera, 0 * blue)
    assert dark.image.mean() < 1.0


def test_a_change_of_light_in_mid_exposure_is_seen_row_by_row() -> None:
    with open_quiet("&noise=0") as camera:
        torn = 0
        for attempt in range(100):
            level = 100 if attempt % 2 else 20
            camera.ring.set_leds(np.full((12, 3), level, np.uint8))
            time.sleep(0.005 + 0.001 * (attempt % 25))
            rows = camera.read().image.mean(axis=(1, 2))
            torn += bool(rows[:10].mean() / rows[-10:].mean() > 2 or rows[-10:].mean() / rows[:10].mean() > 2)
            if torn == 2:
                break
    assert torn == 2, "the gel is as bright at the top as at the bottom: only a change in between can do that"


def test_a_board_that_is_gone_is_told_instead_of_a_dark_picture() -> None:
    with open_quiet() as camera:
        cut_power(camera.ring.transport)
        with pytest.raises(CameraError, match="board of the light ring is gone"):
            camera.read()


def test_closing_the_camera_darkens_and_ends_the_board() -> None:
    with open_quiet() as camera:
        ring = camera.ring
    with pytest.raises(BoardError):
        ring.set_leds(np.zeros((12, 3), np.uint8))


def test_it_adopts_the_controls_and_the_colours_of_a_calibration() -> None:
    with open_quiet("&noise=0") as camera:
        green = np.zeros((12, 3), np.uint8)
        green[4:8, 1] = 200
        camera.adopt({"exposure_us": 4000}, green)
        assert camera.controls.read("exposure_us") == 4000
        assert camera.ring.still.tolist() == green.tolist()
        with pytest.raises(CameraError, match="no control 'focus', which the calibration needs"):
            camera.adopt({"gain": 2.0, "focus": 1}, None)
        assert camera.controls.read("gain") == 1, "what is refused changes nothing"
        assert camera.ring.still.tolist() == green.tolist()
        camera.adopt({}, None)
        assert camera.ring.still is None


def test_a_press_that_was_computed_ahead_is_shown_at_once_and_says_meanwhile_what_it_is() -> None:
    with open_quiet("&board=0") as camera:
        said = []
        computed = camera.stage.prepare_ahead

        def watched(press: Press) -> None:
            said.append(camera.stage.status()["preparing"])
            assert camera.read().truth is not None, "frames go on"
            computed(press)

        camera.stage.prepare_ahead = watched
        camera.stage.prepare("WAVE", 0.3, 0.0, 0.0)
        assert said == ["WAVE"]
        assert camera.stage.status()["preparing"] == ""
        assert camera.stage.status()["object"] == "", "it is not pressed yet"
        assert camera._scene.is_ready(Press("WAVE", 0.3))
        camera.stage.press("WAVE", 0.3, 0.0, 0.0)
        ahead = camera.read().truth
    with open_quiet("&board=0") as camera:
        camera.stage.press("WAVE", 0.3, 0.0, 0.0)
        at_once = camera.read().truth
    assert np.array_equal(ahead.depth_mm, at_once.depth_mm)


def test_frames_go_on_while_a_press_of_the_programme_is_computed() -> None:
    with open_camera("sim://?board=0&fps=1000") as camera:
        may_go_on = threading.Event()
        compute = camera._scene.prepare_ahead
        camera._scene.prepare_ahead = lambda press: may_go_on.wait(60) and compute(press)  # type: ignore[method-assign,func-returns-value]
        frames = [camera.read() for _ in range(5)]
        assert all(frame.truth is not None and not frame.truth.contact.any() for frame in frames)
        assert camera.stage.status()["preparing"] == "", "nobody waits for it"
        may_go_on.set()
        deadline_s = time.monotonic() + 60  # a limit, not a promise: processors are shared
        while time.monotonic() < deadline_s and not camera.read().truth.contact.any():  # type: ignore[union-attr]
            pass
        assert time.monotonic() < deadline_s, "the press is shown when it is computed"


class Clock:
    """Time in which nothing takes any."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, for_s: float) -> None:
        self.now_s += for_s


def test_the_schedule_stays_where_frames_are_read_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some that came meanwhile wait, those before are left out, and the next ones come when they would have."""
    clock = Clock()
    monkeypatch.setattr(simulated_camera, "time", clock)
    with open_simulated("sim://?board=0&programme=0&fps=50") as camera:
        first_s = camera.read().time_s
        clock.sleep(0.25)
        begun_s = clock.now_s
        late_s = [camera.read().time_s for _ in range(3)]
        assert begun_s - late_s[0] > 3 * 0.02
        assert clock.now_s == begun_s, "none is waited for"
        steps = np.diff([first_s, *late_s, camera.read().time_s]) / 0.02
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    assert steps[1:].tolist() == pytest.approx([1] * 3, abs=1e-6)


def test_a_board_that_stays_dark_for_long_ends_no_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that was too busy for its board is quiet again some time."""
    monkeypatch.setattr(simulated_camera, "DARK_S", 0.2)
    with open_quiet() as camera:
        monkeypatch.setattr(camera.ring, "lit_since_s", lambda: np.inf)
        with pytest.raises(ReconnectingError, match="keeps its LEDs dark"):
            camera.read()
        monkeypatch.undo()
        assert camera.read().image.mean() > 10


def test_a_pinhole_sees_a_press_farther_out_and_a_window_changes_the_light() -> None:
    small = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 0.2352}
    url = "sim://?object=BALL&depth=1.2&x=12&y=-6&board=0&noise=0"
    frames = []
    for seen in ("&camera=parallel&window=none", "&camera=pinhole&window=acrylic", "&window=none", ""):
        with open_simulated(url + seen, small) as camera:
            frames.append(camera.read())
            heights_mm = camera.stage.camera_height_mm, camera.stage.window_mm
    assert np.array_equal(frames[1].image, frames[3].image)
    for frame, height_mm in ((frames[0], np.inf), (frames[2], 40.0), (frames[3], 53.12)):
        depth = frame.truth.depth_mm
        row, column = np.unravel_index(depth.argmax(), depth.shape)
        nearer = 1 / (1 - depth.max() / height_mm)
        assert ((column - 79.5) * 0.2352, (row - 59.5) * 0.2352) == pytest.approx((12 * nearer, -6 * nearer), abs=0.15)
    assert heights_mm == pytest.approx((53.12, 8.0))
    # Bent light comes more steeply: the same slopes change it less.
    contrast = [np.ptp(frame.image[30:60, 110:145].astype(float), axis=(0, 1)).mean() for frame in frames]
    assert contrast[3] < 0.85 * contrast[2]


ENDS = """
import time, numpy as np, scipy.fft
from gellight.lab.simulator.scene import Scene
from gellight.opening import open_camera

def slow(scene, press):
    until_s = time.monotonic() + 3
    while time.monotonic() < until_s:
        scipy.fft.fft2(np.ones((256, 256)))

Scene.prepare_ahead = slow
camera = open_camera("sim://?board=0")
while camera._ahead is None:
    camera.read()
camera.close()
"""


def test_a_program_ends_well_while_a_press_is_computed_ahead(tmp_path: Path) -> None:
    """A thread that wants Python back from a library after Python's end would abort the process."""
    done = children.run([sys.executable, "-c", ENDS], cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
