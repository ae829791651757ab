"""The checks of `gellight doctor` that open the sensor: board, LEDs, formats, settings, frames as they really come."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gellight.base.errors import GellightError
from gellight.frames.camera import Camera
from gellight.frames.jpeg import CorruptPictureError
from gellight.lab.doctor.shutter_meter import ShutterEstimate, measure_shutter
from gellight.ring.heat import hot_text, ring_temperature_c
from gellight.ring.light_ring import LightRing
from gellight.sensor.connection import Surroundings
from gellight.sensor.discovery import Sensor
from gellight.sensor.findings import Finding, Level, failure, judged, ok, problem, warning
from gellight.sensor.v4l2.formats import decode
from gellight.sensor.v4l2.stamps import StampMeaning, cadence
from gellight.sensor.v4l2.stream import Picture
from gellight.sensor.v4l2.video_camera import V4l2Camera

ISOCHRONOUS_BYTES_S = 3 * 1024 * 8000
"""the most that one USB 2 endpoint reserves: three packets of 1024 bytes in each of 8000 microframes"""
FRAMES = 60  # chosen: two seconds at 30 frames/s
SETTLE_FRAMES = 6
"""frames that a camera may take to come regularly after its start, or to show a new light"""
RATE_TOLERANCE = 0.05  # chosen: a camera that lengthens its exposure is farther off
SEEN_GREY = 2.0
"""mean grey levels by which the LEDs have to brighten the picture"""
TEST_BRIGHTNESS = 40  # chosen: of 255; twelve white LEDs of 20 mA a colour take 113 mA
SLOW_ROUND_TRIP_S = 0.02  # chosen: over half a frame at 30 frames/s, within which the light may change
MOST_LIT = 5
"""LEDs of one colour: fewer than a calibration lights, so that nothing dazzles the camera"""


def check_sensor(sensor: Sensor, surroundings: Surroundings) -> Iterator[Finding]:
    """Open ring and camera and check both; the LEDs are dark in the end."""
    try:
        with V4l2Camera(sensor.camera.path, kernel=surroundings.kernel, sysfs=surroundings.sysfs) as camera:
            yield from check_formats(camera)
            pictures = [camera.picture() for _ in range(SETTLE_FRAMES + FRAMES)][SETTLE_FRAMES:]
            yield from check_settings(camera)
            yield check_rate(camera, pictures)
            yield check_stamps(camera, pictures)
            yield check_bandwidth(camera, pictures)
            yield check_losses(camera, pictures)
            if sensor.ring is not None:
                with surroundings.open_ring(sensor.ring.path) as ring:
                    yield check_board(ring)
                    yield check_ring_clock(ring, surroundings)
                    yield (leds := check_leds(ring, camera))
                    if leds.level is Level.OK:
                        camera.ring = ring
                        yield check_shutter(camera, camera.stamp_meaning, pictures[-1])
    except GellightError as error:
        yield failure("sensor", error)


def check_formats(camera: V4l2Camera) -> Iterator[Finding]:
    """List what the camera offers; raw pictures at the same rate would be free of JPEG's artefacts."""
    offered = camera.offers
    yield ok("formats", "; ".join(str(offer) for offer in offered))
    mode = camera.mode
    fitting = [each for each in offered if each.has(mode.width, mode.height) and max(each.rates, default=0) >= mode.fps]
    raw = [offer.letters for offer in fitting if offer.letters in ("YUYV", "RGB3")]
    if raw and mode.letters == "MJPG":
        text = f"{raw[0]} comes at {mode.fps:g} fps too, without JPEG's artefacts"
        yield ok("formats", f"{text}: use ?format={raw[0]} where the camera has its bus for itself")


