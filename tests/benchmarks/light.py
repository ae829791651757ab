"""Figures of light and frame: `python -m tests.benchmarks.light [labels|holds|modes|content|shutter]`.

All times are virtual or drawn, the same on every machine; only the cost of the content check is measured, as a ratio.
The worlds, phases and presses here have other seeds than those on which anything was chosen.
"""

import sys
import time
from collections import Counter
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from gellight.frames.timing import CameraTiming
from gellight.lab.emulator.waveform import Light
from gellight.lab.simulator.scene import Press, Scene, under_light
from gellight.lab.simulator.shutter import Shutter, row_weights
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.lighting.content import ContentCheck
from gellight.sensor.lighting.lock import hold_frames
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from gellight.sensor.lighting.shutter_meter import measure_shutter
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import OBJECT_NAMES
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
            check = ContentCheck([camera.picture(group / 255) for group in TRIPLES])
            with SequencedCamera(camera, TRIPLES, mode=mode, timing=timing, check=check, frames=frames) as sequenced:
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
                slips = sequenced.counters.slips
            print(f"{mode} at {fps} Hz, k = {frames}: {a_second}, {dict(counts)}, {slips} slips")


def presses(rng: np.random.Generator) -> dict[str, list[Press]]:
    """Fresh ones."""
    balls = [Press("BALL", float(rng.uniform(0.2, 1.9)), *map(float, rng.uniform(-10, 10, 2))) for _ in range(25)]
    plates = [
        Press(name, float(rng.uniform(0.3, 1.2)), *map(float, rng.uniform(-3, 3, 2))) for name in OBJECT_NAMES[1:]
    ]
    return {"untouched": [Press("", 0.0)], "balls": balls, "plates": plates}


def content() -> None:
    """What contact does to the content check, 640 x 480, noise 1 grey level."""
    rng, shutter, scene = np.random.default_rng(77), Shutter(), Scene(SensorGeometry(), CameraResponse())
    ring, phases_us = np.round(scene.light * 255).astype(np.uint8), 500.0 * rng.random(12)
    spent = Counter()

    def picture(light: np.ndarray) -> np.ndarray:
        return digitise(linear_grey(under_light(scene._lit[2], light), scene.response).astype(np.float32), 1.0, rng)

    def timed(name: str, call: Callable[[], object]) -> object:
        start = time.perf_counter()
        result = call()
        spent[name] += time.perf_counter() - start
        return result

    sets = {"4 triples": colour_triples(ring), "12 single LEDs": single_leds(ring)}
    scene.prepare(None)
    checks = {name: ContentCheck([scene.show(None, g / 255)[0] for g in groups]) for name, groups in sets.items()}
    said = {(name, touched, pure): Counter() for name in sets for touched in presses(rng) for pure in (True, False)}
    for touched, list_of in presses(rng).items():
        for press in list_of:
            scene.prepare(press if press.object_name else None)
            for name, groups in sets.items():
                for number, group in enumerate(groups):
                    image = picture(group / 255)
                    label = timed("check", lambda n=name, i=image: checks[n].label(i))
                    said[name, touched, True][
                        "right"
                        if label.group == number
                        else "WRONG GROUP"
                        if label.group is not None
                        else str(label.state)
                    ] += 1
                    jpeg = cv2.imencode(".jpg", image)[1]
                    timed("jpeg", lambda j=jpeg: cv2.imdecode(j, cv2.IMREAD_COLOR))
                for after_us in rng.uniform(1500, 18_500, 6):  # at least 1 ms of the other light in some row
                    old, new = rng.choice(len(groups), 2, replace=False)
                    lights = [Light(0.0, groups[old]), Light(1e6 + after_us, groups[new])]
                    label = checks[name].label(picture(row_weights(lights, 1e6, 480, phases_us, shutter)))
                    said[name, touched, False][str(label.state)] += 1
    for (name, touched, pure), counts in said.items():
        share = {what: f"{n / counts.total():.1%}" for what, n in counts.most_common()}
        print(f"{name:15} {touched:10} {'one light' if pure else 'light changes':14} {counts.total():4} {share}")
    print(f"one check takes {spent['check'] / spent['jpeg']:.1f} times the decoding of the same picture from JPEG")


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
    parts = {part.__name__: part for part in (labels, holds, modes, shutter, content)}
    for name in sys.argv[1:] or parts:
        print(f"--- {name}")
        parts[name]()


if __name__ == "__main__":
    main()
