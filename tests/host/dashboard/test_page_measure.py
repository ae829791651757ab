"""Measuring on the page: point, line, contacts, against surfaces known in closed form."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.helpers.browsing import Open, draw, paint, wait_until
from tests.helpers.dashboard_source import HEIGHT, PIXEL_MM, SIGMA_MM, WIDTH, FormulaSource, bump, two_bumps, with_truth

pytestmark = pytest.mark.browser

SIZE_MM = (WIDTH * PIXEL_MM, HEIGHT * PIXEL_MM)


def at(page: Page, canvas: str, x_mm: float, y_mm: float) -> tuple[float, float]:
    """Where on the screen a place of a picture is."""
    box = page.get_by_test_id(canvas).bounding_box()
    return box["x"] + (x_mm / SIZE_MM[0] + 0.5) * box["width"], box["y"] + (y_mm / SIZE_MM[1] + 0.5) * box["height"]


def show(page: Page, source: FormulaSource, frame: object) -> None:
    sequence = source.put(frame)  # type: ignore[arg-type]
    page.wait_for_function("sequence => gellight.sequence === sequence", arg=sequence)


def readout(page: Page) -> list[float]:
    """The numbers of the read-out: x, y, depth, the truth where it is known, slope."""
    words = (page.get_by_test_id("readout").text_content() or "").replace("°", "").split()
    return [float(word) for word in words if word.lstrip("-").replace(".", "").isdigit()]


def test_the_place_under_the_pointer_is_measured_on_every_picture(opened: Open, source: FormulaSource) -> None:
    page = opened()
    show(page, source, with_truth(bump(1.0, 2.0, -1.0), 1.25))
    for number, canvas in enumerate(("depth", "truth", "image", "difference", "normal")):
        place = 4.0 + number / 2, -1.0
        page.mouse.move(*at(page, canvas, *place))
        wait_until(page, lambda place=place: readout(page)[:2] == pytest.approx(place, abs=0.15))  # type: ignore[misc]
        x, y, depth, true, slope = readout(page)
        r = math.hypot(x - 2, y + 1)
        exact = math.exp(-(r**2) / (2 * SIGMA_MM**2))
        assert depth == pytest.approx(exact, abs=0.003), canvas
        assert true == pytest.approx(1.25 * exact, abs=0.003), canvas
        assert slope == pytest.approx(math.degrees(math.atan(exact * r / SIGMA_MM**2)), abs=0.3), canvas


def test_the_place_under_the_pointer_is_measured_on_the_surface(opened_3d: Open, source: FormulaSource) -> None:
    """A pointer on the top of the bump finds the bump: the surface is drawn four times as high as it is."""
    page = opened_3d()
    page.get_by_test_id("detail").select_option("1")
    draw(page, source, 1.2, 0.0, 0.0)
    box = page.get_by_test_id("surface").bounding_box()
    best = 0.0
    for part in np.linspace(0.3, 0.6, 13):
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + part * box["height"])
        paint(page)
        if len(found := readout(page)) == 4:
            x, y, depth, _ = found
            assert depth == pytest.approx(1.2 * math.exp(-(x**2 + y**2) / (2 * SIGMA_MM**2)), abs=0.004)
            best = max(best, depth)
    assert best > 1.15


def test_a_line_over_a_picture_gives_the_section_with_the_truth_beside_it(opened: Open, source: FormulaSource) -> None:
    page = opened()
    show(page, source, with_truth(bump(0.8, 0.0, 0.0), 1.1))
    page.get_by_test_id("measure").click()
    page.mouse.move(*at(page, "image", -8.0, 0.0))
    page.mouse.down()
    page.mouse.move(*at(page, "image", 8.0, 4.0))
    page.mouse.up()
    section = page.evaluate("gellight.section")
    for name, factor in (("measured", 1.0), ("truth", 1.1)):
        along, depth = np.array(section[name]).T
        share = along / along[-1]
        assert along[-1] == pytest.approx(math.hypot(16, 4), abs=0.3)
        assert np.diff(along).max() < 0.13, "a point a pixel"
        exact = 0.8 * factor * np.exp(-((-8 + 16 * share) ** 2 + (4 * share) ** 2) / (2 * SIGMA_MM**2))
        assert np.abs(depth - exact).max() < 0.03, "the ends are where the pointer was, to a pixel of the screen"
        assert depth.max() == pytest.approx(exact.max(), abs=0.004)
    expect(page.get_by_test_id("section-text")).to_contain_text("true 0.71")
    assert source.stage.calls == [], "while measuring nothing is pressed"
    show(page, source, bump(0.3, 0.0, 0.0))
    page.wait_for_function("() => gellight.section.truth === null")
    assert max(depth for _, depth in page.evaluate("gellight.section.measured")) < 0.31, (
        "the line stays, the frame goes on"
    )
    page.get_by_test_id("clear-line").click()
    expect(page.get_by_test_id("section-text")).to_contain_text("draw a line")


def test_the_line_lies_over_the_surface(opened_3d: Open, source: FormulaSource) -> None:
    page = opened_3d()
    page.get_by_test_id("detail").select_option("1")
    draw(page, source, 0.0)
    paint(page)
    without = white_pixels(page)
    page.get_by_test_id("measure").click()
    page.mouse.move(*at(page, "depth", -15.0, 0.0))
    page.mouse.down()
    page.mouse.move(*at(page, "depth", 15.0, 0.0))
    page.mouse.up()
    page.mouse.move(0, 0)
    wait_until(page, lambda: white_pixels(page) > without + 100)


def white_pixels(page: Page) -> int:
    shown = cv2.imdecode(np.frombuffer(page.get_by_test_id("surface").screenshot(), np.uint8), cv2.IMREAD_COLOR)
    return int((shown.min(axis=2) > 220).sum())


def test_the_arrow_keys_measure_too(page: Page, source: FormulaSource) -> None:
    page.keyboard.press("m")
    page.get_by_test_id("depth").focus()
    for _ in range(4):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    page.keyboard.press("Shift+ArrowDown")
    for _ in range(8):
        page.keyboard.press("ArrowRight")
    assert readout(page)[:2] == [2.0, 0.1]
    page.keyboard.press("Enter")
    assert page.evaluate("gellight.section.measured.at(-1)[0]") == pytest.approx(math.hypot(4, 0.1))


def test_the_arrow_keys_press_where_they_are(page: Page, source: FormulaSource) -> None:
    page.get_by_test_id("image").focus()
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.getElementById('stage-now').textContent.includes('BALL')")
    assert source.stage.calls == [("BALL", 0.8, 0.0, -0.5)]
    page.get_by_test_id("object-BALL").focus()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_test_id("object-TSTEP")).to_be_checked()
    expect(page.get_by_test_id("object-TSTEP")).to_be_focused()


def test_contacts_are_numbered_and_keep_their_numbers(opened: Open, source: FormulaSource) -> None:
    page = opened()
    show(page, source, two_bumps())
    rows = page.get_by_test_id("contacts").locator("tr")
    expect(rows).to_have_count(2)
    found = [[float(cell) for cell in row.locator("td").all_text_contents()] for row in rows.all()]
    for number, depth_mm, (shown, depth, area, volume, slope) in ((1, 1.0, found[0]), (2, 0.5, found[1])):
        # The patch of a Gaussian bump ends where it is 0.95 times as steep as at its steepest: r < 1.24 sigma.
        assert (shown, depth) == (number, pytest.approx(depth_mm, abs=0.002))
        assert area == pytest.approx(math.pi * (1.24 * SIGMA_MM) ** 2, rel=0.04)
        inside = 1 - math.exp(-(1.24**2) / 2)
        assert volume == pytest.approx(2 * math.pi * SIGMA_MM**2 * depth_mm * inside, rel=0.04)
        assert slope == pytest.approx(math.degrees(math.atan(depth_mm * math.exp(-0.5) / SIGMA_MM)), abs=0.1)
    assert [row["number"] for row in page.evaluate("gellight.contacts")] == [1, 2]
    deeper, other = two_bumps().contacts
    show(page, source, replace(two_bumps(), contacts=(replace(deeper, number=9), replace(other, number=4))))
    expect(rows.first.locator("td").first).to_have_text("4")
    assert [row["depth_mm"] < 0.6 for row in page.evaluate("gellight.contacts")] == [True, False], "the sensor numbers"