def check_settings(camera: V4l2Camera) -> Iterator[Finding]:
    """Look whether everything automatic is off and stays off while pictures come."""
    controls = camera.controls
    missing = [name for name in ("exposure_us", "gain", "white_balance_k") if name not in controls.names()]
    if "exposure_us" in missing:
        yield problem("settings", "the exposure of this camera cannot be fixed", "use another camera")
    elif missing:
        text = f"this camera has no {' and no '.join(missing)}"
        yield warning("settings", text, "use another camera if colours drift")
    free = [name for name, locked in controls.locked().items() if not locked]
    wrong = [str(deviation) for deviation in controls.deviations()]
    if free or wrong:
        yield problem("settings", f"not locked: {', '.join(free + wrong)}", "end other programmes that use the camera")
    elif "exposure_us" not in missing:
        exposure_ms = controls.read("exposure_us") / 1e3
        yield ok("settings", f"exposure locked at {exposure_ms:g} ms of a period of {1e3 / camera.mode.fps:.1f} ms")


def check_rate(camera: V4l2Camera, pictures: list[Picture]) -> Finding:
    """Compare the rate that the kernel's time stamps show with the one the camera promised."""
    fps = 1 / cadence(pictures).period_s
    text = f"{fps:.2f} frames/s by the kernel's stamps, {camera.mode.fps:g} promised"
    remedy = "shorten the exposure, or ask for a rate that the camera keeps with ?fps="
    return judged("rate", text, bad=abs(fps / camera.mode.fps - 1) > RATE_TOLERANCE, remedy=remedy)


def check_stamps(camera: V4l2Camera, pictures: list[Picture]) -> Finding:
    """Check that the time stamps jitter by less than `stamp_error_us`: labels of light allow for no more."""
    found, allowed_s = cadence(pictures), camera.stamp_meaning.stamp_error_s
    text = f"jitter of the time stamps {found.wander_s * 1e3:.2f} ms (95 %), at most {found.farthest_s * 1e3:.2f} ms"
    if found.farthest_s > allowed_s:
        return warning(
            "stamps", f"{text}: more than the {allowed_s * 1e3:g} ms that labels of light allow for",
            "end what keeps the processor busy, use a USB port without a hub, or let labels allow for it with "
            f"?stamp_error_us={math.ceil(found.farthest_s * 1e4) * 100}",
        )  # fmt: skip
    return ok("stamps", text)


def check_bandwidth(camera: V4l2Camera, pictures: list[Picture]) -> Finding:
    """Compare what the pictures take with what USB 2 reserves for one camera at most."""
    rate = float(np.mean([len(picture.data) for picture in pictures])) * camera.mode.fps
    text = f"{camera.mode} takes {rate / 1e6:.1f} MB/s, {rate / ISOCHRONOUS_BYTES_S:.0%} of what USB 2 reserves at most"
    remedy = "no second camera fits on this bus: use format=MJPG for that"
    return judged("bandwidth", text, bad=rate > 0.8 * ISOCHRONOUS_BYTES_S, remedy=remedy)


def check_losses(camera: V4l2Camera, pictures: list[Picture]) -> Finding:
    """Look at what was counted while the pictures came, and whether they are whole."""
    counts, few = camera.counts, FRAMES // 20
    if counts.wrong_stamps:
        return problem("clock", f"{counts.wrong_stamps} of {counts.delivered} time stamps cannot be true",
                       "unload and load uvcvideo without hwtimestamps=1, or use another camera")  # fmt: skip
    if counts.identical > few:
        return warning("frames", f"{counts.identical} of {counts.delivered} pictures repeat the one before",
                       "shorten the exposure or lower the rate: the camera fills gaps with old pictures")  # fmt: skip
    found = cadence(pictures)
    if found.left_out > few and found.wander_s < found.period_s / 8:  # else a late picture looks like a missing one
        return warning("frames", f"{found.left_out} pictures are missing without a gap in the driver's numbers",
                       "lower the rate or the size, or use another camera: this one leaves pictures out")  # fmt: skip
    corrupt = sum(not _whole(picture, camera) for picture in pictures)
    bad = counts.lost + counts.damaged + corrupt + counts.duplicated
    text = (f"{counts.lost} lost, {counts.damaged} damaged, {corrupt} not whole, {counts.duplicated} duplicated of "
            f"{counts.delivered + bad - corrupt}")  # fmt: skip
    return judged("frames", text, bad=bad > few, remedy="use another cable, another port or no hub")


