"""What the page's own decoder makes of a message: the server's maps, and what is derived of them."""

import base64
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gellight.dashboard.messages import IdentityCache, encode
from gellight.dashboard.view import DEPTH_UNIT_MM, ReferenceViews
from gellight.frames.frames import GroundTruth, TactileFrame
from tests.helpers.browsing import Open
from tests.helpers.dashboard_source import PIXEL_MM, bump
from tests.helpers.view_messages import decode

pytestmark = pytest.mark.browser

DECODE = """async (text) => {
    const { Decoder } = await import("./message.js");
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    let complete;
    const completed = new Promise((resolve) => { complete = resolve; });
    const view = await new Decoder(complete).decode(bytes.buffer);
    const atFirst = view.difference;
    await completed;
    const text64 = ({ buffer, byteOffset, byteLength }) => new Promise((resolve) => {
        const reader = new FileReader();
        reader.onload = () => resolve(reader.result.split(",")[1]);
        reader.readAsDataURL(new Blob([new Uint8Array(buffer, byteOffset, byteLength)]));
    });
    const found = { size: [view.width, view.height], atFirst };
    for (const name of ["depth", "truth", "slopes", "contact", "difference"])
        found[name] = view[name] && [view[name].constructor.name, await text64(view[name])];
    return found;
}"""
TYPES = {
    "Uint8Array": np.uint8, "Uint8ClampedArray": np.uint8, "Uint16Array": np.uint16, "Float32Array": np.float32,
}  # fmt: skip
Seen = Callable[[TactileFrame], tuple[bytes, dict[str, Any]]]


@pytest.fixture
def seen(opened: Open) -> Seen:
    """Give the message of a frame, and what the page makes of it."""
    references, page = ReferenceViews(), opened()
    page.route(
        "**/reference/*",
        lambda route: route.fulfill(
            body=references.picture(route.request.url.rsplit("/", 1)[1]), content_type="image/webp"
        ),
    )

    def decoded(frame: TactileFrame) -> tuple[bytes, dict[str, Any]]:
        message = encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=references, once=IdentityCache())
        view = page.evaluate(DECODE, base64.b64encode(message).decode())
        for name in ("depth", "truth", "slopes", "contact", "difference"):
            if view[name]:
                kind, text = view[name]
                view[name] = np.frombuffer(base64.b64decode(text), TYPES[kind])
        return message, view

    return decoded


def test_the_page_unpacks_what_the_server_packed(seen: Seen) -> None:
    frame = bump(1.2, 3.0, -2.0)
    depth = frame.depth_mm.copy()
    depth[:40, :60] = np.nan
    depth[200:240, 300:330] = -0.7
    truth = GroundTruth(depth_mm=frame.depth_mm * 1.3, gradient_map=frame.gradient_map, contact=frame.contact.mask)
    message, view = seen(replace(frame, depth_mm=depth, camera_frame=replace(frame.camera_frame, truth=truth)))
    expected = decode(message)
    assert view["size"] == [320, 240]
    for name, depth_mm in (("depth", expected.depth_mm), ("truth", expected.truth_mm)):
        codes = np.where(np.isnan(depth_mm), 65535, np.rint((depth_mm + 1) / DEPTH_UNIT_MM))
        assert np.array_equal(np.reshape(view[name], (240, 320)), codes), name
    assert np.array_equal(np.unpackbits(view["contact"]).reshape(240, 320), expected.contact)


def test_difference_and_slopes_are_derived_as_the_frame_has_them(seen: Seen) -> None:
    frame = bump(1.2, 3.0, -2.0)
    _, view = seen(frame)
    true = frame.difference.reshape(240, 2, 320, 2, 3).mean(axis=(1, 3))
    error = np.abs(np.reshape(view["difference"], (240, 320, 3)) - 128.0 - true)
    assert view["atFirst"] is None, "nothing waits for the reference image"
    assert error.mean() < 1.0, "grey levels"
    assert np.abs(true).max() > 20
    slopes = np.reshape(view["slopes"], (240, 320, 2))
    true = frame.gradient_map.reshape(240, 2, 320, 2, 2).mean(axis=(1, 3))
    inside = (slice(1, -1), slice(1, -1))
    assert np.abs(slopes - true)[inside].max() < 0.5 * DEPTH_UNIT_MM / (2 * PIXEL_MM) + 0.001
    assert np.abs(true).max() > 0.2, "the scene must have slopes"
    assert view["truth"] is None, "a sensor without truth has none"


def test_where_depth_is_missing_the_gel_is_shown_flat(seen: Seen) -> None:
    frame = bump(1.2, 0.0, 0.0)
    depth = frame.depth_mm.copy()
    depth[:200] = np.nan
    slopes = np.reshape(seen(replace(frame, depth_mm=depth))[1]["slopes"], (240, 320, 2))
    assert not slopes[:100].any()
    assert np.isfinite(slopes).all()
    assert np.abs(slopes).max() < 0.5, "no cliff to what is not there"
