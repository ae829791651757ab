"""The first steps with a real board, in their order: docs/bring-up.md. `-k step_3` runs the third."""

import dataclasses
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.opening import open_camera
from gellight.ring import protocol as p
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import Dark, ResetReason, SyncMode
from gellight.ring.heat import chip_temperature_c
from gellight.ring.light_ring import LightRing, Step, connect
from gellight.ring.transport import open_transport

pytestmark = pytest.mark.hardware


def talk(ring: LightRing, seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        ring.clock()
        time.sleep(0.02)


def stream(ring: LightRing, seconds: float) -> None:
    """Let a sequence run with events and commands, and demand that nothing was lost or late."""
    before = ring.counters()
    retries, damaged = ring.retries, ring.damaged
    talk(ring, seconds)
    after = ring.counters()
    assert (ring.retries, ring.damaged) == (retries, damaged)
    for name in ("bad_crc", "bad_framing", "oversize", "replies_dropped", "late_steps", "dark_faults"):
        assert getattr(after, name) == getattr(before, name), name


# ---- 1: the board alone, just plugged in. It starts, says who it is, and finds itself in order. ----

STARTS = 5


def test_step_1_it_was_started_by_nothing_unusual(ring: LightRing) -> None:
    assert ring.hello.reset_reason in (ResetReason.POWER, ResetReason.COMMAND)
    assert ring.counters().dark_faults == 0


def test_step_1_it_passes_its_self_test(ring: LightRing) -> None:
    ring.blank()
    time.sleep(0.05)
    result = ring.self_test()
    assert result.failed == 0
    assert result.image_crc == ring.hello.image_crc
    assert result.stack_free > 1024


def test_step_1_the_chip_is_neither_frozen_nor_hot(ring: LightRing) -> None:
    celsius = chip_temperature_c(ring.status())
    assert celsius is not None
    assert -10 < celsius < 85


def test_step_1_it_starts_every_time(ring: LightRing, reopened: Callable[[], LightRing]) -> None:
    ring.reset()
    ring.close()
    for number in range(STARTS):
        time.sleep(2)
        with reopened() as again:
            assert again.hello.reset_reason == ResetReason.COMMAND
            assert again.status().time_us < 20e6
            if number < STARTS - 1:
                again.reset()


# ---- 2: with LEDs. What is asked for is lit, when the board says so. ----

COLOURS = {"red": 0, "green": 1, "blue": 2}


def test_step_2_a_light_is_latched_when_its_event_says_so(ring: LightRing, dim: np.ndarray) -> None:
    event = ring.wait_for_light(ring.set_leds(dim).light_id)
    assert event.latched_us - event.first_bit_us >= 30 * ring.led_count + 50
    assert ring.status().dark == Dark.NOT_DARK


def test_step_2_steps_are_evenly_spaced(ring: LightRing, dim: np.ndarray) -> None:
    ring.load_sequence([dim, np.zeros_like(dim)], [Step(group=k, dwell_us=20_000) for k in range(2)])
    ring.set_sync(SyncMode.FREE)
    ring.events.clear()
    ring.start()
    talk(ring, 2)
    ring.blank()
    lights = [e for e in ring.events if isinstance(e, p.LightEvent) and e.step != p.NO_STEP]
    gaps = np.diff([e.first_bit_us for e in lights])
    assert len(gaps) > 60
    assert np.abs(gaps - 20_000).max() <= 1
    assert ring.counters().late_steps == 0


def test_step_2_more_current_than_the_limit_is_refused(ring: LightRing, dim: np.ndarray) -> None:
    white = np.full_like(dim, 255)
    if ring.led_count >= 8:
        with pytest.raises(RefusedError, match="OVER_CURRENT"):
            ring.set_leds(white)


def test_step_2_damaged_packets_are_counted(ring: LightRing) -> None:
    before = ring.counters()
    ring.transport.write(b"\x05rub\0bish\0")
    after = ring.counters()
    assert after.bad_framing + after.bad_crc > before.bad_framing + before.bad_crc


def test_step_2_the_configuration_is_kept_over_a_restart(ring: LightRing, reopened: Callable[[], LightRing]) -> None:
    ring.blank()
    time.sleep(0.05)
    before = ring.configuration()
    named = dataclasses.replace(before, name=b"hardware test".ljust(16, b"\0"))
    ring.configure(named, save=True)
    ring.reset()
    ring.close()
    time.sleep(2)
    with reopened() as again:
        kept = again.configuration()
        again.configure(before, save=True)  # first: the board is somebody's, whatever the test finds
    assert kept == named


def test_step_2_every_led_is_where_and_what_it_should_be(ring: LightRing, ask: Callable[[str], str]) -> None:
    """By eye: LED 0 at azimuth 0, the others anticlockwise, in the colour that is named."""
    for led in range(ring.led_count):
        for name, channel in COLOURS.items():
            light = np.zeros((ring.led_count, 3), np.uint8)
            light[led, channel] = 60
            ring.light(light)
            assert ask(f"Is LED {led} {name}, and no other lit? [y/n]") == "y", (led, name)


# ---- 3: the ring is dark whenever no host wants it lit. ----

LIGHT = "import sys, time; from gellight.ring.light_ring import connect; import numpy as np\n" \
        "ring = connect(sys.argv[1]); ring.light(np.full((ring.led_count, 3), 8, np.uint8))\n" \
        "print('lit', flush=True); time.sleep(60)"  # fmt: skip


def test_step_3_a_silent_host_leaves_it_dark(url: str) -> None:
    with LightRing(open_transport(url), keep_alive_s=None) as silent:
        silent.set_leds(np.full((silent.led_count, 3), 8, np.uint8))
        time.sleep(silent.configuration().host_timeout_ms / 1e3 + 0.3)
        assert silent.status().dark == Dark.HOST_SILENT


def test_step_3_a_program_that_is_killed_leaves_it_dark(url: str) -> None:
    if url.startswith("sim://"):
        pytest.skip("needs real hardware: a simulated board ends with its program")
    program = subprocess.Popen([sys.executable, "-c", LIGHT, url], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    assert program.stdout.readline().strip() == "lit"
    program.kill()
    program.wait()
    program.stdout.close()
    time.sleep(1.3)
    with connect(url) as ring:
        status = ring.status()
        assert status.dark in (Dark.PORT_CLOSED, Dark.HOST_SILENT)
        assert status.time_us > 1e6  # it was darkened, not started anew


def test_step_3_a_pulled_plug_leaves_it_dark(ring: LightRing, dim: np.ndarray, ask: Callable[[str], str]) -> None:
    """By eye; with a supply of their own the LEDs need the load switch for this."""
    ring.light(dim)
    assert ask("Pull the USB plug of the board. Are the LEDs dark? Plug it in again. [y/n]") == "y"


# ---- 4: above its limit of temperature the board dims the LEDs and says so. ----

LOWEST_C, WARM_C, REACTS_S = 40, 45, 15.0


def test_step_4_a_warm_chip_dims_its_leds(ring: LightRing, dim: np.ndarray, ask: Callable[[str], str]) -> None:
    ring.light(None)
    time.sleep(0.05)
    before = ring.configuration()
    ring.configure(dataclasses.replace(before, hottest_c=LOWEST_C))  # until the next start
    try:
        while (chip_temperature_c(ring.status()) or 0.0) < WARM_C and not ring.status().dimmed:
            ask(f"The chip has {chip_temperature_c(ring.status())} °C: warm it above {WARM_C} °C, then press Enter.")
        ring.set_leds(dim)
        end_s = time.monotonic() + REACTS_S
        while not ring.status().dimmed and time.monotonic() < end_s:
            time.sleep(0.2)
        status = ring.status()
        assert status.dimmed >= 1
        assert any(isinstance(event, p.DimmedEvent) for event in ring.events)
        assert ring.set_leds(dim).scale == 0xFFFF >> ring.status().dimmed
    finally:
        ring.light(None)
        time.sleep(0.05)
        ring.configure(before)


# ---- 5: at a hub, with the camera on it too. ----

PLUGGED, AT_MOST_S = 5, 2.0


def test_step_5_it_is_there_each_time_it_is_plugged_into_a_busy_hub(
    ask: Callable[[str], str], reopened: Callable[[], LightRing]
) -> None:
    """Silicon B0 and B1 needs the workaround of RP2040-E5 here; something else at the hub has to be talking."""
    for number in range(PLUGGED):
        ask(f"{number + 1} of {PLUGGED}: unplug the board from the hub. Press Enter and plug it in within a second.")
        begun_s = time.monotonic()
        with reopened() as ring:
            took_s = time.monotonic() - begun_s
            ring.clock()
        assert took_s < AT_MOST_S + 1.0


def test_step_5_a_minute_beside_the_camera_loses_nothing(ask: Callable[[str], str]) -> None:
    ask("Board and camera at one hub, the camera's lens open. Press Enter.")
    with open_camera("auto") as camera:
        ring = camera.ring
        assert ring is not None
        colours = np.full((ring.led_count, 3), 8, np.uint8)
        ring.light(colours)
        first = camera.read().sequence
        end_s = time.monotonic() + 60
        while time.monotonic() < end_s:
            stream(ring, 1.0)
            last = camera.read().sequence
        assert last > first


# ---- 6: a Raspberry Pi 4, whose USB controller makes RP2040-E15 visible. ----

MINUTES, RECOVERED_S = 10, 12.0


def run_for(ring: LightRing, seconds: float) -> None:
    dim = np.full((ring.led_count, 3), 8, np.uint8)
    ring.load_sequence([dim, np.zeros_like(dim)], [Step(group=k, dwell_us=5_000) for k in range(2)])
    ring.set_sync(SyncMode.FREE)
    ring.start()
    stream(ring, seconds)
    ring.blank()


@pytest.mark.timeout(60 * MINUTES + 120)
def test_step_6_ten_minutes_lose_nothing(ring: LightRing, reopened: Callable[[], LightRing]) -> None:
    try:
        run_for(ring, 60.0 * MINUTES)
    except BoardError as error:
        lost_s = time.monotonic()
        ring.transport.close()
        with reopened():
            took_s = time.monotonic() - lost_s
        how = "by itself" if took_s < RECOVERED_S else f"after {took_s:.1f} s"
        pytest.fail(f"the board was lost ({error}) and came back {how}: RP2040-E15 is met, its recovery works")


# ---- 7: the computer sleeps. The ring is dark meanwhile, and answers when it wakes. ----

SLEEP_S = 10


def sleep(ask: Callable[[str], str]) -> None:
    """Let the computer sleep for a while, by itself where that is allowed."""
    ask("The computer is going to sleep. Look at the LEDs meanwhile. Press Enter.")
    if shutil.which("rtcwake") and os.geteuid() == 0:
        subprocess.run(["rtcwake", "-m", "mem", "-s", str(SLEEP_S)], check=True)
    else:
        ask(f"Close the lid for {SLEEP_S} s, open it, and press Enter.")


def test_step_7_the_port_works_on_after_a_sleep(
    ring: LightRing, dim: np.ndarray, ask: Callable[[str], str], reopened: Callable[[], LightRing]
) -> None:
    ring.light(dim)
    sleep(ask)
    assert ask("Were the LEDs dark while the computer slept? [y/n]") == "y"
    time.sleep(1)
    try:
        status = ring.status()
    except BoardError:  # some computers take the power away: then the port is a new one
        ring.transport.close()
        with reopened() as again:
            assert again.status().dark in (Dark.BOOT, Dark.COMMAND)
        return
    assert status.dark in (Dark.SUSPENDED, Dark.NOT_DARK, Dark.PORT_CLOSED)


# ---- 8: the camera's strobe at the trigger pin, through resistor and clamp. ----

SECONDS = 10.0


def test_step_8_every_strobe_is_counted_and_lights_a_step(ring: LightRing, dim: np.ndarray) -> None:
    rate_hz = float(os.environ.get("GELLIGHT_TRIGGER_HZ", "0"))
    if not rate_hz:
        pytest.skip("needs real hardware: a strobe, whose rate is given as GELLIGHT_TRIGGER_HZ")
    ring.set_sync(SyncMode.EXT)
    ring.load_sequence([dim, dim // 2], [Step(group=k, dwell_us=0) for k in range(2)])
    before = ring.counters()
    ring.start()
    talk(ring, SECONDS)
    ring.stop()
    after = ring.counters()
    assert abs(after.triggers - before.triggers - rate_hz * SECONDS) <= 0.01 * rate_hz * SECONDS + 2
    assert after.triggers_missed - before.triggers_missed <= 1
    assert after.lights - before.lights >= after.triggers - before.triggers - 2
