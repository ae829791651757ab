"""The elastic layer and the light of many presses at once by torch, on a GPU where there is one.

The equations are those of `sim_reference.gel` and `sim_reference.imaging`, which judge this file: pressures in double
precision, light in single.
"""

from collections.abc import Sequence
from math import ceil, isclose

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sim_reference.deformation import NotConverged
from sim_reference.gel import compliance
from sim_reference.geometry import SensorGeometry, led_axes, led_positions, pixel_grid
from sim_reference.imaging import SHADOW_PITCH_PX, SHADOW_TOLERANCE_MM, around, polar_grid
from sim_reference.surface import Surface


class NoGpuError(OSError):
    """There is no GPU that torch can use."""


def device_of(name: str) -> torch.device:
    """Return what computes: "torch" is the processor, "cuda" a GPU; NoGpuError where there is none."""
    if name == "cuda" and not torch.cuda.is_available():
        raise NoGpuError(f"torch {torch.__version__} finds no GPU (CUDA): compute with torch or numpy")
    return torch.device("cuda" if name == "cuda" else "cpu")


def name_of(device: torch.device) -> str:
    """Return the name of what computes, with the version of torch."""
    name = torch.cuda.get_device_name(device) if device.type == "cuda" else "processor"
    return f"{name}, torch {torch.__version__}"


# ---- the elastic layer ----


def contact_pressures(
    rest_gaps: NDArray[np.float64],
    spacing_mm: float,
    geometry: SensorGeometry,
    device: torch.device,
    *,
    tolerance: float = 1e-4,
    most: int = 500,
) -> NDArray[np.float64]:
    """Find the pressures of a batch, as `sim_reference.gel.contact_pressure` does of one.

    rest_gaps: (B, n, n) mm between the gel at rest and the object, negative where it penetrates. Returns (B, n, n) in
    units of the shear modulus. Each press ends when its own pressure changes by less than `tolerance` of its sum.
    Raises NotConverged after `most` iterations.
    """
    thickness_mm, size = geometry.gel_thickness_mm, rest_gaps.shape[-1]
    response = torch.as_tensor(compliance(size, spacing_mm, thickness_mm, geometry.poisson_ratio), device=device)
    gaps = torch.as_tensor(rest_gaps, device=device)
    found = torch.clamp(-gaps, min=0) / thickness_mm
    left = torch.nonzero(found.flatten(1).any(dim=1))[:, 0]
    search = _Search(found[left], gaps[left], response)
    for _ in range(most):
        if not len(left):
            return np.asarray(found.cpu().numpy())
        done = search.step() < tolerance
        found[left[done]] = search.pressure[done]
        left = left[~done]
        search.keep(~done)
    raise NotConverged(f"{len(left)} of {len(found)} presses did not converge in {most} iterations: use a coarser grid")


class _Search:
    """The conjugate gradients of Polonsky and Keer (Wear 231, 1999), for each press of a batch on its own."""

    def __init__(self, pressure: Tensor, rest_gap: Tensor, response: Tensor) -> None:
        self.pressure, self._rest_gap, self._response = pressure, rest_gap, response
        self._direction = torch.zeros_like(pressure)
        self._norm = torch.ones_like(pressure[:, :1, :1])
        self._conjugate, self._length = torch.zeros_like(self._norm), torch.zeros_like(self._norm)

    def keep(self, which: Tensor) -> None:
        """Go on with these presses alone."""
        if which.all():
            return
        for name in ("pressure", "_rest_gap", "_direction", "_norm", "_conjugate", "_length"):
            setattr(self, name, getattr(self, name)[which])

    def step(self) -> Tensor:
        """Take a step; return the change of each pressure, as a share of its sum."""
        gap = deflections(self.pressure, self._response) + self._rest_gap
        contact = self.pressure > 0
        norm = _total(gap**2, contact)
        exact = (norm == 0) & (gap.amin(dim=(1, 2), keepdim=True) >= 0)
        self._direction = torch.where(contact, gap + self._conjugate * norm / self._norm * self._direction, 0.0)
        self._norm = torch.where(norm > 0, norm, 1.0)
        change = deflections(self._direction, self._response)
        length = _total(gap * self._direction, contact) / _total(change * self._direction, contact)
        self._length = torch.where(norm > 0, length, self._length)
        updated = torch.clamp(self.pressure - self._length * self._direction, min=0)
        penetrating = (updated == 0) & (gap < 0) & ~contact
        updated = torch.where(penetrating, -self._length * gap, updated)
        updated = torch.where(exact, self.pressure, updated)
        self._conjugate = (~penetrating.flatten(1).any(dim=1)).to(gap.dtype)[:, None, None]
        moved = (updated - self.pressure).abs().sum(dim=(1, 2)) / updated.sum(dim=(1, 2))
        self.pressure = updated
        return moved


def deflections(pressures: Tensor, response: Tensor) -> Tensor:
    """Return the depths (B, n, n) in mm under `pressures` (B, n, n), `response` as `gel.compliance` gives it."""
    depths: Tensor = torch.fft.irfft2(torch.fft.rfft2(pressures) * response, s=pressures.shape[-2:])
    return depths


def _total(values: Tensor, where: Tensor) -> Tensor:
    return torch.where(where, values, 0.0).sum(dim=(1, 2), keepdim=True)


# ---- the light ----


