"""What the watch costs beside the frame path, how often it is wrong, and whether its estimate of errors is right.

`python -m tests.benchmarks.watch [RUNS]`, from the root of the checkout. Seeds begin at 2999; the thresholds were
chosen on seeds below 100.
"""

import sys
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.scene import Press, Scene
from gellight.reconstruction.integration import angle_deg, normals
from gellight.watch.cells import spread
from gellight.watch.monitor import PERIOD_S, SensorWatch
from sim_reference.camera import CameraResponse
from sim_reference.geometry import AS_BUILT
from tests.helpers.watched_sensor import NOISE_GREY, WatchedSensor, dusty, torn

Item = TypeVar("Item")
FRAMES_A_SECOND = 30
SHAPE = (480, 640)


def main() -> None:
    """Print the tables."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    scene = Scene(AS_BUILT, CameraResponse(noise_grey=NOISE_GREY))
    cost(scene)
    counts(scene, runs)
    estimates(scene)


def cost(scene: Scene) -> None:
    """CPU time of the looks as a share of the CPU time of the frames, in one run."""
    bundle = load_bundle("synthetic")
    sensor, reconstructor = WatchedSensor(scene, SensorWatch(bundle), 2999), Reconstructor(bundle)
    looks, frames = [], []
    for press in [None, Press("BALL", 1.0, 3.0, 2.0)] * 20:
        frame = sensor.frame(press)
        frames.append(timed(reconstructor.reconstruct, frame.camera_frame))
        looks.append(timed(sensor.watch.note, frame))
    share = np.mean(looks) / PERIOD_S / (np.mean(frames) * FRAMES_A_SECOND)
    print(
        f"a look {1e3 * np.mean(looks):.2f} ms, a frame {1e3 * np.mean(frames):.1f} ms of CPU: at {1 / PERIOD_S:g} "
        f"looks and {FRAMES_A_SECOND} frames a second the watch takes {share:.2%} of the frame path"
    )


def timed(act: Callable[[Item], object], item: Item) -> float:
    """Seconds of CPU time of this thread that `act` takes."""
    begun = time.thread_time()
    act(item)
    return time.thread_time() - begun


def counts(scene: Scene, runs: int) -> None:
    """How many of that many faulty and sound sensors were told rightly."""
    random = np.random.default_rng(3000)
    looks = false = 0
    for run in range(runs):
        sensor = sound(scene, 3000 + run)
        sensor.work(15)
        looks += sensor.watch.status()["looks"]  # type: ignore[operator]
        false += bool(sensor.told)
    print(f"sound sensors with a finding: {false} of {runs} ({looks} looks, {15 * runs} presses)")
    right = dict.fromkeys(("led_dimmed", "led_dead", "camera_moved", "tear", "dirt"), 0)
    light_error, shift_error = [], []
    for run in range(runs):
        for kind in right:
            sensor = sound(scene, 4000 + run)
            expected = break_it(sensor, kind, random)
            sensor.work({"tear": 16, "dirt": 16, "camera_moved": 1}.get(kind, 6))
            sensor.run(3)
            told = [f for f in sensor.watch.findings() if f.kind == kind]
            others = set(sensor.told) - {kind, "zero_off", "recalibrate"}
            right[kind] += len(told) == 1 and not others and told[0].figures.get("led", expected) == expected
            if kind == "led_dimmed" and told:
                light_error.append(abs(float(str(told[0].figures["light"])) - sensor.leds[expected]))
            if kind == "camera_moved" and told:
                off = [float(str(told[0].figures[f"{axis}_px"])) - sensor.shift_px["xy".index(axis)] for axis in "xy"]
                shift_error.append(np.hypot(*off))
    for kind, count in right.items():
        print(f"{kind:14} told, and nothing else: {count} of {runs}")
    print(f"light of a dimmed LED within {max(light_error):.3f}, shift within {max(shift_error):.2f} px")


def sound(scene: Scene, seed: int) -> WatchedSensor:
    """A sensor as it was calibrated."""
    return WatchedSensor(scene, SensorWatch(load_bundle("synthetic")), seed)


def break_it(sensor: WatchedSensor, kind: str, random: np.random.Generator) -> int:
    """Make a fault; returns the LED where it is one."""
    led, x, y = int(random.integers(12)), int(random.uniform(60, 580)), int(random.uniform(60, 420))
    match kind:
        case "led_dimmed":
            sensor.leds = {led: float(random.uniform(0.3, 0.87))}
        case "led_dead":
            sensor.leds = {led: 0.0}
        case "camera_moved":
            turn, far = random.uniform(0, 2 * np.pi), random.uniform(0.6, 3)
            sensor.shift_px = float(far * np.cos(turn)), float(far * np.sin(turn))
        case "tear":
            sensor.spot = torn(SHAPE, x, y, seed=int(random.integers(1000)))
        case "dirt":
            sensor.spot = dusty(SHAPE, x, y, light=float(random.uniform(0.5, 0.8)))
    return led


def estimates(scene: Scene) -> None:
    """Expected errors beside those that four balls, pressed 1 mm deep, then show."""
    print(f"{'fault':22}{'zero, degrees':>18}{'zero, mm':>18}{'contact, degrees':>20}   (expected, measured)")
    bundle = load_bundle("synthetic")
    own = sound(scene, 5000).contact_error_deg(Reconstructor(bundle))
    for name, leds, gain in (
        ("all light 97 %", {}, 0.97),
        ("all light 90 %", {}, 0.90),
        ("LED 0 at 50 %", {0: 0.5}, 1.0),
        ("LED 5 dead", {5: 0.0}, 1.0),
        ("LEDs 2, 7 at 50, 70 %", {2: 0.5, 7: 0.7}, 1.0),
    ):
        sensor = sound(scene, 5001)
        sensor.leds, sensor.gain = leds, np.full(3, gain)
        sensor.run(5)
        expected = sensor.watch.status()["expected"]
        assert isinstance(expected, dict)
        untouched = Reconstructor(bundle).reconstruct(sensor.frame().camera_frame)
        flat = normals(np.zeros_like(untouched.gradient_map))
        change = sensor.watch._judgement.fitted  # type: ignore[union-attr]
        zeroed = bundle.with_reference(np.clip(bundle.reference + spread(change, SHAPE), 0, 255), frames=100)
        contact = sensor.contact_error_deg(Reconstructor(zeroed)) - own
        pairs = (
            (expected["zero_deg"], angle_deg(untouched.normal_map, flat).mean()),
            (expected["zero_mm"], np.abs(untouched.depth_mm).mean()),
            (expected["gain_deg"], contact),
        )
        print(f"{name:22}" + "".join(f"{a:12.3f} {b:7.3f}" for a, b in pairs))


if __name__ == "__main__":
    main()
