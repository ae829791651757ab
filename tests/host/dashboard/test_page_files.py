"""The page's files: few bytes over the line, sent again only when they have changed."""

import asyncio
import gzip
from collections.abc import Mapping
from dataclasses import replace

import aiohttp
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.dashboard.application import PAGE
from gellight.dashboard.fetched import FOR_EVER
from gellight.dashboard.messages import encode
from gellight.dashboard.server import DashboardServer
from gellight.dashboard.view import ReferenceViews
from gellight.frames.frames import TactileFrame
from tests.helpers.dashboard_source import PIXEL_MM, bump
from tests.helpers.page_client import bearer
from tests.helpers.view_messages import decode, decode_image


def get(url: str, **headers: str) -> tuple[int, bytes, Mapping[str, str]]:
    """Return status, body as it came over the line, and headers."""

    async def run() -> tuple[int, bytes, Mapping[str, str]]:
        async with (
            aiohttp.ClientSession(auto_decompress=False) as session,
            session.get(url, headers=bearer() | headers) as response,
        ):
            return response.status, await response.read(), response.headers.copy()

    return asyncio.run(run())


PACKED = {"Accept-Encoding": "gzip, deflate, br"}
PLAIN = {"Accept-Encoding": "identity"}


def test_text_comes_compressed_to_who_can_unpack_it_and_is_the_file(server: DashboardServer) -> None:
    status, body, headers = get(server.base + "main.js", **PACKED)
    assert (status, headers["Content-Encoding"]) == (200, "gzip")
    assert gzip.decompress(body) == (PAGE / "main.js").read_bytes()
    assert "javascript" in headers["Content-Type"]
    _, body, headers = get(server.base + "main.js", **PLAIN)
    assert "Content-Encoding" not in headers
    assert body == (PAGE / "main.js").read_bytes()


def test_what_the_browser_has_is_not_sent_again_and_libraries_are_kept_for_good(server: DashboardServer) -> None:
    tag = get(server.base + "main.js", **PACKED)[2]["ETag"]
    status, body, headers = get(server.base + "main.js", **PACKED, **{"If-None-Match": tag})
    assert (status, body, headers["ETag"], headers["Cache-Control"]) == (304, b"", tag, "no-cache")
    assert get(server.base + "main.js", **PACKED, **{"If-None-Match": '"another"'})[0] == 200
    vendored = next((PAGE / "vendor").glob("*/three.module.min.js")).relative_to(PAGE).as_posix()
    assert get(server.base + vendored, **PACKED)[2]["Cache-Control"] == FOR_EVER
    assert any(character.isdigit() for character in vendored), "the folder names the version"


def test_frames_at_rest_touched_and_at_rest_again_come_out_as_they_are() -> None:
    references = ReferenceViews()
    touched, rest = bump(1.2, 3.0, -2.0), bump(0.0, 0.0, 0.0)
    for array in (rest.depth_mm, rest.contact.mask):
        array.flags.writeable = False
    for frame in (rest, replace(rest), touched, rest):
        view = decode(encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=references))
        assert np.abs(view.depth_mm - frame.depth_mm.reshape(240, 2, 320, 2).mean(axis=(1, 3))).max() < 0.3e-3
        assert view.contact.any() == frame.contact.mask.any()


# ---- the reference image, which the page gets once ----


def seen(image: np.ndarray, reference: np.ndarray, drift: float = 0.0) -> TactileFrame:
    """A frame of `image` with the difference that the frame path makes of it."""
    frame = bump(1.0, 0.0, 0.0)
    difference = (image - reference - np.float32(drift)).astype(np.float32)
    return replace(frame, camera_frame=replace(frame.camera_frame, image=image), difference=difference)


def scene(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a (480, 640, 3) image of noise and a smooth reference image with fractions of grey levels."""
    image = np.random.default_rng(seed).integers(0, 256, (480, 640, 3), np.uint8)
    rows, columns = np.mgrid[0:480, 0:640]
    reference = np.stack([90 + rows / 7, 100 + columns / 9, 120 + (rows + columns) / 23], axis=-1)
    return image, reference.astype(np.float32)


def blocks(plane: np.ndarray) -> np.ndarray:
    return plane.astype(np.float64).reshape(240, 2, 320, 2, 3).mean(axis=(1, 3))


def test_image_minus_reference_minus_drift_is_the_difference() -> None:
    image, reference = scene(1)
    views = ReferenceViews()
    views.of(seen(image, reference))
    frame = seen(scene(2)[0], reference, drift=3.4)
    name, drift = views.of(frame)
    shown = blocks(frame.camera_frame.image) - decode_image(views.picture(name)) - drift
    assert drift == pytest.approx([3.4] * 3, abs=1e-3)
    assert np.abs(shown - blocks(frame.difference)).max() <= 0.5 + 1e-3


def test_the_reference_keeps_its_name_while_frames_and_light_change() -> None:
    _, reference = scene(1)
    views = ReferenceViews()
    names = {views.of(seen(scene(seed)[0], reference, drift=0.7 * seed))[0] for seed in range(5)}
    assert len(names) == 1


@pytest.mark.parametrize(("later_s", "names"), [(0.9, 1), (1.1, 2)])
def test_light_that_is_followed_over_the_view_is_a_new_reference_once_a_second(later_s: float, names: int) -> None:
    image, reference = scene(1)
    views = ReferenceViews()
    first = seen(image, reference)
    tilted = seen(image, reference * np.linspace(0.98, 1.02, 640, dtype=np.float32)[:, None])
    at_s = first.camera_frame.time_s + later_s
    tilted = replace(tilted, camera_frame=replace(tilted.camera_frame, time_s=at_s))
    assert len({views.of(frame)[0] for frame in (first, tilted)}) == names


def test_another_zero_is_another_reference() -> None:
    image, reference = scene(1)
    views = ReferenceViews()
    first, _ = views.of(seen(image, reference))
    spot = reference.copy()
    spot[200:240, 300:340] += 2
    second, drift = views.of(seen(image, spot))
    assert first != second
    assert drift == [0.0, 0.0, 0.0]
    assert not np.array_equal(decode_image(views.picture(first)), decode_image(views.picture(second)))


@pytest.mark.parametrize(
    ("size_px", "grey", "another"), [(8, 0.3, True), (8, 0.2, False), (8, -0.3, True), (240, -0.2, False)]
)
def test_a_spot_of_eight_pixels_tells_another_zero_and_noise_does_not(size_px: int, grey: float, another: bool) -> None:
    image, reference = scene(1)
    views, spot = ReferenceViews(), reference.copy()
    spot[205 : 205 + size_px, 301 : 301 + size_px] += grey
    first, second = (views.of(seen(image, one))[0] for one in (reference, spot))
    assert (second != first) == another


def test_old_references_are_forgotten_and_asking_for_one_says_what_to_do() -> None:
    image, reference = scene(1)
    views = ReferenceViews()
    names = []
    for number in range(5):
        reference = reference.copy()
        reference[:100] += 1 + number
        names.append(views.of(seen(image, reference))[0])
    for name in names[1:]:
        views.picture(name)
    with pytest.raises(InputError, match="take the name from the newest frame"):
        views.picture(names[0])
