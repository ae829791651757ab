"""What the best angle depends on: the coarse study repeated with one thing changed.

Twenty-nine degrees is the answer for surfaces with slopes of some sixty degrees, not a law of nature.
"""

from dataclasses import dataclass, field, replace
from math import degrees

from sim_reference.geometry import SensorGeometry
from sim_reference.objects import ObjectParameters
from sim_reference.optimizer.benchmark import Sampling
from sim_reference.optimizer.coarse import CHOSEN_NUMBER
from sim_reference.optimizer.exposing import LightGroups

STUDIED = LightGroups(numbers=(CHOSEN_NUMBER,))
COARSE = Sampling(size_px=128)


@dataclass(frozen=True)
class Variant:
    """The study with one thing changed."""

    quantity: str
    setting: str
    groups: LightGroups = STUDIED
    sampling: Sampling = COARSE
    parameters: ObjectParameters = field(default_factory=ObjectParameters)
    geometry: SensorGeometry = field(default_factory=SensorGeometry)


def variants(geometry: SensorGeometry, groups: LightGroups = STUDIED, sampling: Sampling = COARSE) -> list[Variant]:
    """Return the study as it is, and with noise, shadows, press, relief, coating and wavelength changed in turn."""
    base = Variant("as it is", "", groups, sampling, ObjectParameters(), geometry)
    noise = [
        replace(base, quantity="noise", setting=f"{grey:g} grey levels", groups=replace(groups, noise_grey=grey))
        for grey in (0.0, 0.5, 2.0, 4.0, 8.0)
    ]
    shadows = replace(base, quantity="cast shadows", setting="none", groups=replace(groups, cast_shadows=False))
    exposure = replace(base, quantity="full scale", setting="160", groups=replace(groups, full_scale_grey=160.0))
    press = [
        replace(base, quantity="press", setting=f"{depth:g} mm", sampling=replace(sampling, press_depth_mm=depth))
        for depth in (0.5, 0.7, 1.0)
    ]
    relief = [
        replace(
            base,
            quantity="relief",
            setting=f"{height:g} mm, press {0.9 * height:g} mm",
            parameters=ObjectParameters(relief_mm=height),
            sampling=replace(sampling, press_depth_mm=0.9 * height),
        )
        for height in (0.5, 1.5)
    ]
    coating = [
        replace(
            base,
            quantity="coating",
            setting=f"smooths {width:g} mm",
            geometry=replace(geometry, coating_smoothing_mm=width),
        )
        for width in (0.0, 0.2, 0.3)
    ]
    wave = replace(base, quantity="wavelength", setting="3.5 mm", parameters=ObjectParameters(wavelength_mm=3.5))
    return [base, *noise, shadows, exposure, *press, *relief, *coating, wave]


def in_words(variant: Variant, best_rad: float, mean_rad: float) -> str:
    """Return one line on a variant, angles in degrees."""
    return f"{variant.quantity} {variant.setting}: {degrees(best_rad):.0f}, mean of objects {degrees(mean_rad):.1f}"
