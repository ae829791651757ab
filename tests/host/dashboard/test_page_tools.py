"""The toolbar in a real browser: what is saved equals the frame, choices are kept, a pause can be looked through."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from gellight.dashboard.messages import encode
from gellight.dashboard.view import ReferenceViews
from gellight.frames.pose import ObjectPose
from tests.helpers.browsing import Open, draw
from tests.helpers.dashboard_source import PIXEL_MM, FormulaSource, bump, two_bumps
from tests.helpers.ply import read_ply
from tests.helpers.view_messages import View, decode

pytestmark = pytest.mark.browser


def show(page: Page, source: FormulaSource, frame: Any) -> View:
    """Let the page draw `frame`; return what was sent of it."""
    sequence = source.put(frame)
    page.wait_for_function("sequence => gellight.sequence === sequence", arg=sequence)
    return decode(encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=ReferenceViews()))


def saved(page: Page, button: str, folder: Path) -> Path:
    with page.expect_download() as download:
        page.get_by_test_id(button).click()
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def test_npz_and_ply_are_the_newest_frame_at_full_size(opened: Open, source: FormulaSource, tmp_path: Path) -> None:
    page = opened()
    frame = bump(0.9, 3.0, -2.0)
    show(page, source, frame)
    path = saved(page, "save-npz", tmp_path)
    assert path.name == f"gellight-{frame.camera_frame.sequence}.npz"
    with np.load(path) as arrays:
        assert np.array_equal(arrays["depth_mm"], frame.depth_mm)
        assert np.array_equal(arrays["contact"], frame.contact.mask)
        assert np.array_equal(arrays["gradient_map"], frame.gradient_map)
    frame = bump(1.0, 3.0, -2.0)
    depth = frame.depth_mm.copy()
    depth[:40, :40] = np.nan
    object.__setattr__(frame, "depth_mm", depth)
    show(page, source, frame)
    vertices, triangles, _ = read_ply(saved(page, "save-ply", tmp_path))
    assert len(vertices["z"]) == 640 * 480 - 40 * 40
    x, y, z = vertices["x"], vertices["y"], vertices["z"]
    assert np.abs(z - np.exp(-((x - 3) ** 2 + (y - 2) ** 2) / 18)).max() < 1e-5, "y points up"
    corners = np.stack([x, y, z], axis=1)[triangles]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (outward[:, 2] > 0).all(), "every triangle faces the camera"


def test_why_there_is_no_file_is_told_and_a_paused_page_saves_no_other_frame(
    opened: Open, source: FormulaSource
) -> None:
    page = opened()
    page.get_by_test_id("save-npz").click()
    expect(page.get_by_test_id("readout")).to_have_text("no frame")
    draw(page, source, 0.5)
    page.get_by_test_id("pause").click()
    expect(page.get_by_test_id("save-npz")).to_be_disabled()


def test_the_snapshot_shows_all_pictures(opened: Open, source: FormulaSource, tmp_path: Path) -> None:
    page = opened()
    show(page, source, two_bumps(truth_factor=1.02))
    picture = cv2.imread(str(saved(page, "save-png", tmp_path)))
    assert picture.shape == (64 + 2 * 406, 16 + 3 * 496, 3)
    grey = picture[94 + 406 + 180, 16 + 50]
    assert np.abs(grey.astype(int) - 128).max() < 4, "the camera image stands at the left of the second row"
    variances = [
        picture[94 + r * 406 : 440 + r * 406, 16 + c * 496 : 496 + c * 496].std() for r in (0, 1) for c in range(3)
    ]
    assert min(variances) > 3


def test_keys_do_what_the_help_says(page: Page, source: FormulaSource) -> None:
    page.keyboard.press("m")
    expect(page.get_by_test_id("measure")).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("measure")).to_have_attribute("aria-pressed", "false")
    page.keyboard.press("Space")
    expect(page.get_by_test_id("state")).to_have_text("paused")
    page.keyboard.press("Space")
    expect(page.get_by_test_id("pause")).to_have_text("Pause")
    page.keyboard.press("d")
    expect(page.get_by_test_id("stages")).to_be_visible()
    page.keyboard.press("?")
    expect(page.get_by_test_id("keys")).to_be_visible()
    keys = page.get_by_test_id("keys").locator("kbd").all_text_contents()
    assert keys[:10] == ["Space", "M", "T", "C", "S", "N", "P", "R", "F", "?"]


def test_choices_are_kept_over_a_reload_and_in_the_address(page: Page, source: FormulaSource) -> None:
    page.get_by_test_id("scale").select_option("400")
    page.get_by_test_id("span").select_option("60")
    page.get_by_test_id("diagnostics").locator("summary").click()
    page.wait_for_function("() => location.hash.includes('diagnostics=1')")
    assert "scale=400" in page.evaluate("location.hash")
    page.goto(page.url.split("#")[0])
    page.reload()
    expect(page.get_by_test_id("scale")).to_have_value("400")
    expect(page.get_by_test_id("ticks").locator("li").last).to_have_text("400 µm")
    expect(page.get_by_test_id("span")).to_have_value("60")
    expect(page.get_by_test_id("stages")).to_be_visible()
    page.goto("about:blank")
    page.go_back()
    page.evaluate("location.hash = 'scale=800&gain=1000'")
    page.reload()
    expect(page.get_by_test_id("scale")).to_have_value("800")
    expect(page.get_by_test_id("gain")).to_have_value("2")
    page.get_by_test_id("reset-view").click()
    expect(page.get_by_test_id("scale")).to_have_value("1600")
    assert page.evaluate("location.hash") == ""


def test_a_pause_holds_the_frame_and_can_be_looked_through(opened: Open, source: FormulaSource) -> None:
    page = opened()
    for depth_mm in (0.2, 0.5, 0.8):
        draw(page, source, depth_mm)
        page.wait_for_timeout(120)
    page.get_by_test_id("pause").click()
    expect(page.get_by_test_id("banner-paused")).to_contain_text("Paused")
    held = page.evaluate("gellight.sequence")
    for depth_mm in (1.0, 1.2, 1.4):
        source.put(bump(depth_mm, 0, 0))
        page.wait_for_timeout(60)
    assert page.evaluate("gellight.sequence") == held
    history = page.get_by_test_id("history")
    history.focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_function("held => gellight.sequence === held - 1", arg=held)
    expect(page.get_by_test_id("indentation")).to_have_text("0.500")
    page.keyboard.press("PageUp")
    page.wait_for_function("() => gellight.indentation_mm < 0.3")
    box = history.bounding_box()
    page.mouse.click(box["x"] + box["width"] - 12, box["y"] + box["height"] / 2)
    page.wait_for_function("() => gellight.indentation_mm > 0.7")
    page.get_by_test_id("banner-paused").get_by_role("button").click()
    draw(page, source, 1.1)
    expect(page.get_by_test_id("indentation")).to_have_text("1.100")


def test_the_frames_that_are_kept_stay_within_their_bytes_and_reach_far_back(opened: Open) -> None:
    kept = opened().evaluate("""async () => {
        const { Recent } = await import("./recent.js");
        const recent = new Recent(100_000);
        for (let i = 0; i < 3000; i++) recent.add(i / 10, new ArrayBuffer(1000), i === 1501 ? 2 : 1);
        return [recent.count, recent.bytes, recent.nearest(0).timeS, recent.nearest(1e9).timeS,
                recent.step(299.9, -1).timeS, Math.abs(recent.nearest(150).timeS - 150),
                recent.frames.find(({ peakMm }) => peakMm === 2)?.timeS];
    }""")
    count, held, oldest, newest, before, middle, peak = kept
    assert (count, held) == (100, 100_000)
    assert (oldest, newest) == (0, 299.9)
    assert newest - before < 0.5, "dense where it is new"
    assert middle < 15, "and without a hole"
    assert peak == pytest.approx(150.1, abs=15), "the chart loses no touch"


def test_the_tracked_object_has_its_axes_and_its_way_on_the_pictures(opened: Open, source: FormulaSource) -> None:
    page = opened()
    quarter = np.array([[0.0, -1, 0, 2], [1, 0, 0, -1], [0, 0, 1, 0], [0, 0, 0, 1]])
    for number, motion in ((1, np.eye(4)), (2, quarter)):
        pose = ObjectPose(number=4, since_sequence=1, motion=motion, origin_mm=np.zeros(3), centre_mm=np.zeros(3),
                          covariance=np.eye(6), untellable=np.eye(6)[:number])  # fmt: skip
        show(page, source, replace(bump(0.9, 3.0, -2.0), pose=pose))
    assert page.evaluate("gellight.pose.number") == 4
    told = "object 4 at (2.00, -1.00, 0.00) mm, 2 of 6 directions untellable, doubtful"
    expect(page.get_by_test_id("pose")).to_have_text(f"{told}: press deeper, or where there is more relief")
    marks = page.locator(".marks").first
    assert marks.locator(".axis-x").get_attribute("d") == "M2,-1L2,1", "x has turned towards y, down"
    assert marks.locator("path.under").first.get_attribute("d") == "M0,0L2,-1"
    show(page, source, bump(0.9, 3.0, -2.0))
    expect(marks.locator(".axis-x")).to_have_count(0)
    page.get_by_test_id("track").click()
    page.wait_for_timeout(300)
    assert source.tracking
