"""A bundle that keeps presses whose colours are known: cubic in the normal, uneven over the view."""

from pathlib import Path

import numpy as np

from gellight.bundle.bundle import Bundle, write_bundle
from tests.helpers.linear_sensor import GREY_PER_SLOPE, linear_network, reference_image

SHAPE = (60, 80)
PIXEL_MM = 0.2
BALL_PX, CONTACT_PX = 10.0, 8.0
NOISE_GREY = 0.8


def true_change(across: np.ndarray, down: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., 3) grey levels of slopes at the pixels (x, y)."""
    upright = 1 / np.sqrt(1 + across**2 + down**2)
    nx, ny = across * upright, down * upright
    u, v = 2 * x / SHAPE[1] - 1, 2 * y / SHAPE[0] - 1
    linear = np.stack([nx, ny], axis=-1) @ GREY_PER_SLOPE.T * (1 + 0.3 * u - 0.2 * v**2)[..., None]
    return linear - 30 * (nx**2 + ny**2)[..., None] + 20 * (nx**2 * ny)[..., None] * np.array([1.0, 0.0, -1.0])


def press_rows(centre: tuple[float, float], random: np.random.Generator, noise_grey: float = 0.0) -> np.ndarray:
    """(N, 7) labelled pixels of one press, as a table of presses keeps them."""
    y, x = np.indices(SHAPE, dtype=np.float64)
    dx, dy = x - centre[0], y - centre[1]
    inside = np.hypot(dx, dy) < CONTACT_PX
    x, y, dx, dy = x[inside], y[inside], dx[inside], dy[inside]
    height = np.sqrt(BALL_PX**2 - dx**2 - dy**2)
    across, down = -dx / height, -dy / height
    change = true_change(across, down, x, y) + random.normal(0, noise_grey, (len(x), 3))
    return np.column_stack([change, x, y, across, down]).astype(np.float32)


def pressed_unit(
    folder: Path, *, presses: int = 12, noise_grey: float = 0.0, rows: np.ndarray | None = None, **manifest: object
) -> Bundle:
    """Write and load the bundle; `manifest`: more of it. `rows` replace those of the presses."""
    random = np.random.default_rng(0)
    centres = random.uniform((5, 5), (SHAPE[1] - 5, SHAPE[0] - 5), (presses, 2)).tolist()
    parts = [press_rows((x, y), random, noise_grey) for x, y in centres]
    numbers = np.repeat(np.arange(presses, dtype=np.int32), [len(part) for part in parts])
    given = np.concatenate(parts) if rows is None else rows
    table = {"rows": given, "image": numbers[: len(given)], "image_size": np.array(SHAPE[::-1], np.int32)}
    described = {"sensor": "foreign", "pixel_size_mm": (PIXEL_MM, PIXEL_MM), "noise_grey": NOISE_GREY, **manifest}
    return write_bundle(
        folder, reference=reference_image(SHAPE), reference_frames=8, network=linear_network(), metrics={},
        presses=table, **described,
    )  # type: ignore[arg-type]  # fmt: skip
