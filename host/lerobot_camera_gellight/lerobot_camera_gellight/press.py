"""A robot that needs no hardware: it presses an object into the gel of a simulated sensor.

Its one joint is the depth of the press. The teleoperator moves it down and up, again and again. Together they record
episodes, see docs/lerobot.md.
"""

import math
import time
from dataclasses import dataclass, field
from typing import Any

from lerobot.cameras.configs import CameraConfig
from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.robots.config import RobotConfig
from lerobot.robots.robot import Robot
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

import gellight

DEPTH = "press.depth_mm"
"""the only joint"""


class _Uncalibrated:
    """What robot and teleoperator have in common: there is nothing to calibrate or to set."""

    is_calibrated = True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""


@RobotConfig.register_subclass("gellight_press")
@dataclass(kw_only=True)
class GelLightPressConfig(RobotConfig):
    """Which simulated sensor, what is pressed into it, and the cameras that see it."""

    sensor: str = "auto"
    """as `gellight.subscribe` takes it"""
    object: str = "BALL"
    """of the simulator, see `gellight simulate objects`"""
    cameras: dict[str, CameraConfig] = field(default_factory=dict)


class GelLightPress(_Uncalibrated, Robot):
    """Presses an object into a simulated gel; its state is the depth that was last asked for, mm."""

    config_class = GelLightPressConfig
    name = "gellight_press"

    def __init__(self, config: GelLightPressConfig) -> None:
        """Make the cameras."""
        super().__init__(config)
        self.config = config
        self.cameras = make_cameras_from_configs(config.cameras)
        self._hand: gellight.Subscription | None = None
        self._depth_mm = 0.0

    @property
    def observation_features(self) -> dict[str, Any]:
        """The joint, and for each camera its image, its depth and, where its bundle has a constant for it, the force.

        ConnectionError where the daemon of a camera does not run, which has to say whether it knows the force.
        """
        features: dict[str, Any] = {DEPTH: float}
        for name, camera in self.cameras.items():
            if getattr(camera, "use_rgb", True):
                features[name] = (camera.height, camera.width, 3)
            if getattr(camera, "use_depth", False):
                features[f"{name}_depth"] = (camera.height, camera.width, 1)
            if getattr(camera, "has_force", False):
                features[f"{name}.force_n"] = float
        return features

    @property
    def action_features(self) -> dict[str, Any]:
        """The joint."""
        return {DEPTH: float}

    @property
    def is_connected(self) -> bool:
        """Whether the gel and all cameras are there."""
        return self._hand is not None and all(camera.is_connected for camera in self.cameras.values())

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Subscribe to the sensor and open the cameras; ConnectionError where the gel is a real one."""
        try:
            hand = gellight.subscribe(self.config.sensor)
            try:
                hand.release()
            except gellight.GellightError:
                hand.close()
                raise
        except gellight.GellightError as error:
            raise ConnectionError(str(error)) from error
        self._hand = hand
        try:
            for camera in self.cameras.values():
                camera.connect()
        except BaseException:
            self.disconnect()  # or what was opened stays open, and a second try finds it so
            raise

    @check_if_not_connected
    def get_observation(self) -> dict[str, Any]:
        """Return the joint, and the newest image, depth and force of each camera."""
        observation: dict[str, Any] = {DEPTH: self._depth_mm}
        for name, camera in self.cameras.items():
            if getattr(camera, "use_rgb", True):
                observation[name] = camera.read_latest()
            if getattr(camera, "use_depth", False):
                observation[f"{name}_depth"] = camera.read_latest_depth()
            if getattr(camera, "has_force", False):
                observation[f"{name}.force_n"] = camera.read_latest_force()
        return observation

    @check_if_not_connected
    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Press as deep as the action says, mm; 0 lifts the object."""
        assert self._hand is not None
        depth_mm = float(action[DEPTH])
        if depth_mm != self._depth_mm:
            self._hand.press(self.config.object, depth_mm)
            self._depth_mm = depth_mm
        return {DEPTH: self._depth_mm}

    def disconnect(self) -> None:
        """Lift the object and close the cameras."""
        for camera in self.cameras.values():
            if camera.is_connected:
                camera.disconnect()
        hand, self._hand = self._hand, None
        if hand is not None:
            with hand:
                hand.release()


@TeleoperatorConfig.register_subclass("gellight_press")
@dataclass(kw_only=True)
class GelLightPressTeleopConfig(TeleoperatorConfig):
    """How deep and how often, in steps: the simulator takes a second or more for a depth that is new to it."""

    depth_mm: float = 1.0
    period_s: float = 20.0
    step_mm: float = 0.5


class GelLightPressTeleop(_Uncalibrated, Teleoperator):
    """Presses from 0 to a depth and back: depth * sin(pi * t / period)^2, rounded to steps."""

    config_class = GelLightPressTeleopConfig
    name = "gellight_press"

    def __init__(self, config: GelLightPressTeleopConfig) -> None:
        """Remember how deep."""
        super().__init__(config)
        self.config = config
        self._begun_s: float | None = None

    @property
    def action_features(self) -> dict[str, Any]:
        """The joint."""
        return {DEPTH: float}

    @property
    def feedback_features(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether its time runs."""
        return self._begun_s is not None

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Begin with no press."""
        self._begun_s = time.monotonic()

    @check_if_not_connected
    def get_action(self) -> dict[str, Any]:
        """Return the depth for now, mm."""
        assert self._begun_s is not None
        phase = math.pi * (time.monotonic() - self._begun_s) / self.config.period_s
        steps = round(self.config.depth_mm * math.sin(phase) ** 2 / self.config.step_mm)
        return {DEPTH: steps * self.config.step_mm}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: nobody holds it."""

    def disconnect(self) -> None:
        """Stop."""
        self._begun_s = None
