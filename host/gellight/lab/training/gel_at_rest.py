"""What the gel at rest really does, measured on the presses: far from its contact circle a press shows it."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from gellight.frames.pixel_grid import block_means
from gellight.lab.training.presses import Floats, Press, distance_px
from gellight.reconstruction.gelnet import CELL_PX, SQUARES_CELLS
from gellight.reconstruction.image_noise import RestChange
from gellight.reconstruction.light_drift import difference_of

_SIDES_PX = (CELL_PX, CELL_PX * SQUARES_CELLS[-1])
"""of the smallest and the largest squares whose means the mask sets limits on"""
_FAR_SHARE = 0.75
"""of the view is nearer to the press than what counts as at rest"""
_NEAREST = 2.0
"""in contact radii: no place nearer to the press counts as at rest"""
_LEAST_SQUARES = 5


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
