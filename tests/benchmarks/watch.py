"""How often the watch is wrong: `python -m tests.benchmarks.watch [RUNS]`.

Seeds begin at 3000; the thresholds were chosen on seeds below 100.
"""

import sys

import numpy as np

from gellight.bundle.bundle import load_bundle
from gellight.lab.simulator.scene import Scene
from gellight.watch.monitor import SensorWatch
from sim_reference.camera import CameraResponse
from sim_reference.geometry import AS_BUILT
from tests.helpers.watched_sensor import NOISE_GREY, WatchedSensor, dusty, torn

SHAPE = (480, 640)


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    counts(Scene(AS_BUILT, CameraResponse(noise_grey=NOISE_GREY)), runs)


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
    for run in range(runs):
        for kind in right:
            sensor = sound(scene, 4000 + run)
            expected = break_it(sensor, kind, random)
            sensor.work({"tear": 16, "dirt": 16, "camera_moved": 1}.get(kind, 6))
            sensor.run(3)
            told = [f for f in sensor.watch.findings() if f.kind == kind]
            others = set(sensor.told) - {kind, "zero_off", "recalibrate"}
            right[kind] += len(told) == 1 and not others and told[0].figures.get("led", expected) == expected
    for kind, count in right.items():
        print(f"{kind:14} told, and nothing else: {count} of {runs}")


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


if __name__ == "__main__":
    main()
