"""Light labels against the truth, on the board's own clock: `python -m tests.benchmarks.labels [LABELS] [SEED]`.

The firmware's image runs in the emulator on virtual time, so nothing is ever late and every label can be judged. Each
sensor is drawn at random: frame rate, exposure, readout, jitter of the stamps, drift of the clocks, what moves the
light on, lost frames, damaged bytes on the serial line, and pauses of the host of up to .4 s. A label is wrong where a
frame is called clean and is not, or is clean under another group.
"""

import sys
import time
from collections import Counter

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.frames.frames import LightState
from gellight.frames.timing import CameraTiming
from gellight.lab.simulator.shutter import Shutter
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from tests.helpers.virtual_sensor import RING, VirtualCamera, virtual_sensor

FRAMES = 100
"""of one sensor, then another is drawn"""
MODES = (LightMode.FREE, LightMode.FREE, LightMode.EXT, LightMode.HOLD)
LOST, PAUSED, FLIPPED = 0.05, 0.03, 2e-4
"""share of frames that are lost, and before which the host pauses; share of the bytes that arrive damaged"""
LONGEST_PAUSE_S = 0.4


class Noise:
    """Damages bytes between host and board, in both directions."""

    def __init__(self, camera: VirtualCamera, rng: np.random.Generator, share: float) -> None:
        """Stand in the way of the camera's ring."""
        transport, self._rng, self._share = camera.ring.transport, rng, share
        self._write, self._read = transport.write, transport.read
        transport.write = lambda data: self._write(self._pass(data))  # type: ignore[method-assign]
        transport.read = lambda timeout_s: self._pass(self._read(timeout_s))  # type: ignore[method-assign]

    def _pass(self, data: bytes) -> bytes:
        """Return what arrives."""
        arriving = np.frombuffer(data, np.uint8)
        hit = self._rng.random(len(arriving)) < self._share
        return bytes(arriving ^ np.where(hit, 1 << self._rng.integers(0, 8, len(arriving)), 0).astype(np.uint8))


def drawn(patch: pytest.MonkeyPatch, rng: np.random.Generator) -> tuple[VirtualCamera, CameraTiming, LightMode]:
    """Return a sensor, what the host knows of its shutter, and what moves its light on."""
    mode = MODES[rng.integers(len(MODES))]
    period_s = 1 / rng.uniform(20, 60)
    exposure_s = rng.uniform(0.1, 0.5) * period_s
    readout_s = rng.uniform(0.1, 0.9) * (period_s - exposure_s)
    error_s = rng.choice([2e-4, 5e-4, 1e-3])
    camera = virtual_sensor(
        patch, fps=1 / period_s, seed=int(rng.integers(1 << 30)), strobe=mode is LightMode.EXT, jitter_s=0.8 * error_s
    )
    camera.clock.drift = rng.uniform(-150e-6, 150e-6)
    camera.shutter = Shutter(
        exposure_us=exposure_s * 1e6, readout_us=readout_s * 1e6, transfer_us=5000.0, pulse_period_us=500.0
    )
    timing = CameraTiming(
        exposure_s=exposure_s, readout_s=readout_s, period_s=period_s, stamp_error_s=error_s, pulse_period_s=0.0005
    )
    return camera, timing, mode


def judged(sensor: int, seed: int) -> Counter[str]:
    """Count what the labels of one sensor are: right, wrong, mixed (how many of them are so), unknown, or no frame."""
    rng, counts = np.random.default_rng([seed, sensor]), Counter[str]()
    groups = colour_triples(RING) if rng.random() < 0.7 else single_leds(RING)
    with pytest.MonkeyPatch.context() as patch:
        camera, timing, mode = drawn(patch, rng)
        Noise(camera, rng, FLIPPED if rng.random() < 0.5 else 0.0)
        try:
            with SequencedCamera(camera, groups, mode=mode, timing=timing) as sequenced:
                for _ in range(FRAMES):
                    camera.count += int(rng.random() < LOST)
                    if rng.random() < PAUSED:
                        camera.clock.sleep(rng.uniform(0, LONGEST_PAUSE_S))
                    counts[said(sequenced, camera, groups)] += 1
        except BoardError as error:
            counts[f"ended: {str(error)[:60]}"] += 1
        counts.update({"fault of the firmware": len(camera.board.faults)})
    return +counts


def said(sequenced: SequencedCamera, camera: VirtualCamera, groups: np.ndarray) -> str:
    """Read a frame, and compare its label with what it truly is."""
    label, truth = sequenced.read().label, camera.truth(groups)
    assert label is not None
    if label.state is not LightState.CLEAN:
        clean = truth is not None and truth.state is LightState.CLEAN
        return f"{label.state}, truly clean" if clean else str(label.state)
    return "right" if label == truth else f"wrong ({sequenced.mode}): {label} for {truth}"


def main(arguments: list[str]) -> None:
    """Draw sensors until that many clean labels have been judged; print the counts."""
    wanted, seed = (int(given) for given in [*arguments, "10000", "1"][:2])
    counts, sensor, begun_s = Counter[str](), 0, time.process_time()
    while sum(count for name, count in counts.items() if name.startswith(("right", "wrong"))) < wanted:
        counts += judged(sensor, seed)
        sensor += 1
    print(f"{sensor} sensors, {time.process_time() - begun_s:.0f} s of processor time")
    for name, count in sorted(counts.items()):
        print(f"{count:7d}  {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
