"""GelLight tactile sensors in LeRobot, which imports this package by its name and so learns its types.

camera.py   the camera `gellight`: image and depth of a daemon (`gellight run`)
press.py    the robot and teleoperator `gellight_press`: they press objects into a simulated gel
export.py   a recording as a dataset, for `gellight export --as lerobot`
"""

from lerobot_camera_gellight.camera import GelLightCamera, GelLightCameraConfig
from lerobot_camera_gellight.press import (
    GelLightPress,
    GelLightPressConfig,
    GelLightPressTeleop,
    GelLightPressTeleopConfig,
)

__all__ = [
    "GelLightCamera",
    "GelLightCameraConfig",
    "GelLightPress",
    "GelLightPressConfig",
    "GelLightPressTeleop",
    "GelLightPressTeleopConfig",
]