class Ring:
    """The LEDs of a sensor, whose light on gel surfaces is found in batches."""

    def __init__(self, geometry: SensorGeometry, device: torch.device) -> None:
        """Keep what does not depend on the gel on the device."""
        self._geometry, self._device = geometry, device
        self._axes = tuple(axis.ravel() for axis in pixel_grid(geometry))
        x, y = (torch.as_tensor(axis, dtype=torch.float32, device=device) for axis in self._axes)
        self._x, self._y = x[None, None, :], y[None, :, None]
        self._places, self._directions = led_positions(geometry), led_axes(geometry)

    def irradiances(self, surfaces: Sequence[Surface], light: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return (B, K, H, W, 3) what `imaging.ring_irradiance` is of each surface under each of (K, N, 3) lights."""
        depth, slope, upright = (
            torch.as_tensor(np.stack([getattr(surface, name) for surface in surfaces]), device=self._device)
            for name in ("depth_mm", "gradient_map", "upright")
        )
        total = torch.zeros((len(depth), len(light), 3, *depth.shape[1:]), device=self._device)
        for led in np.flatnonzero(light.any(axis=(0, 2))):
            lit = self._irradiance(depth, slope, upright, int(led))
            for picture, channel in np.argwhere(light[:, led]):
                total[:, picture, channel] += lit * float(light[picture, led, channel])
        return np.asarray(torch.movedim(total, 2, 4).contiguous().cpu().numpy())

    def _irradiance(self, depth: Tensor, slope: Tensor, upright: Tensor, led: int) -> Tensor:
        """(B, H, W) equation 3 for one LED, with attached and cast shadows."""
        led_x, led_y, led_z = self._places[led].tolist()
        axis_x, axis_y, axis_z = self._directions[led].tolist()
        to_x, to_y, to_z = led_x - self._x, led_y - self._y, led_z - depth
        squared = to_x**2 + to_y**2 + to_z**2
        facing = to_z - slope[..., 0] * to_x - slope[..., 1] * to_y
        leaving = torch.clamp(-(to_x * axis_x + to_y * axis_y + to_z * axis_z), min=0)
        lit: Tensor = led_z**2 * upright * torch.clamp(facing, min=0)
        exponent = self._geometry.emission_exponent
        if isclose(exponent, 1):
            lit *= leaving / squared**2
        else:
            lit *= (leaving / torch.sqrt(squared)) ** exponent / squared**1.5
        height = depth.amax(dim=(1, 2)) - depth.amin(dim=(1, 2))
        reaches = (height * torch.sqrt(squared.amax(dim=(1, 2))) / led_z).tolist()
        for press in torch.nonzero(facing.amin(dim=(1, 2)) < 0)[:, 0].tolist():
            self._cast_shadows(lit[press], depth[press], facing[press] < 0, reaches[press], led)
        return lit

    def _cast_shadows(self, lit: Tensor, depth: Tensor, turned: Tensor, reach_mm: float, led: int) -> None:
        """Darken (H, W) light where something nearer to the LED stands above the line to it; see `visibility`."""
        margin = ceil(reach_mm / self._geometry.pixel_size_mm)
        marked = np.outer(turned.any(dim=1).cpu().numpy(), turned.any(dim=0).cpu().numpy())
        rows, columns = around(marked, margin)
        lit[rows, columns] *= self._visibility(depth[rows, columns], rows, columns, led)

    def _visibility(self, depth: Tensor, rows: slice, columns: slice, led: int) -> Tensor:
        """(h, w) share of each pixel that sees the LED, as `imaging.visibility` finds it."""
        x, y = self._axes[0][columns], self._axes[1][rows]
        place = self._places[led]
        spacing = (x[-1] - x[0]) / (len(x) - 1)
        found = polar_grid(x, y, place, SHADOW_PITCH_PX * spacing)
        radius, angle = (torch.as_tensor(axis, device=self._device) for axis in found)
        across = (place[0] + radius * torch.cos(angle)[:, None] - x[0]) / spacing
        down = (place[1] + radius * torch.sin(angle)[:, None] - y[0]) / spacing
        slope = (place[2] - _sampled(depth, down, across)) / radius
        nearest = torch.cummin(slope, dim=1).values
        seen = ((slope - nearest) * radius <= SHADOW_TOLERANCE_MM).to(torch.float32)
        away = [torch.as_tensor(axis, device=self._device) for axis in (x - place[0], y - place[1])]
        at_radius = (torch.hypot(away[0][None, :], away[1][:, None]) - radius[0]) / (radius[1] - radius[0])
        turned = torch.remainder(torch.atan2(away[1][:, None], away[0][None, :]) - angle[0], 2 * np.pi)
        return _sampled(seen, turned / (angle[1] - angle[0]), at_radius).to(torch.float32)


def _sampled(image: Tensor, rows: Tensor, columns: Tensor) -> Tensor:
    """Return the image between its pixels, bilinear, double; beyond its edge what is at the edge."""
    height, width = image.shape
    rows, columns = rows.clamp(0, height - 1), columns.clamp(0, width - 1)
    row, column = rows.long().clamp(max=max(height - 2, 0)), columns.long().clamp(max=max(width - 2, 0))
    down, across = rows - row, columns - column
    below, beside = (row + 1).clamp(max=height - 1), (column + 1).clamp(max=width - 1)
    values = image.to(torch.float64)
    upper = values[row, column] * (1 - across) + values[row, beside] * across
    lower = values[below, column] * (1 - across) + values[below, beside] * across
    return upper * (1 - down) + lower * down
