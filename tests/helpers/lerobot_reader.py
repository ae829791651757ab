"""A program that finds the plug-in as LeRobot does and uses it; tests start it in a process of its own.

    python lerobot_reader.py camera OUT.npz | press CAMERAS [refused] | quantise MIN MAX USE_LOG | export ...

On standard output it prints what it found, as JSON.
"""

import inspect
import json
import sys
import time
import types
from importlib.machinery import ModuleSpec
from typing import Any
from unittest.mock import MagicMock

import numpy as np


def registered() -> dict[str, list[str]]:
    """Let LeRobot look for plug-ins; return the types it knows then."""
    from lerobot.cameras.configs import CameraConfig
    from lerobot.robots.config import RobotConfig
    from lerobot.teleoperators.config import TeleoperatorConfig
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
    kinds: tuple[Any, ...] = (CameraConfig, RobotConfig, TeleoperatorConfig)
    return {kind.__name__: list(kind.get_known_choices()) for kind in kinds}


def camera_of(**options: object) -> Any:
    import draccus
    from lerobot.cameras.configs import CameraConfig
    from lerobot.cameras.utils import make_cameras_from_configs

    config = draccus.decode(CameraConfig, {"type": "gellight", "width": 64, "height": 48, "fps": 30, **options})
    return make_cameras_from_configs({"gel": config})["gel"]


def raised(call: Any, *arguments: object, **options: object) -> str:
    """Return type and text of what a call raises."""
    told = raised_or(lambda: call(*arguments, **options))
    return told if isinstance(told, str) else "nothing"


def unmet(camera: Any) -> list[str]:
    """Return the methods of LeRobot's camera that this one has not, or that do not take the same arguments."""
    from lerobot.cameras.camera import Camera

    missing = []
    for name, theirs in inspect.getmembers(Camera, inspect.isfunction):
        if not name.startswith("_"):
            ours = inspect.signature(getattr(type(camera), name)).parameters
            if getattr(type(camera), name) is theirs or not set(inspect.signature(theirs).parameters) <= set(ours):
                missing.append(name)
    return missing


def use_camera(out: str) -> dict[str, object]:
    """Read a camera in every way; the maps go into a file."""
    types_ = registered()
    camera = camera_of(sensor="finger")
    found: dict[str, object] = {
        "types": types_, "unmet": unmet(camera), "found": camera.find_cameras(),
        "unconnected": raised(camera.read_latest), "nobody": raised(camera_of(sensor="thumb").connect),
        "size": raised(camera_of(sensor="finger", width=640).connect),
        "nothing": raised(type(camera.config), use_rgb=False, use_depth=False),
    }  # fmt: skip
    before = camera.has_force
    camera.connect()
    found["weighs"] = [before, camera.has_force, only_images(use_force=False).has_force]
    found["twice"] = raised(camera.connect)
    maps = {"read": camera.read(), "async_read": camera.async_read(timeout_ms=2000), "latest": camera.read_latest()}
    time.sleep(0.3)  # newer frames come meanwhile
    maps["latest_depth"] = camera.read_latest_depth()
    found["force"] = raised_or(camera.read_latest_force)
    time.sleep(0.3)
    found["newer force"] = raised_or(camera.read_latest_force)
    maps["depth"] = camera.read_depth()
    found["old"] = raised(camera.read_latest, max_age_ms=-1)
    found["no depth"] = raised(only_images().read_latest_depth)
    camera.disconnect()
    found["after"] = [camera.is_connected, raised(camera.read)]
    np.savez(out, **maps)
    return found


def raised_or(call: Any) -> object:
    """Return what a call returns, or type and text of what it raises."""
    try:
        return call()
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def only_images(**options: object) -> Any:
    camera = camera_of(sensor="finger", use_depth=False, **options)
    camera.connect()
    return camera


