"""The binary message of a tactile frame: what goes in comes out, within the stated bounds."""

import base64
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gellight.dashboard import messages
from gellight.dashboard.messages import without_nan
from gellight.dashboard.view import DEPTH_UNIT_MM, ReferenceViews, view_shape
from gellight.frames.frames import Contact, GroundTruth, TactileFrame
from gellight.reconstruction.contact import measure_patches
from tests.helpers.browsing import Open
from tests.helpers.dashboard_source import LIGHT, PIXEL_MM, bump
from tests.helpers.view_messages import decode
from tests.helpers.weighed import HeavyFrames

PIXEL = (PIXEL_MM, PIXEL_MM)


def encode(frame: TactileFrame, *, pixel_size_mm: tuple[float, float]) -> bytes:
    return messages.encode(frame, pixel_size_mm=pixel_size_mm, references=ReferenceViews())


FRAME = bump(1.2, 3.0, -2.0)


def blocks(plane: np.ndarray) -> np.ndarray:
    """Means of 2 x 2 pixels: the area average of a 640 x 480 plane at view size, computed plainly."""
    height, width = plane.shape[:2]
    return plane.reshape(height // 2, 2, width // 2, 2, -1).mean(axis=(1, 3)).squeeze()


def with_depth(depth_mm: np.ndarray) -> TactileFrame:
    return replace(FRAME, depth_mm=depth_mm.astype(np.float32))


def test_the_image_is_a_faithful_jpeg_in_rgb_order_and_the_contact_is_beside_it() -> None:
    view = decode(encode(FRAME, pixel_size_mm=PIXEL))
    assert np.abs(view.image.astype(float) - blocks(FRAME.camera_frame.image)).mean() < 1.5
    assert np.array_equal(view.contact, blocks(FRAME.contact.mask) >= 0.5)
    red = replace(
        FRAME, camera_frame=replace(FRAME.camera_frame, image=np.full((480, 640, 3), (200, 20, 20), np.uint8))
    )
    assert np.allclose(decode(encode(red, pixel_size_mm=PIXEL)).image[100, 100], (200, 20, 20), atol=3)


def test_the_header_carries_the_figures() -> None:
    header = decode(encode(FRAME, pixel_size_mm=(0.05, 0.06))).header
    assert header["sequence"] == FRAME.camera_frame.sequence
    assert header["time_s"] == FRAME.camera_frame.time_s
    assert header["image_px"] == [640, 480]
    assert header["view_px"] == [320, 240]
    assert header["pixel_size_mm"] == [0.05, 0.06]
    assert header["contact"] == {
        "area_mm2": FRAME.contact.area_mm2,
        "indentation_mm": FRAME.contact.indentation_mm,
        "centroid_mm": list(FRAME.contact.centroid_mm or ()),
    }
    assert header["light"] == LIGHT.tolist()
    assert header["stage_ms"] == {"gelnet": 8.0, "integration": 3.0}
    assert header["force"] is None
    (patch,) = FRAME.contacts
    many = tuple(replace(patch, number=number) for number in range(1, 14))
    heavy = decode(encode(replace(FRAME, measures=HeavyFrames(), contacts=many), pixel_size_mm=PIXEL)).header
    assert heavy["force"] == {"normal_n": 1.25, "error_n": 0.1, "flags": ["heavier"]}
    assert [one["number"] for one in heavy["contacts"]] == list(range(1, 13)), "the first twelve"


def test_the_header_numbers_the_contacts_by_depth() -> None:
    mask = np.zeros((480, 640), bool)
    mask[100:140, 100:140] = mask[300:320, 500:520] = True
    depth = np.where(mask, 0.5, 0.0)
    depth[310, 510] = 0.7
    gradient = np.ones((480, 640, 2), np.float32)
    contacts = tuple(measure_patches(mask, depth, gradient, (0.1, 0.2)))
    frame = replace(with_depth(depth), contact=replace(FRAME.contact, mask=mask), contacts=contacts)
    deeper, larger = decode(encode(frame, pixel_size_mm=(0.1, 0.2))).header["contacts"]
    assert deeper["depth_mm"] == pytest.approx(0.7)
    assert larger["centroid_mm"] == pytest.approx([(119.5 - 319.5) * 0.1, (119.5 - 239.5) * 0.2])
    assert larger["area_mm2"] == pytest.approx(1600 * 0.02)
    assert larger["volume_mm3"] == pytest.approx(0.5 * 1600 * 0.02)
    assert larger["slope_rad"] == pytest.approx(np.arctan(np.sqrt(2)))


def test_the_true_depth_map_comes_through_with_the_error_against_it() -> None:
    true_mm = FRAME.depth_mm * 1.1 + 0.02
    contact = FRAME.contact.mask
    truth = GroundTruth(depth_mm=true_mm.astype(np.float32), gradient_map=FRAME.gradient_map, contact=contact)
    frame = replace(FRAME, camera_frame=replace(FRAME.camera_frame, truth=truth))
    view = decode(encode(frame, pixel_size_mm=PIXEL))
    error = np.abs(true_mm - FRAME.depth_mm)
    assert np.abs(view.truth_mm - blocks(true_mm)).max() <= 0.5 * DEPTH_UNIT_MM + 1e-6
    assert view.header["truth"] == pytest.approx(
        {"indentation_mm": true_mm.max(), "depth_error_mm": error[contact].mean(), "map_depth_error_mm": error.mean()}
    )
    assert error[contact].mean() > error.mean() > 0.02, "no constant is taken off"


@given(st.integers(0, 2**32 - 1))
def test_no_depth_is_lost_however_rough_it_is(seed: int) -> None:
    random = np.random.default_rng(seed)
    depth = random.uniform(-2, 40, (24, 32))
    depth[random.random(depth.shape) < 0.2] = np.nan
    frame = replace(bump(1.0, 0, 0, shape=depth.shape), depth_mm=depth.astype(np.float32))
    seen = decode(encode(frame, pixel_size_mm=PIXEL)).depth_mm
    assert np.allclose(seen, np.clip(depth, -1, 31.767), rtol=0, atol=0.5 * DEPTH_UNIT_MM + 1e-5, equal_nan=True)


def test_what_is_unknown_is_null() -> None:
    nothing = Contact(mask=np.zeros((480, 640), bool), area_mm2=0.0, indentation_mm=float("nan"), centroid_mm=None)
    frame = replace(FRAME, contact=nothing, camera_frame=replace(FRAME.camera_frame, light=None))
    header = decode(encode(frame, pixel_size_mm=PIXEL)).header
    assert header["light"] is None
    assert header["contact"] == {"area_mm2": 0.0, "indentation_mm": None, "centroid_mm": None}


def test_missing_depth_stays_missing() -> None:
    depth = np.zeros((480, 640))
    depth[:100] = np.nan
    view = decode(encode(with_depth(depth), pixel_size_mm=PIXEL))
    assert np.isnan(view.depth_mm[:50]).all()
    assert np.abs(view.depth_mm[50:]).max() <= 0.5 * DEPTH_UNIT_MM


@given(width=st.integers(1, 3000), height=st.integers(1, 3000))
def test_the_view_keeps_proportions_and_is_never_enlarged(width: int, height: int) -> None:
    rows, columns = view_shape((height, width))
    assert 1 <= rows <= min(height, 240)
    assert 1 <= columns <= min(width, 320)
    scale = min(320 / width, 240 / height, 1.0)
    assert abs(columns - width * scale) <= 1
    assert abs(rows - height * scale) <= 1


@pytest.mark.parametrize("shape", [(480, 640), (121, 163), (600, 400), (1200, 1600)])
def test_any_image_size_comes_through(shape: tuple[int, int]) -> None:
    frame = bump(0.8, 1.0, 1.0, shape=shape)
    view = decode(encode(frame, pixel_size_mm=PIXEL))
    assert view.depth_mm.shape == view_shape(shape) == view.image.shape[:2] == view.contact.shape
    assert view.depth_mm.max() == pytest.approx(0.8, abs=0.01)


def test_numbers_that_json_cannot_carry_become_null() -> None:
    assert without_nan({"a": [float("nan"), 1.0, (float("inf"),)], 3: "x"}) == {"a": [None, 1.0, [None]], "3": "x"}


# ---- what the page makes of it ----


DECODE = """async (text) => {
    const { Decoder } = await import("./message.js");
    const { subtract } = await import("./packed.js");
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    let complete;
    const completed = new Promise((resolve) => { complete = resolve; });
    const view = await new Decoder(complete).decode(bytes.buffer);
    const atFirst = view.reference.picture;
    await completed;
    view.difference = new Uint8ClampedArray(view.image.data.length);
    subtract(view, 1, view.difference);
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
        message = messages.encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=references)
        view = page.evaluate(DECODE, base64.b64encode(message).decode())
        for name in ("depth", "truth", "slopes", "contact", "difference"):
            if view[name]:
                kind, text = view[name]
                view[name] = np.frombuffer(base64.b64decode(text), TYPES[kind])
        return message, view

    return decoded


@pytest.mark.browser
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


@pytest.mark.browser
def test_difference_and_slopes_are_derived_as_the_frame_has_them(seen: Seen) -> None:
    frame = bump(1.2, 3.0, -2.0)
    _, view = seen(frame)
    true = frame.difference.reshape(240, 2, 320, 2, 3).mean(axis=(1, 3))
    error = np.abs(np.reshape(view["difference"], (240, 320, 4))[..., :3] - 128.0 - true)
    assert view["atFirst"] is None, "nothing waits for the reference image"
    assert error.mean() < 1.0, "grey levels"
    assert np.abs(true).max() > 20
    slopes = np.reshape(view["slopes"], (240, 320, 2))
    true = frame.gradient_map.reshape(240, 2, 320, 2, 2).mean(axis=(1, 3))
    inside = (slice(1, -1), slice(1, -1))
    assert np.abs(slopes - true)[inside].max() < 0.5 * DEPTH_UNIT_MM / (2 * PIXEL_MM) + 0.001
    assert np.abs(true).max() > 0.2, "the scene must have slopes"
    assert view["truth"] is None, "a sensor without truth has none"


@pytest.mark.browser
def test_where_depth_is_missing_the_gel_is_shown_flat(seen: Seen) -> None:
    frame = bump(1.2, 0.0, 0.0)
    depth = frame.depth_mm.copy()
    depth[:200] = np.nan
    slopes = np.reshape(seen(replace(frame, depth_mm=depth))[1]["slopes"], (240, 320, 2))
    assert not slopes[:100].any()
    assert np.isfinite(slopes).all()
    assert np.abs(slopes).max() < 0.5, "no cliff to what is not there"
