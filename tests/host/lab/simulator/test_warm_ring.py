"""A simulated ring with a thermometer: what the sensor says of its heat, and what a hot one does."""

import pytest

from gellight.base.errors import BoardError, InputError
from gellight.cli.status import heat as heat_text
from gellight.opening import open_camera
from gellight.ring.heat import HeardHeat
from gellight.ring.protocol import DimmedEvent
from tests.helpers.waiting import eventually

SMALL = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 0.2352}


def test_a_warm_ring_is_told_in_the_status_of_the_sensor() -> None:
    with open_camera("sim://?programme=0&ring_c=31.5", geometry=SMALL) as camera:
        assert camera.ring is not None
        eventually(camera.ring.heat.known)
        heat = camera.ring.heat.known()
        assert heat is not None
        assert heat["ring_c"] == pytest.approx(31.5, abs=0.3)
        told = heat_text(heat)
        assert "ring at 31.5 °C" in told or "ring at 31.4 °C" in told
    assert heat_text({"chip_c": None, "ring_c": 61.0, "dimmed": 2, "mean_ma": 0}) == (
        "; ring at 61.0 °C; dimmed to 1/4 because it is hot"
    )


def test_no_frame_of_a_hot_ring_passes_for_one_of_its_light_and_it_is_said_what_helps() -> None:
    with pytest.raises(BoardError, match=r"the ring 70 °C \(its limit is 60\), so it dims its LEDs to 1/2") as refused:
        read_on("sim://?programme=0&ring_c=70")
    assert "--hottest" not in str(refused.value)  # that is the limit of the chip


def read_on(url: str) -> None:
    with open_camera(url, geometry=SMALL) as camera:
        while True:  # the first frames may come before the board has looked at its thermometer
            camera.read()


def test_what_was_said_of_heat_long_ago_counts_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    heat, now_s = HeardHeat(), 100.0
    monkeypatch.setattr("gellight.ring.heat.time.monotonic", lambda: now_s)
    assert (heat.known(), heat.due()) == (None, True)
    heat.note(DimmedEvent(0, 412, 0, 0, 120, 310))
    assert heat.known() == {"chip_c": 41.2, "ring_c": 31.0, "dimmed": 0, "mean_ma": 120}
    now_s += 6.0
    assert (heat.known() is None, heat.due()) == (False, True)
    now_s += 5.0
    assert heat.known() is None


@pytest.mark.parametrize("url", ["sim://?ring_c=31&board=0", "sim://?ring_c=200", "sim://?ring_c=warm"])
def test_a_ring_that_cannot_be_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="ring_c"):
        open_camera(url, geometry=SMALL)
