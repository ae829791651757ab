"""What runs, as one value: `mode_config` makes it of a bundle and the settings, and touches no device.

Which camera stands in front, which frame path, whether frames are watched: all of it is decided here and
nowhere else. `SensorSession` puts such a value into effect as a whole, or not at all.
"""

from dataclasses import dataclass
from enum import Enum, auto
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, ConfigError, InputError
from gellight.base.settings import LightingSettings, ReconstructionSettings, Settings
from gellight.bundle.bundle import Bundle
from gellight.frames.picture import PictureSteps
from gellight.photometric.light_model import LightGroups, LightModel
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.lens.undistortion import FILE_NAME as LENS
from gellight.reconstruction.lens.undistortion import has_lens
from gellight.sensor.lighting.sequence_choice import chosen_groups
from gellight.sensor.lighting.sequenced import LightMode
from gellight.series.single_light_path import has_single_lights, read_directions

MODES = get_args(ReconstructionSettings.model_fields["mode"].annotation)
KINDS = {"rgb": LightGroups.TRIPLES, "single": LightGroups.SINGLES}
"""light groups that photometric stereo can use, by the name of their sequence"""


class PathKind(Enum):
    """The frame paths."""

    PICTURE = auto()
    """feels nothing: the sensor is not calibrated"""
    NETWORK = auto()
    """GelNet on every frame"""
    SEQUENCE = auto()
    """GelNet on the frames of a light sequence that were taken under the light it was trained for"""
    SERIES = auto()
    """photometric stereo on series of exposures"""
    SLIDING_WINDOW = auto()
    """photometric stereo on the newest frame of each light group"""
    OWN_LIGHTS = auto()
    """a bundle with light groups of its own, `directions.npz`"""


@dataclass(frozen=True, kw_only=True, eq=False)
class LightPlan:
    """The light that frames are taken under."""

    groups: NDArray[np.uint8] | None = None
    """(G, 12, 3) RGB, shown in turn; None: the light of the bundle all the time"""
    light_mode: LightMode = LightMode.HOLD
    joined: bool = False
    """whether frames under all groups make one result"""
    frames: int = 1
    """of each group, averaged, where the light stops at each"""
    model: LightModel | None = None
    """says how long single LEDs are exposed; None: the exposure stays as it is"""


STILL = LightPlan()


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeConfig:
    """All that runs."""

    bundle: Bundle
    """as it was installed: a zero that followed the light is not in it"""
    settings: Settings
    pictures: PictureSteps | None
    """what is done to each picture first"""
    light: LightPlan
    path: PathKind

    @property
    def watched(self) -> bool:
        """Whether the watch looks at the frames: it knows the one light that GelNet was trained for."""
        return self.settings.watch.enabled and self.path is PathKind.NETWORK


def mode_config(bundle: Bundle, settings: Settings) -> ModeConfig:
    """Return what runs with `bundle` as `settings` say.

    Raises BundleError where the bundle lacks what the mode needs, ConfigError where mode, light and bundle do not go
    together, InputError for a file of a light sequence that cannot be read.
    """
    path, light = _path_and_light(bundle, settings.reconstruction, settings.lighting)
    return ModeConfig(bundle=bundle, settings=settings, pictures=PictureSteps.in_bundle(bundle), light=light, path=path)


def in_mode(settings: Settings, mode: str) -> Settings:
    """Return the settings with another mode; InputError for one that is not known.

    A light mode that moves a sequence on is that of photometric mode, and means nothing in the others without one.
    """
    if mode not in MODES:
        raise InputError(f"there is no mode {mode!r}: choose one of {', '.join(MODES)}")
    reconstruction = settings.reconstruction.model_copy(update={"mode": mode})
    lighting = settings.lighting
    if mode != "photometric" and not lighting.sequence:
        lighting = lighting.model_copy(update={"light_mode": "hold"})
    return settings.model_copy(update={"reconstruction": reconstruction, "lighting": lighting})


def _path_and_light(
    bundle: Bundle, reconstruction: ReconstructionSettings, lighting: LightingSettings
) -> tuple[PathKind, LightPlan]:
    light_mode = LightMode(lighting.light_mode)
    if has_single_lights(bundle):
        return PathKind.OWN_LIGHTS, _own_lights(bundle, reconstruction, lighting)
    if reconstruction.mode == "photometric":
        light = _photometric_light(bundle, reconstruction, lighting)
        return (PathKind.SERIES if light_mode is LightMode.HOLD else PathKind.SLIDING_WINDOW), light
    if lighting.sequence:
        return PathKind.SEQUENCE, LightPlan(groups=_sequence_groups(bundle, lighting), light_mode=light_mode)
    if light_mode is not LightMode.HOLD:
        raise ConfigError(
            f"lighting.light_mode = {light_mode} moves a sequence on: set lighting.sequence, or reconstruction.mode = "
            "photometric"
        )
    return (PathKind.NETWORK if bundle.calibrated else PathKind.PICTURE), STILL


def _own_lights(bundle: Bundle, reconstruction: ReconstructionSettings, lighting: LightingSettings) -> LightPlan:
    if lighting.sequence:
        raise ConfigError(
            f"{bundle.source} has a light sequence of its own, lighting.sequence = {lighting.sequence} does not go "
            "with it: leave it out"
        )
    return LightPlan(
        groups=read_directions(bundle).groups,
        light_mode=LightMode(lighting.light_mode),
        joined=True,
        frames=reconstruction.frames_per_light,
    )


def _photometric_light(bundle: Bundle, reconstruction: ReconstructionSettings, lighting: LightingSettings) -> LightPlan:
    if has_lens(bundle):
        raise BundleError(
            f"{bundle.source} has {LENS}, and photometric mode measures in the distorted picture: use network mode, "
            "or the bundle without its lens"
        )
    model = read_lights(bundle)
    return LightPlan(
        groups=model.groups(photometric_groups(reconstruction, lighting)),
        light_mode=LightMode(lighting.light_mode),
        joined=True,
        frames=reconstruction.frames_per_light,
        model=model,
    )


def photometric_groups(reconstruction: ReconstructionSettings, lighting: LightingSettings) -> LightGroups:
    """Return the light groups of photometric stereo; ConfigError for a sequence that it cannot use."""
    if not lighting.sequence:
        return LightGroups(reconstruction.light_groups)
    if lighting.sequence not in KINDS:
        raise ConfigError(
            f"lighting.sequence = {lighting.sequence} does not go with photometric mode, which takes rgb or single: "
            "network mode takes any"
        )
    return KINDS[lighting.sequence]


def _sequence_groups(bundle: Bundle, lighting: LightingSettings) -> NDArray[np.uint8]:
    if bundle.colours is None:
        raise BundleError(f"{bundle.source} does not tell the colours of its LEDs, which a sequence needs: calibrate")
    return chosen_groups(lighting.sequence, bundle.colours)
