"""What the best angle depends on: the coarse study repeated with one thing changed.

Twenty-nine degrees is the answer for surfaces with slopes of some sixty degrees, not a law of nature.
"""

from dataclasses import dataclass, field, replace

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
    """Return the study as it is, and with light, press, relief, coating and wavelength changed in turn."""
    base = Variant("as it is", "", groups, sampling, ObjectParameters(), geometry)
    return [base, *_of_the_light(base), *_of_the_press(base), *_of_the_surface(base)]


def _of_the_light(base: Variant) -> list[Variant]:
    noise = [(f"{grey:g} grey levels", replace(base.groups, noise_grey=grey)) for grey in (0.0, 0.5, 2.0, 4.0, 8.0)]
    return [
        *(replace(base, quantity="noise", setting=setting, groups=groups) for setting, groups in noise),
        replace(base, quantity="cast shadows", setting="none", groups=replace(base.groups, cast_shadows=False)),
        replace(base, quantity="full scale", setting="160", groups=replace(base.groups, full_scale_grey=160.0)),
    ]


def _of_the_press(base: Variant) -> list[Variant]:
    def pressed(quantity: str, setting: str, depth_mm: float, relief_mm: float = 1.0) -> Variant:
        return replace(
            base,
            quantity=quantity,
            setting=setting,
            parameters=ObjectParameters(relief_mm=relief_mm),
            sampling=replace(base.sampling, press_depth_mm=depth_mm),
        )

    relief = [(height, 0.9 * height) for height in (0.5, 1.5)]
    return [
        *(pressed("press", f"{depth:g} mm", depth) for depth in (0.5, 0.7, 1.0)),
        *(pressed("relief", f"{height:g} mm, press {depth:g} mm", depth, height) for height, depth in relief),
    ]


def _of_the_surface(base: Variant) -> list[Variant]:
    coating = [(width, replace(base.geometry, coating_smoothing_mm=width)) for width in (0.0, 0.2, 0.3)]
    wave = ObjectParameters(wavelength_mm=3.5)
    return [
        *(replace(base, quantity="coating", setting=f"smooths {w:g} mm", geometry=sensor) for w, sensor in coating),
        replace(base, quantity="wavelength", setting="3.5 mm", parameters=wave),
    ]
