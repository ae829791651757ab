"""The table that GelNet is trained on: labelled pixels of presses, their colours and the slopes that the ball gives.

And what the gel at rest really does, measured on the presses: far from its contact circle a press shows it.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.pixel_grid import block_means
from gellight.lab.training.presses import Ball, Floats, Press, distance_px, on_ball, sphere_gradient
from gellight.reconstruction.gelnet import CELL_PX, SQUARES_CELLS
from gellight.reconstruction.image_noise import RestChange
from gellight.reconstruction.light_drift import difference_of, light_drift

COLOURS = 3  # of a camera's picture
LIKE_UNIT = "like_"
"""before the names of the arrays of a like unit's presses"""
DARKEST_GREY = 20.0
"""below which a ratio of two units' light says nothing"""
RIM = 0.9
"""of the contact radius: beyond it, within a circle that was drawn by hand, the gel has left the ball already"""
_SIDES_PX = (CELL_PX, CELL_PX * SQUARES_CELLS[-1])
"""of the smallest and the largest squares whose means the mask sets limits on"""
_FAR_SHARE = 0.75
"""of the view is nearer to the press than what counts as at rest"""
_NEAREST = 2.0
"""in contact radii: no place nearer to the press counts as at rest"""
_LEAST_SQUARES = 5  # chosen: a press that leaves fewer means at rest is left out


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Which pixels of a press are trained on."""

    inset_px: float = 1.0
    """the outermost ring of the contact circle is left out: there a label that is a pixel off is wrong most"""
    rim_share: float = 1.0
    """of the pixels beyond `RIM` of a contact radius that a hand may have drawn, how many are trained on"""
    flat_share: float = 0.0
    """untouched pixels, as a share of the contact pixels, with gradient 0"""
    flat_distance: float = 3.0
    """in contact radii from the centre: where the gel counts as untouched; nearer it still slopes"""


@dataclass(frozen=True, kw_only=True, eq=False)
class PressTable:
    """Labelled pixels of several presses."""

    rows: Floats
    """(N, C + 4) change of each channel, x, y in px, d(depth)/dx, d(depth)/dy; the channels are dR, dG, dB in grey
    levels, or those of `series.single_light_path`"""
    image: NDArray[np.int32]
    """(N,) number of the image each row comes from, see `images_of`"""
    image_size: tuple[int, int]
    """(W, H) px"""
    depth_mm: Floats | None = None
    """(N,) how deep the gel lies there, as far as a picture of a press tells; None where nobody knows"""

    @classmethod
    def of(cls, bundle: Bundle, kind: str = "") -> Self:
        """Return the table that a bundle was trained on; BundleError where it keeps none.

        kind: `LIKE_UNIT`, the presses of a like unit that it began with, under its own light.
        """
        arrays = bundle.presses()
        if kind + "rows" not in arrays:
            raise BundleError(f"{bundle.source} does not keep all presses that it learnt from: calibrate it again")
        width, height = (int(size) for size in arrays["image_size"])
        rows, image, depth_mm = arrays[kind + "rows"], arrays[kind + "image"], arrays.get(kind + "depth_mm")
        return cls(rows=rows, image=image, image_size=(width, height), depth_mm=depth_mm)

    def arrays(self, like: Self | None = None) -> dict[str, NDArray[np.generic]]:
        """Return the arrays as they are stored in an npz file; like: presses of a like unit, stored beside."""
        more = {} if like is None else {LIKE_UNIT + name: array for name, array in like.arrays().items()}
        more.pop(LIKE_UNIT + "image_size", None)
        depth = {} if self.depth_mm is None else {"depth_mm": self.depth_mm}
        return {
            "rows": self.rows,
            "image": self.image,
            "image_size": np.array(self.image_size, np.int32),
            **depth,
            **more,
        }

    @classmethod
    def joined(cls, parts: Sequence[Floats], images: NDArray[np.int32], image_shape: tuple[int, int]) -> Self:
        """Join the rows of several presses; images: (n,) the number of the image of each, image_shape (H, W)."""
        numbers = np.repeat(images, [len(part) for part in parts])
        return cls(rows=np.concatenate(parts), image=numbers, image_size=(image_shape[1], image_shape[0]))


def build_table(
    presses: Sequence[Press], reference: Floats, ball: Ball, options: TableOptions, *, follow_light: bool = False
) -> PressTable:
    """Build the table of all presses; reference is the (H, W, 3) image of the untouched gel, grey levels.

    With `follow_light` the drift of the light is taken off each difference image, as the frame path then does.
    """
    random = np.random.default_rng(0)
    parts = []
    for press in presses:
        difference = difference_of(press.picture(), reference, follow_light=follow_light)
        together = [other for other in presses if other.image == press.image]
        parts.append(labelled_rows(press, together, difference, ball, options, random))
    shape = (reference.shape[0], reference.shape[1])
    table = PressTable.joined(parts, images_of(presses), shape)
    depths = [_depth_mm(press, ball, shape, part) for press, part in zip(presses, parts, strict=True)]
    return replace(table, depth_mm=np.concatenate(depths))


def labelled_rows(
    press: Press, together: Sequence[Press], change: Floats, ball: Ball, options: TableOptions,
    random: np.random.Generator,
) -> Floats:  # fmt: skip
    """Return the rows of one press, as `PressTable` keeps them; change: (H, W, C) of each channel.

    together: all presses in the same picture; flat are pixels that are far from each of them. InputError where no
    pixel of the contact is left.
    """
    shape = (change.shape[0], change.shape[1])
    distance, hidden = distance_px(press, shape), press.hidden()
    if hidden is not None:
        distance[hidden] = np.nan  # neither in contact nor flat: what is filled in was not seen
    contact = np.flatnonzero(distance < press.contact_radius_px - options.inset_px)
    if not len(contact):
        raise InputError(
            f"{press.image}: no pixel is left of a contact circle of {press.contact_radius_px:g} px after an inset "
            f"of {options.inset_px:g} px: press deeper or remove the line"
        )
    if options.rim_share < 1 and not press.found:
        rim = distance.ravel()[contact] > RIM * press.contact_radius_px
        contact = contact[~rim | (random.random(len(contact)) < options.rim_share)]
    away = [distance_px(one, shape) > options.flat_distance * one.contact_radius_px for one in together]
    far = np.flatnonzero(np.all([np.isfinite(distance), *away], axis=0))
    flat = random.choice(far, min(len(far), round(options.flat_share * len(contact))), replace=False)
    chosen = np.concatenate([contact, flat])
    places = np.stack([chosen % shape[1], chosen // shape[1]], axis=1)
    slopes = np.zeros((len(chosen), 2))
    slopes[: len(contact)] = sphere_gradient(press, ball, shape, contact)
    return np.concatenate([change.reshape(-1, change.shape[2])[chosen], places, slopes], axis=1, dtype=np.float32)


def _depth_mm(press: Press, ball: Ball, image_shape: tuple[int, int], rows: Floats) -> Floats:
    """(n,) how deep the gel lies at the rows of a press: the cap of the ball, its rim by `SUNKEN`; 0 beside it."""
    x, y = rows[:, -4:-2].T.astype(np.float64)
    seen = on_ball(press, ball, image_shape, x, y)
    depth_px = np.where(seen.up > seen.rim, seen.up - seen.rim + seen.sunken, 0)
    return (depth_px * ball.pixel_size_mm).astype(np.float32)


def images_of(presses: Sequence[Press]) -> NDArray[np.int32]:
    """Number the image of each press, (N,): what is trained on and what is judged are divided by it.

    Where all presses are in one image, as with a plate of balls, each press counts as an image.
    """
    numbers = {image: number for number, image in enumerate(dict.fromkeys(press.image for press in presses))}
    if len(numbers) == 1:
        return np.arange(len(presses), dtype=np.int32)
    return np.array([numbers[press.image] for press in presses], np.int32)


def drift_of_presses(presses: Sequence[Press], reference: Floats) -> float:
    """Return how far the light of the presses is from the reference's, grey levels: root mean square.

    Raises InputError for a press whose light is farther off than can be taken out.
    """
    drifts = [light_drift(press.picture(), reference) for press in presses]
    for press, drift in zip(presses, drifts, strict=True):
        if drift.refusal:
            raise InputError(f"{press.image}: {drift.refusal}")
    return float(np.sqrt(np.mean([drift.grey(reference) ** 2 for drift in drifts])))


def table_of_like(bundle: Bundle, image_shape: tuple[int, int]) -> PressTable:
    """Return the presses that the bundle of a like unit was trained on; image_shape: (H, W) of this unit's pictures.

    Raises BundleError for a bundle that keeps no presses, InputError for pictures of another size and for channels that
    are not red, green and blue.
    """
    table, size = PressTable.of(bundle), image_shape[::-1]
    if table.image_size != size or table.rows.shape[1] != COLOURS + 4:
        raise InputError(
            f"{bundle.source} learnt from {table.rows.shape[1] - 4} channels of {table.image_size[0]} x "
            f"{table.image_size[1]} px, this unit has {COLOURS} of {size[0]} x {size[1]} px: it is no like unit"
        )
    return table


def under_light_of(bundle: Bundle, untouched: Floats) -> PressTable:
    """Return the presses of a like unit, each pixel as bright as this unit's untouched gel, (H, W, 3), has it.

    Raises as `table_of_like`.
    """
    table = table_of_like(bundle, (untouched.shape[0], untouched.shape[1]))
    x, y = table.rows[:, COLOURS : COLOURS + 2].astype(np.intp).T
    rows = table.rows.copy()
    rows[:, :COLOURS] *= np.maximum(untouched[y, x], DARKEST_GREY) / np.maximum(bundle.reference[y, x], DARKEST_GREY)
    return replace(table, rows=rows)


def rest_of_presses(presses: Sequence[Press], reference: Floats, *, noise_grey: float, follow_light: bool) -> float:
    """Return by how much the gel at rest differs from the (H, W, 3) reference beyond noise, rms of the worst channel.

    Looked at is the quarter of each view that is farthest from the press, and no place nearer than 2 contact radii; of
    the means over 4 x 4 and 12 x 12 pixels those that differ more. The figure is the median over the presses, so a
    second touch in one of them does no harm. With `follow_light` the drift of the light is taken off first, as the
    frame path then does. Presses that share an image do not count. Returns 0 where no press leaves enough of the view.
    """
    in_image = Counter(press.image for press in presses)
    alone = [press for press in presses if in_image[press.image] == 1]
    seen = [squares for press in alone if (squares := _squares(press, reference, follow_light)) is not None]
    if not seen:
        return 0.0
    noise = RestChange(noise_grey).pixel_grey / np.array(_SIDES_PX)
    beyond = np.median(seen, axis=0).max(axis=1) - noise**2
    return float(np.sqrt(max(0.0, beyond.max())))


def _squares(press: Press, reference: Floats, follow_light: bool) -> Floats | None:
    """(2, 3) mean square of the change of both means where a press leaves the gel at rest; None where it does not."""
    difference = difference_of(press.picture(), reference, follow_light=follow_light)
    distance = distance_px(press, (reference.shape[0], reference.shape[1]))
    nearest = max(float(np.quantile(distance, _FAR_SHARE)), _NEAREST * press.contact_radius_px)
    squares = []
    for side in _SIDES_PX:
        far = block_means(distance, side) > nearest
        if far.sum() < _LEAST_SQUARES:
            return None
        squares.append((block_means(difference, side)[far] ** 2).mean(axis=0))
    return np.stack(squares)
