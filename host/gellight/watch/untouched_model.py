"""What light and place can do to the picture of the untouched gel, and which cells show something else.

A change of the cell means is fitted by a combination of

- the reference in each channel: a gain of the light or of the camera;
- the light of each LED (`light.py`); where LEDs are not known, the reference times a polynomial of the position;
- the derivatives of the reference along x and y: a camera that has moved by a fraction of a pixel.

Cells that the fit leaves are outliers, and the fit is repeated without them. A touch makes slopes that no light can
make: a ball pressed 0.03 mm deep shows, and adds next to nothing to the fit.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.reconstruction.image_noise import REST_TIMES, RestChange
from gellight.watch.cells import CELL_PX, Cells, cell_means, positions_mm
from gellight.watch.light import RingLight, fit_ring_light

Mask = NDArray[np.bool_]
"""(h, w)"""

OUTLIER_NOISES = 6.0
"""a cell beyond this multiple of its noise, and beyond what the gel at rest differs by, is an outlier"""
OUTLIER_SHARE = 0.12
"""and beyond this share of the largest change fitted: the light model is good to 8 % of a dead LED"""
_ROUNDS = 3  # chosen: of leaving out what the one before finds to be no light
_EVERY = 2
"""the fit takes every second cell of every second row"""
_RIDGE = 1e-6
"""of the mean square of a column: keeps columns that resemble each other from running away"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """A change of the picture, taken apart."""

    fitted: Cells
    """(h, w, 3) grey levels that light and place explain"""
    outliers: Mask
    """(h, w) cells that show something else"""


class UntouchedModel:
    """The untouched sensor as it was calibrated."""

    def __init__(self, bundle: Bundle) -> None:
        """Learn from the reference image of a bundle; what takes a fraction of a second is found when first needed."""
        self._bundle = bundle
        self.reference: Cells = cell_means(bundle.reference)
        self.at_rest = RestChange(bundle.manifest.noise_grey, bundle.manifest.rest_grey)
        self.noise_grey = self.at_rest.pixel_grey / CELL_PX
        """standard deviation of the mean of one cell"""
        self._channels: list[Cells] = [self.reference * channel for channel in np.eye(3, dtype=np.float32)]
        self.shifts: list[Cells] = [-np.asarray(np.gradient(self.reference, CELL_PX, axis=axis)) for axis in (1, 0)]
        """change of the picture when its content moves right, down by one pixel"""

    @cached_property
    def ring(self) -> RingLight | None:
        """The light of the ring; None where LEDs are not known."""
        return fit_ring_light(self._bundle)

    @cached_property
    def gains(self) -> list[Cells]:
        """What a gain of each channel of the camera adds, and of each colour of the light where LEDs are known."""
        if self.ring is None:
            return self._channels
        colours = np.array([led.rgb for led in self._bundle.manifest.led]).argmax(axis=1)
        return self._channels + [self.ring.fields[colours == q].sum(axis=0) for q in np.unique(colours)]

    @cached_property
    def pressed(self) -> list[Cells]:
        """Change of the picture when a plate presses the whole gel 1 mm deep, and 1 mm deeper right, at the bottom."""
        return [] if self.ring is None else _pressed(self.ring.nearer)

    @cached_property
    def _columns(self) -> NDArray[np.float32]:
        all_columns = [*self._channels, *self.shifts, *self._light_columns()]
        columns = [column for column in all_columns if column.any()]  # a dark channel, or an even picture that moves
        return np.stack([column / np.sqrt((column**2).mean()) for column in columns], axis=-1)

    @cached_property
    def _some(self) -> NDArray[np.float32]:
        return np.ascontiguousarray(self._columns[::_EVERY, ::_EVERY])

    def _light_columns(self) -> list[Cells]:
        if self.ring is not None:
            return list(self.ring.fields)
        x, y = positions_mm(self._bundle.image_shape, self._bundle.pixel_size_mm)
        x, y = x / np.abs(x).max(), y / np.abs(y).max()
        shapes = [x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3]
        return [gain * shape[..., None].astype(np.float32) for gain in self._channels for shape in shapes]

    def judge(self, change: Cells, *, noise_grey: float | None = None) -> Rest:
        """Take a (h, w, 3) change of the cell means apart; `noise_grey` of a cell, if it is known better."""
        noise = self.noise_grey if noise_grey is None else noise_grey
        outliers = np.zeros(change.shape[:2], np.bool_)
        for _ in range(_ROUNDS):
            fitted = self._fit(change, ~outliers)
            least = float(np.hypot(OUTLIER_NOISES * noise, REST_TIMES * self.at_rest.rest_grey))
            limit = least + OUTLIER_SHARE * float(np.abs(fitted).max())
            found = (np.abs(change - fitted) > limit).any(axis=2)
            if (found == outliers).all():
                break
            outliers = found
        return Rest(fitted=fitted, outliers=outliers)

    def _fit(self, change: Cells, kept: Mask) -> Cells:
        chosen = kept[::_EVERY, ::_EVERY]
        count = self._columns.shape[-1]
        if 3 * chosen.sum() < 2 * count:
            return np.zeros_like(change)
        rows = self._some[chosen].reshape(-1, count)
        values = change[::_EVERY, ::_EVERY][chosen].ravel()
        # By einsum, not by `@`: threads of BLAS spin between two looks, and take half a core.
        normal = np.einsum("ni,nj->ij", rows, rows) + _RIDGE * len(rows) * np.eye(count, dtype=np.float32)
        weights = np.linalg.solve(normal.astype(np.float64), np.einsum("ni,n->i", rows, values).astype(np.float64))
        return np.asarray(np.einsum("hwci,i->hwc", self._columns, weights.astype(np.float32)))


def _pressed(nearer: Cells) -> list[Cells]:
    height, width = nearer.shape[:2]
    down, right = np.linspace(-1, 1, height, dtype=np.float32), np.linspace(-1, 1, width, dtype=np.float32)
    return [nearer, nearer * right[None, :, None], nearer * down[:, None, None]]