def _whole(picture: Picture, camera: V4l2Camera) -> bool:
    try:
        decode(picture.data, camera.mode)
    except CorruptPictureError:
        return False
    return True


def check_board(ring: LightRing) -> Finding:
    """Look at firmware and counters of the board; its protocol was checked when it was opened."""
    hello, counters, status = ring.hello, ring.counters(), ring.status()
    if status.dimmed:
        return problem("board", "the LEDs are dimmed", hot_text(status))
    version = f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}"
    ring_c = ring_temperature_c(status)
    warm = "the ring's temperature is unknown (no NTC)" if ring_c is None else f"the ring has {ring_c:.0f} °C"
    text = f"{hello.unique_id.hex().upper()} with firmware {version}, {counters.packets} packets; {warm}"
    return ok("board", text)


def check_ring_clock(ring: LightRing, surroundings: Surroundings) -> Finding:
    """Measure how long the board takes to answer: light and frames are tied together through it."""
    times = []
    for _ in range(20):
        begun_s = surroundings.kernel.clock()
        ring.clock()
        times.append(surroundings.kernel.clock() - begun_s)
    median_s = float(np.median(times))
    text = f"the board answers within {median_s * 1e3:.2f} ms (median)"
    remedy = "use a port of its own: the light of a frame is known less surely"
    return judged("clock", text, bad=median_s > SLOW_ROUND_TRIP_S, remedy=remedy)


def check_leds(ring: LightRing, camera: V4l2Camera) -> Finding:
    """Light the ring and look whether the camera sees it."""
    dark = _mean_grey(camera)
    ring.light(np.full((ring.led_count, 3), TEST_BRIGHTNESS, np.uint8))
    lit = _mean_grey(camera)
    ring.blank()
    text = f"the picture is {dark:.1f} grey levels with dark LEDs, {lit:.1f} with all lit at {TEST_BRIGHTNESS} of 255"
    if lit - dark < SEEN_GREY:
        return problem("leds", text, "check the ring's 5 V and data wire, and that this camera looks at this ring")
    return ok("leds", text)


def check_shutter(camera: Camera, meaning: StampMeaning, picture: Picture) -> Finding:
    """Measure when the rows are exposed, by the light of the ring; without that, light sequences assume the worst.

    `picture` is any of the camera: it tells what kind of stamp it gives.
    """
    assert camera.ring is not None
    count = camera.ring.led_count
    groups = np.zeros((2, count, 3), np.uint8)
    lit = min(max(count // 4, 1), MOST_LIT)
    groups[0, :lit, 0] = groups[1, count // 2 : count // 2 + lit, 2] = 255  # opposite each other, for all can dazzle
    try:
        measured = measure_shutter(camera, groups, timing=camera.timing)
    except GellightError as error:
        remedy = "run this again with nothing at the gel, and end what keeps the processor busy"
        return warning("shutter", f"exposure and readout cannot be measured: {error}", remedy)
    options = _shutter_options(measured, meaning, picture)
    text = f"exposure {measured.exposure_s * 1e3:.1f} ms, readout {measured.readout_s * 1e3:.1f} ms"
    return ok("shutter", f"{text}: give {options} so that each light of a sequence can be short")


def _shutter_options(measured: ShutterEstimate, meaning: StampMeaning, picture: Picture) -> str:
    """Return what to add to the camera's URL, so that its frames begin when they were measured to begin."""
    undelayed = replace(meaning, readout_s=measured.readout_s, delay_s=0.0)
    delay_s = undelayed.start_s(picture) - meaning.start_s(picture) - measured.delay_s
    return f"?readout_us={measured.readout_s * 1e6:.0f}&delay_us={max(delay_s, 0.0) * 1e6:.0f}"


def _mean_grey(camera: V4l2Camera) -> float:
    frames = [camera.read() for _ in range(SETTLE_FRAMES)]
    return float(frames[-1].image.mean())
