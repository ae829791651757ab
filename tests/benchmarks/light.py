"""Figures of light and frame: `python -m tests.benchmarks.light [labels|holds|modes|shutter]`.

All times are virtual or drawn, the same on every machine.
The worlds and phases here have other seeds than those on which anything was chosen.
"""

import sys
from collections import Counter

import numpy as np
import pytest

from gellight.frames.camera import CameraTiming
from gellight.lab.doctor.shutter_meter import measure_shutter
from gellight.ring.light_groups import colour_triples
from gellight.sensor.lighting.lock import hold_frames
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from tests.helpers.light_world import compare
from tests.helpers.virtual_sensor import RING, virtual_sensor

TRIPLES = colour_triples(RING)


def labels() -> None:
    """By the times alone, against the truth."""
    for name, worlds, typical in (("anything drawn at random", 1500, False), ("30 Hz, 8 + 12 ms, k = 2, 3", 300, True)):
        counts = compare(worlds, seed=271828, typical=typical)
        total = {truth: sum(n for (t, _), n in counts.items() if t == truth) for truth in ("clean", "mixed", "dark")}
        right = counts["clean", "clean"] + counts.get(("mixed", "mixed"), 0)
        wrong = counts.get(("clean", "mixed"), 0) + counts.get(("clean", "wrong group"), 0)
        print(f"{name}: {sum(counts.values())} frames, {total['mixed']} truly mixed")
        print(f"  mixed called clean {counts.get(('mixed', 'clean'), 0)}, clean called mixed or another group {wrong}")
        print(f"  right {right / (total['clean'] + total['mixed']):.1%}, the others unknown; "
              f"of the clean ones {counts['clean', 'clean'] / total['clean']:.1%}, "
              f"of the mixed ones {counts.get(('mixed', 'mixed'), 0) / total['mixed']:.1%}")  # fmt: skip


def holds() -> None:
    """Frames that a light has to stay."""
    print("camera                                            k unlocked  k locked  lights a second")
    for fps, exposure, readout in ((30, 8, 12), (30, 8, 30), (30, 16, 33), (60, 8, 12), (60, 4, 5), (120, 2, 5)):
        timing = CameraTiming(exposure_s=exposure / 1e3, readout_s=min(readout / 1e3, 1 / fps), period_s=1 / fps,
                              pulse_period_s=5e-4)  # fmt: skip
        free, locked = (hold_frames(timing, locked=lock, clock_error_s=5e-4) for lock in (False, True))
        print(f"{fps:4} Hz, exposure {exposure:3} ms, readout {readout:3} ms, 2 kHz   {free:10} {locked:9}"
              f"  {fps / free:5.1f} {fps / locked:6.1f}")  # fmt: skip


def modes() -> None:
    """Frames a second of virtual time on the emulated firmware, four triples, after 30 frames to lock."""
    for mode, frames, fps in ((LightMode.HOLD, 1, 30), (LightMode.FREE, 1, 30), (LightMode.FREE, 2, 30),
                              (LightMode.FREE, 2, 60), (LightMode.EXT, 1, 30)):  # fmt: skip
        with pytest.MonkeyPatch.context() as patch:
            camera = virtual_sensor(patch, seed=7, strobe=mode is LightMode.EXT, fps=fps)
            timing = CameraTiming(pulse_period_s=5e-4, period_s=1 / fps)
            with SequencedCamera(camera, TRIPLES, mode=mode, timing=timing, frames=frames) as sequenced:
                for _ in range(0 if mode is LightMode.HOLD else 30):
                    sequenced.read()
                counts, start_us, lights, last = Counter(), camera.board.now_us, 0, None
                for _ in range(90):
                    frame, truth = sequenced.read(), camera.truth(TRIPLES)
                    clean = frame.label.group is not None
                    counts["right" if clean and frame.label == truth else "WRONG" if clean else "not clean"] += 1
                    lights, last = lights + (clean and frame.label.group != last), frame.label.group if clean else last
                seconds = (camera.board.now_us - start_us) * 1e-6
                a_second = (
                    f"{90 / seconds:.1f} frames, {counts['right'] / seconds:.1f} clean, {lights / seconds:.1f} lights/s"
                )
            print(f"{mode} at {fps} Hz, k = {frames}: {a_second}, {dict(counts)}")


def shutter() -> None:
    """Error of the measured shutter over ten phases; stamps jitter by 0.5 ms either way."""
    errors = []
    for seed in range(10):
        with pytest.MonkeyPatch.context() as patch:
            camera = virtual_sensor(patch, seed=100 + seed, late_s=0.005)
            found = measure_shutter(camera, TRIPLES[[0, 2]], timing=CameraTiming(pulse_period_s=5e-4))
            errors.append([found.exposure_s - 0.008, found.readout_s - 0.012, found.delay_s + 0.005])
            camera.close()
    rms, worst = np.sqrt(np.mean(np.square(errors), axis=0)) * 1e3, np.abs(errors).max(axis=0) * 1e3
    for name, r, w in zip(("exposure 8 ms", "readout 12 ms", "stamp -5 ms"), rms, worst, strict=True):
        print(f"{name:14} error rms {r:.2f} ms, worst {w:.2f} ms")


def main() -> None:
    """Print what is asked for, or all."""
    parts = {part.__name__: part for part in (labels, holds, modes, shutter)}
    for name in sys.argv[1:] or parts:
        print(f"--- {name}")
        parts[name]()


if __name__ == "__main__":
    main()