def press() -> dict[str, object]:
    """Press with the robot and the teleoperator until the depth is seen; return how deep it was asked for and seen."""
    import draccus
    import yaml
    from lerobot.robots.config import RobotConfig
    from lerobot.robots.utils import make_robot_from_config
    from lerobot.teleoperators.config import TeleoperatorConfig
    from lerobot.teleoperators.utils import make_teleoperator_from_config

    registered()
    cameras = yaml.safe_load(sys.argv[2])
    cameras["gel"]["max_age_ms"] = 20000  # where tests run there may be other work
    robot = make_robot_from_config(draccus.decode(RobotConfig, {"type": "gellight_press", "cameras": cameras}))
    hand = make_teleoperator_from_config(
        draccus.decode(TeleoperatorConfig, {"type": "gellight_press", "depth_mm": 0.5, "step_mm": 0.5})
    )
    refused = raised(robot.connect) if len(sys.argv) > 3 else ""
    if refused:
        return {"refused": refused}
    gel = robot.cameras["gel"]
    connect, gel.connect = gel.connect, MagicMock(side_effect=ConnectionError("no such camera"))
    broken, gel.connect = raised(robot.connect), connect
    left = robot._hand is not None
    deepest_mm, seen_mm, until_s = 0.0, 0.0, time.monotonic() + 60
    with robot, hand:
        everything = robot.observation_features
        features = {name: list(kind) for name, kind in everything.items() if isinstance(kind, tuple)}
        numbers = sorted(name for name, kind in everything.items() if kind is float)
        while not 0.4 < seen_mm < 0.6 and time.monotonic() < until_s:
            deepest_mm = max(deepest_mm, robot.send_action(hand.get_action())["press.depth_mm"])
            seen = robot.get_observation()
            seen_mm = float(seen["gel_depth"].max()) * 1e3
            time.sleep(0.1)
    kinds = {name: [str(seen[name].dtype), *seen[name].shape] for name in features}
    observed = {name: seen[name] for name in numbers}
    return {"asked_mm": deepest_mm, "seen_mm": seen_mm, "features": features, "kinds": kinds, "numbers": observed,
            "broken": broken, "left": left}  # fmt: skip


def quantise(least_m: float, most_m: float, use_log: bool) -> dict[str, float]:
    """Return the largest error, micrometres, of depths from 0 to 2 mm through LeRobot's quantiser."""
    # The codec, which is lossless for depth and not needed here.
    sys.modules["av"] = MagicMock(__spec__=ModuleSpec("av", None), VideoFrame=type("VideoFrame", (), {}))
    import lerobot

    for name in ("configs", "datasets"):  # without their __init__, which load what only training needs
        folder = types.ModuleType(f"lerobot.{name}")
        folder.__path__ = [f"{lerobot.__path__[0]}/{name}"]
        sys.modules[folder.__name__] = folder
    from lerobot.datasets.depth_utils import dequantize_depth, quantize_depth

    depth_m = np.linspace(0, 2e-3, 10001, dtype=np.float32).reshape(1, -1)
    codes = quantize_depth(depth_m, least_m, most_m, use_log=use_log, video_backend=None)
    back_m = dequantize_depth(codes, least_m, most_m, use_log=use_log, output_unit="m", output_tensor=False)
    return {"worst_um": float(np.abs(back_m - depth_m).max()) * 1e6, "codes": len(np.unique(codes))}


def export(words: list[str]) -> None:
    for name in ("av", "torchvision", "torchvision.transforms", "torchvision.transforms.v2", "torchvision.io"):
        sys.modules[name] = MagicMock(__spec__=ModuleSpec(name, None), __path__=[])  # for videos, and for training
    sys.modules["lerobot.processor"] = MagicMock()
    import lerobot.utils.import_utils

    lerobot.utils.import_utils.require_package = lambda *_, **__: None
    from lerobot.configs import video

    video.RGBEncoderConfig.__post_init__ = video.DepthEncoderConfig.__post_init__ = lambda self: None
    from gellight.cli.main import app

    app(words, standalone_mode=False)


if __name__ == "__main__":
    match sys.argv[1]:
        case "camera":
            told: object = use_camera(sys.argv[2])
        case "press":
            told = press()
        case "export":
            export(sys.argv[1:])
            told = {}
        case _:
            told = quantise(float(sys.argv[2]), float(sys.argv[3]), sys.argv[4] == "true")
    print(json.dumps(told), flush=True)
