"""One real unit as a simulator: the gel and the picture that its calibration bundle tells of."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.bundle.bundle import Bundle
from gellight.lab.simulator.measured_light import MeasuredLight
from gellight.lab.simulator.shutter import SimulatedControls
from gellight.reconstruction.force_file import ForceRecord
from sim_reference.camera import CameraResponse
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry

GEL = ("gel_diameter_mm", "gel_thickness_mm", "poisson_ratio", "coating_smoothing_mm", "camera_height_mm")
"""what a user may say of the sensor better than its bundle does"""
_ITS_OWN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
"""crosstalk: what is drawn are the colours as the camera showed them"""


@dataclass(frozen=True, eq=False)
class Unit:
    """A bundle that was calibrated from presses."""

    bundle: Bundle

    @cached_property
    def light(self) -> MeasuredLight:
        """Its picture of a surface; raises BundleError as `MeasuredLight.of`."""
        return MeasuredLight.of(self.bundle)

    @cached_property
    def youngs_modulus_mpa(self) -> float:
        """Of the gel, from `force.json`; else that of the simulated gel."""
        force = ForceRecord.in_bundle(self.bundle)
        return FemGel.youngs_modulus_mpa if force is None else force.youngs_modulus_mpa

    def geometry(self, given: Mapping[str, float | int | str] | None = None) -> SensorGeometry:
        """Return gel, pixels and picture size; `given` says better of the gel what is in it, by the names of `GEL`.

        The thickness is that of `force.json`, else of the manifest, else of the simulated gel; nobody measured the
        coating. The gel reaches to the corners of the view, and is seen from the height that the bundle tells, else
        along parallel rays. Raises BundleError for pixels that are not square and InputError for a gel that cannot be.
        """
        (height, width), (x_mm, y_mm) = self.bundle.image_shape, self.bundle.pixel_size_mm
        if x_mm != y_mm:
            raise BundleError(
                f"{self.bundle.source} has pixels of {x_mm:g} x {y_mm:g} mm, only square ones can be drawn: take "
                "pictures with square pixels and calibrate again"
            )
        gel: dict[str, float] = {"gel_diameter_mm": x_mm * (height**2 + width**2) ** 0.5}
        if seen_mm := self.bundle.manifest.camera_height_mm:  # as it seems from within the gel: so through no window
            gel |= {"camera_height_mm": seen_mm, "perspective": True, "mounting_height_mm": 0.0}
        if self.bundle.manifest.gel_thickness_mm:
            gel["gel_thickness_mm"] = self.bundle.manifest.gel_thickness_mm
        if (force := ForceRecord.in_bundle(self.bundle)) is not None:
            gel |= {"gel_thickness_mm": force.gel_thickness_mm, "poisson_ratio": force.poisson_ratio}
        gel |= {name: float(value) for name, value in (given or {}).items() if name in GEL}
        try:
            return SensorGeometry(image_width_px=width, image_height_px=height, pixel_size_mm=x_mm, **gel)  # type: ignore[arg-type]
        except ValueError as error:
            raise InputError(f"the gel of {self.bundle.source} cannot be simulated: {error}") from None

    def response(self, noise_grey: float | None = None) -> CameraResponse:
        """Return the camera behind the measured light; noise: that of the bundle where not given, grey levels."""
        noise = self.bundle.manifest.noise_grey if noise_grey is None else noise_grey
        return CameraResponse(exposure=1.0, crosstalk=_ITS_OWN, noise_grey=noise)


class CalibratedControls(SimulatedControls):
    """Controls that stay as they were while the unit was calibrated: only so is its light known."""

    def __init__(self, values: Mapping[str, float]) -> None:
        """Keep the controls of a bundle, by name: each has the one value, twice, and no step."""
        self._values, self._ranges = dict(values), {name: (value, value, 0.0) for name, value in values.items()}

    def set(self, name: str, value: float) -> float:
        """Return the value where it is the calibrated one; CameraError for any other."""
        if value != self.read(name):
            raise CameraError(
                f"{name} = {value:g}: a drawn unit is known as it was calibrated, with {self._values[name]:g}; give a "
                "bundle that was calibrated with other controls"
            )
        return value
