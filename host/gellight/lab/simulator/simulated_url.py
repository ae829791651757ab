"""The parameters of a `sim://` URL; the top of `simulated_camera.py` says what they mean."""

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from gellight.base.errors import InputError
from gellight.bundle.bundle import SYNTHETIC, load_bundle
from gellight.lab.core_board.simulated_board import COLDEST_C, HOTTEST_C
from gellight.lab.simulator.printed_dots import PrintedDots
from gellight.lab.simulator.scene import Array, Printed
from gellight.lab.simulator.unit import Unit
from sim_reference.camera import CameraResponse

OF_A_RING = "board", "strobe", "ring_c", "crosstalk", "led_spread", "dim", "camera", "window"
"""parameters of simulated light, which a real unit's measured light is not"""


class SimulatedUrl(BaseModel):
    """The parameters of a `sim://` URL."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False)

    fps: float = Field(30.0, gt=0, le=1000)
    seed: int = Field(0, ge=0)
    noise: float = Field(1.0, ge=0, le=50)
    object_name: str = Field("", alias="object")
    depth: float = Field(0.0, ge=0)
    x: float = 0.0
    y: float = 0.0
    programme: bool = True
    board: bool = True
    strobe: bool = False
    ring_c: float | None = Field(None, ge=COLDEST_C, le=HOTTEST_C)
    crosstalk: float = Field(0.1, ge=0, le=0.5)
    led_spread: float = Field(0.0, ge=0, le=0.5)
    dim: float = Field(0.0, ge=0, le=0.9)
    bundle: str = Field("", min_length=1)
    camera: Literal["parallel", "pinhole"] | None = None
    window: Literal["none", "acrylic"] | None = None
    sequence: str = ""
    dots: str = Field(
        "", pattern=r"^(\d{1,2}x\d{1,2})?$", json_schema_extra={"allowed": "columns x rows, such as `9x7`"}
    )
    dot_pitch: float = Field(2.0, ge=0.5, le=10)
    dot_diameter: float = Field(0.6, ge=0.1, le=5)
    dot_albedo: float = Field(0.35, ge=0, le=1)
    dots_missing: float = Field(0.0, ge=0, lt=1)
    friction: float = Field(0.6, gt=0, le=5)

    def optics(self) -> dict[str, bool]:
        """Return what is said of how the sensor is seen and lit, by the names of `SensorGeometry`."""
        seen = {} if self.camera is None else {"perspective": self.camera == "pinhole"}
        return seen if self.window is None else {**seen, "window": self.window == "acrylic"}

    def printed(self) -> Printed | None:
        """Return the dots on the gel and its friction, None where it has none; InputError for dots that overlap."""
        if not self.dots:
            return None
        columns, rows = map(int, self.dots.split("x"))
        if not (columns and rows and self.dot_diameter < self.dot_pitch):
            raise InputError(
                f"dots={self.dots} of {self.dot_diameter:g} mm, {self.dot_pitch:g} mm apart, cannot be printed: give "
                "columns x rows, and dots narrower than dot_pitch"
            )
        dots = PrintedDots(columns=columns, rows=rows, pitch_mm=self.dot_pitch, diameter_mm=self.dot_diameter,
                           albedo=self.dot_albedo, missing=self.dots_missing, seed=self.seed)  # fmt: skip
        return Printed(dots=dots, friction=self.friction)

    def unit(self) -> Unit | None:
        """Return the real unit that is drawn; InputError for parameters that only a ring has, BundleError as `Unit`."""
        if not self.bundle:
            return None
        not_its = [name for name in OF_A_RING if name in self.model_fields_set and getattr(self, name)]
        if not_its:
            raise InputError(
                f"bundle={self.bundle} draws light as it was measured on a real unit: leave out {', '.join(not_its)}"
            )
        if self.bundle == SYNTHETIC:
            raise InputError(
                "bundle=synthetic is of the simulated sensor, no real unit: leave it out, or give the bundle of a "
                "calibrated sensor"
            )
        return Unit(load_bundle(self.bundle))

    def response(self) -> CameraResponse:
        """Return the camera: the colours pass its filters in the proportions of the plain camera's crosstalk."""
        plain = CameraResponse(noise_grey=self.noise)
        others = np.array(plain.crosstalk) * (1 - np.eye(3)) * (self.crosstalk / 0.1)
        own = np.diag(1 - others.sum(axis=1))
        rows = (others + own).tolist() if self.crosstalk != 0.1 else plain.crosstalk
        return replace(plain, crosstalk=tuple(tuple(row) for row in rows))

    def led_gain(self, count: int) -> Array:
        """Return (count,) brightness of each LED as a share of the nominal: dimmed, and spread as the seed says."""
        spread = self.led_spread * np.random.default_rng([self.seed, 2]).standard_normal(count)
        return np.asarray((1 - self.dim) * np.maximum(1 + spread, 0.0))
