"""What runs, as one value: `mode_config` makes it of a bundle and the settings, and touches no device.

Which camera stands in front, which frame path, whether frames are watched and judged: all of it is decided here and
nowhere else. `SensorSession` puts such a value into effect as a whole, or not at all.
"""

from dataclasses import dataclass
from enum import Enum, auto
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.base.settings import ReconstructionSettings, Settings
from gellight.bundle.bundle import Bundle
from gellight.frames.picture import PictureSteps, steps_of
from gellight.photometric.light_model import LightGroups, LightModel
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.lens.undistortion import FILE_NAME as LENS
from gellight.reconstruction.lens.undistortion import has_lens
from gellight.series.single_light_path import has_single_lights, read_directions

MODES = get_args(ReconstructionSettings.model_fields["mode"].annotation)


class PathKind(Enum):
    """The frame paths."""

    PICTURE = auto()
    """feels nothing: the sensor is not calibrated"""
    NETWORK = auto()
    """GelNet on every frame"""
    SERIES = auto()
    """photometric stereo on series of exposures"""
    OWN_LIGHTS = auto()
    """a bundle with light groups of its own, `directions.npz`"""


@dataclass(frozen=True, kw_only=True, eq=False)
class LightPlan:
    """The light that frames are taken under."""

    groups: NDArray[np.uint8] | None = None
    """(G, 12, 3) RGB, shown in turn for one result; None: the light of the bundle all the time"""
    frames: int = 1
    """of each group, averaged"""
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

    @property
    def judged(self) -> bool:
        """Whether every frame has a depth that a truth can be held against."""
        return self.path is not PathKind.PICTURE


def mode_config(bundle: Bundle, settings: Settings) -> ModeConfig:
    """Return what runs with `bundle` as `settings` say.

    Raises BundleError where the bundle lacks what the mode needs.
    """
    path, light = _path_and_light(bundle, settings.reconstruction)
    return ModeConfig(bundle=bundle, settings=settings, pictures=steps_of(bundle), light=light, path=path)


def in_mode(settings: Settings, mode: str) -> Settings:
    """Return the settings with another mode; InputError for one that is not known."""
    if mode not in MODES:
        raise InputError(f"there is no mode {mode!r}: choose one of {', '.join(MODES)}")
    reconstruction = settings.reconstruction.model_copy(update={"mode": mode})
    return settings.model_copy(update={"reconstruction": reconstruction})


def _path_and_light(bundle: Bundle, reconstruction: ReconstructionSettings) -> tuple[PathKind, LightPlan]:
    frames = reconstruction.frames_per_light
    if has_single_lights(bundle):
        return PathKind.OWN_LIGHTS, LightPlan(groups=read_directions(bundle).groups, frames=frames)
    if reconstruction.mode == "photometric":
        if has_lens(bundle):
            raise BundleError(
                f"{bundle.source} has {LENS}, and photometric mode measures in the distorted picture: use network "
                "mode, or the bundle without its lens"
            )
        model = read_lights(bundle)
        groups = model.groups(LightGroups(reconstruction.light_groups))
        return PathKind.SERIES, LightPlan(groups=groups, frames=frames, model=model)
    return (PathKind.NETWORK if bundle.calibrated else PathKind.PICTURE), STILL
