"""What the page's own decoder makes of a message: the server's maps, and what is derived of them."""

import base64
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gellight.dashboard.made_once import MadeOnce
from gellight.dashboard.messages import encode
from gellight.dashboard.reference_views import ReferenceViews
from gellight.dashboard.view import DEPTH_UNIT_MM
from gellight.frames.frames import GroundTruth, TactileFrame
from tests.helpers.browsing import Open
from tests.helpers.dashboard_source import PIXEL_MM, FormulaSource, bump
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
    const listed = (array) => array && [...array];
    return { size: [view.width, view.height], depth: listed(view.depth), truth: listed(view.truth),
             slopes: listed(view.slopes), contact: listed(view.contact), atFirst,
             difference: listed(view.difference) };
}"""


def with_truth(frame: TactileFrame, depth_mm: np.ndarray) -> TactileFrame:
    truth = GroundTruth(depth_mm=depth_mm, gradient_map=frame.gradient_map, contact=frame.contact.mask)
    return replace(frame, camera_frame=replace(frame.camera_frame, truth=truth))


def seen(opened: Open, frame: TactileFrame) -> tuple[bytes, dict[str, Any]]:
    references = ReferenceViews()
    message = encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=references, once=MadeOnce())
    page = opened()
    page.route(
        "**/reference/*",
        lambda route: route.fulfill(
            body=references.picture(route.request.url.rsplit("/", 1)[1]), content_type="image/webp"
        ),
    )
    return message, page.evaluate(DECODE, base64.b64encode(message).decode())


def test_the_page_unpacks_what_the_server_packed(opened: Open, source: FormulaSource) -> None:
    frame = bump(1.2, 3.0, -2.0)
    depth = frame.depth_mm.copy()
    depth[:40, :60] = np.nan
    depth[200:240, 300:330] = -0.7
    message, view = seen(opened, with_truth(replace(frame, depth_mm=depth), frame.depth_mm * 1.3))
    expected = decode(message)
    assert view["size"] == [320, 240]
    for name, depth_mm in (("depth", expected.depth_mm), ("truth", expected.truth_mm)):
        codes = np.where(np.isnan(depth_mm), 65535, np.rint((depth_mm + 1) / DEPTH_UNIT_MM))
        assert np.array_equal(np.reshape(view[name], (240, 320)), codes), name
    assert np.array_equal(np.unpackbits(np.array(view["contact"], np.uint8)).reshape(240, 320), expected.contact)


def test_the_difference_is_the_image_minus_the_reference(opened: Open, source: FormulaSource) -> None:
    frame = bump(1.2, 3.0, -2.0)
    _, view = seen(opened, frame)
    true = frame.difference.reshape(240, 2, 320, 2, 3).mean(axis=(1, 3))
    error = np.abs(np.reshape(view["difference"], (240, 320, 3)) - 128.0 - true)
    assert view["atFirst"] is None, "nothing waits for the reference image"
    assert error.mean() < 1.0, "grey levels"
    assert np.abs(true).max() > 20


def test_slopes_are_those_of_the_depth_map(opened: Open, source: FormulaSource) -> None:
    frame = bump(1.2, 3.0, -2.0)
    _, view = seen(opened, frame)
    slopes = np.reshape(view["slopes"], (240, 320, 2))
    true = frame.gradient_map.reshape(240, 2, 320, 2, 2).mean(axis=(1, 3))
    inside = (slice(1, -1), slice(1, -1))
    assert np.abs(slopes - true)[inside].max() < 0.5 * DEPTH_UNIT_MM / (2 * PIXEL_MM) + 0.001
    assert np.abs(true).max() > 0.2, "the scene must have slopes"


def test_where_depth_is_missing_the_gel_is_shown_flat(opened: Open, source: FormulaSource) -> None:
    frame = bump(1.2, 0.0, 0.0)
    depth = frame.depth_mm.copy()
    depth[:200] = np.nan
    _, view = seen(opened, replace(frame, depth_mm=depth))
    slopes = np.reshape(view["slopes"], (240, 320, 2))
    assert not slopes[:100].any()
    assert np.isfinite(slopes).all()
    assert np.abs(slopes).max() < 0.5, "no cliff to what is not there"


def test_a_sensor_without_truth_has_none(opened: Open, source: FormulaSource) -> None:
    assert seen(opened, bump(1.2, 0.0, 0.0))[1]["truth"] is None
