"""The calibration wizard in a real browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from gellight.daemon.needs import Need
from gellight.dashboard.server import DashboardServer
from gellight.frames.view import View
from tests.helpers.browsing import Open, opening, wait_until
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.scripted_calibration import WIDTH, Scripted, pressing, snapshot, stored

pytestmark = pytest.mark.browser


@pytest.fixture
def opened(browser: Browser, server: DashboardServer) -> Iterator[Open]:
    with opening(browser, server, "calibrate.html") as open_page:
        yield open_page


def wait_for(calibration: Scripted, page: Page, count: int) -> list[Any]:
    wait_until(page, lambda: len(calibration.asked) >= count)
    return calibration.asked


def test_a_calibration_begins_with_the_tools_that_were_named(opened: Open, calibration: Scripted) -> None:
    page = opened()
    expect(page.get_by_test_id("sensor")).to_have_text("E6605838833A5D2F")
    expect(page.get_by_test_id("hand")).to_be_hidden()
    expect(page.get_by_test_id("like")).to_be_hidden()
    page.get_by_test_id("ball").fill("-4")
    page.get_by_test_id("action-begin").click()  # is not sent: the first that arrives is the next
    page.get_by_test_id("ball").fill("2.5")
    page.get_by_test_id("presses").fill("24")
    page.get_by_test_id("action-begin").click()
    (begin, request), *_ = wait_for(calibration, page, 1)
    assert begin == "begin"
    assert request.pixel_size_mm is None
    page.get_by_test_id("pixel").fill("0.06")
    page.get_by_test_id("action-begin").click()
    assert wait_for(calibration, page, 2)[1][1].pixel_size_mm == 0.06
    assert (request.ball_radius_mm, request.cylinder_diameter_mm, request.presses) == (2.5, 8.0, 24)
    assert (request.hand, request.anew) == (False, False)


def test_the_unit_whose_presses_are_begun_with_is_chosen_by_its_name(opened: Open, calibration: Scripted) -> None:
    calibration.bundles = [
        stored("aaaaaaaaaaaaaaaa", created="2026-11-01T10:00:00+00:00", name="<i>left</i>", in_service=True),
        stored("bbbbbbbbbbbbbbbb", created="2026-11-02T10:00:00+00:00"),
    ]
    page = opened()
    expect(page.get_by_test_id("like").locator("option")).to_have_count(2)
    expect(page.get_by_test_id("like").locator("option").first).to_have_text("none")
    page.get_by_test_id("like").select_option(index=1)
    expect(page.get_by_test_id("like").locator("option:checked")).to_contain_text("<i>left</i>, ")
    page.get_by_test_id("presses").fill("2")
    page.get_by_test_id("action-begin").click()
    request = wait_for(calibration, page, 1)[0][1]
    assert (request.like, request.presses) == ("aaaaaaaaaaaaaaaa", 2)


def test_a_sensor_of_another_maker_is_calibrated_with_its_ball_and_a_known_pixel_size(
    opened: Open, calibration: Scripted
) -> None:
    page = opened()
    expect(page.get_by_test_id("kind-note")).to_be_hidden()
    page.get_by_test_id("kind").select_option("gelsight-mini")
    expect(page.get_by_test_id("ball")).to_have_value("2.35")
    expect(page.get_by_test_id("kind-note")).to_contain_text("shows 18.6 x 14.3 mm of gel")
    page.get_by_test_id("kind").select_option("digit")
    expect(page.get_by_test_id("ball")).to_have_value("4")
    expect(page.get_by_test_id("kind-note")).to_contain_text("has no usual ball")
    page.get_by_test_id("kind").select_option("gelsight-mini")
    page.get_by_test_id("pixel").fill("0.058")
    page.get_by_test_id("action-begin").click()
    request = wait_for(calibration, page, 1)[0][1]
    assert (request.ball_radius_mm, request.pixel_size_mm) == (2.35, 0.058)


VIEW = View.of_box((40, 30, 320, 240), (480, 640)).model_dump_json()


def test_a_view_and_marker_dots_are_chosen_before_the_start(
    opened: Open, calibration: Scripted, tmp_path: Path
) -> None:
    page = opened()
    (tmp_path / "view.json").write_text(VIEW)
    page.get_by_test_id("view").set_input_files(tmp_path / "view.json")
    page.get_by_test_id("dots").check()
    page.get_by_test_id("action-begin").click()
    ((kind, request),) = wait_for(calibration, page, 1)
    assert (kind, request.dots) == ("begin", True)
    assert (request.view.name, request.view.view().image_shape) == ("view.json", (240, 320))
    page.get_by_test_id("no-view").click()
    page.get_by_test_id("dots").uncheck()
    page.get_by_test_id("action-begin").click()
    _, request = wait_for(calibration, page, 2)[1]
    assert (request.view, request.dots) == (None, False)


def test_what_is_wrong_with_a_view_is_told_on_the_page(
    browser: Browser, server: DashboardServer, calibration: Scripted, tmp_path: Path
) -> None:
    page = browser.new_page()  # without `opened`: a refusal, 409, stands in the browser's console
    page.goto(f"{server.base}calibrate.html?token={server.token}")
    calibration.refusal = "photo.json is no view (homography is missing): make it with `gellight calibrate view`"
    (tmp_path / "photo.json").write_text("{}")
    page.get_by_test_id("view").set_input_files(tmp_path / "photo.json")
    page.get_by_test_id("action-begin").click()
    expect(page.get_by_test_id("problem")).to_have_text(calibration.refusal)
    (tmp_path / "large.json").write_bytes(b" " * 10001)
    page.get_by_test_id("view").set_input_files(tmp_path / "large.json")
    expect(page.get_by_test_id("problem")).to_have_text("")
    page.get_by_test_id("action-begin").click()
    expect(page.get_by_test_id("problem")).to_contain_text(
        "large.json is no view (10001 bytes, a view has at most 10000)"
    )
    assert len(calibration.asked) == 1, "it was not sent"
    page.close()


def test_an_interrupted_calibration_goes_on_with_its_view_and_another_can_be_chosen_where_it_is_forgotten(
    opened: Open, calibration: Scripted
) -> None:
    calibration.preparation = "a view of 320 x 240 px is taken and 120 marker dots are filled"
    page = opened()
    note, view, dots = (page.get_by_test_id(name) for name in ("picture-note", "view", "dots"))
    expect(note).to_have_text(f"Of each picture {calibration.preparation}; the calibration keeps that.")
    expect(view).to_be_hidden()
    expect(dots).to_be_hidden()
    calibration.preparation, calibration.interrupted = "", True
    calibration.interrupted_preparation = "a view of 320 x 240 px is taken"
    page = opened()
    note, view, dots = (page.get_by_test_id(name) for name in ("picture-note", "view", "dots"))
    expect(note).to_contain_text("Of each picture a view of 320 x 240 px is taken")
    expect(page.get_by_test_id("action-begin")).to_have_text("Go on")
    expect(view).to_be_hidden()
    page.get_by_test_id("anew").check()
    expect(view).to_be_visible()
    expect(dots).to_be_visible()
    expect(note).to_be_hidden()
    page.get_by_test_id("action-begin").click()
    assert wait_for(calibration, page, 1)[0][1].anew


def test_the_presses_show_instruction_advice_coverage_and_error(opened: Open, calibration: Scripted) -> None:
    calibration.routine = pressing()
    page = opened()
    expect(page.get_by_test_id("instruction")).to_contain_text("Press the ball of 4 mm radius")
    expect(page.get_by_test_id("advice")).to_have_text("4 places are empty on the left edge: about 2 more presses")
    expect(page.get_by_test_id("done")).to_have_text("18 of 40 presses")
    expect(page.get_by_test_id("steps").locator("[aria-current]")).to_have_text("Ball presses")
    expect(page.get_by_test_id("places").locator("rect")).to_have_count(48)
    counts = page.get_by_test_id("places").locator("text")
    expect(counts).to_have_count(48)
    expect(counts.nth(3)).to_have_text("3")
    empty = counts.all_text_contents().count("0")
    assert empty > 0
    expect(page.get_by_test_id("places-note")).to_have_text(f"presses that reached each place; {empty} of 48 are empty")
    expect(page.get_by_test_id("slopes").locator("path")).to_have_count(40)
    expect(page.get_by_test_id("held-out-now")).to_have_text("1.45°")
    expect(page.get_by_test_id("figures")).to_contain_text("58.80 µm")
    expect(page.get_by_test_id("request")).to_be_hidden()
    calibration.routine = pressing(problem="the press is too shallow: press deeper", advice="enough")
    expect(page.get_by_test_id("problem")).to_have_text("the press is too shallow: press deeper")
    expect(page.get_by_test_id("advice")).to_have_text("Enough: go on when you like.")


def test_the_check_list_stands_before_the_start_and_nothing_is_asked_of_you_where_a_virtual_hand_presses(
    opened: Open, calibration: Scripted
) -> None:
    calibration.needs = (
        Need(name="ball", state="yours", text="smooth and hard"),
        Need(name="disk", state="missing", text="1 MB are free: make room"),
        Need(name="training", state="ready", text="by NumPy"),
    )
    calibration.simulated = True
    page = opened()
    needs, instruction = page.get_by_test_id("needs").locator("li"), page.get_by_test_id("instruction")
    expect(needs).to_have_text(["○ballsmooth and hard", "✗disk1 MB are free: make room", "✓trainingby NumPy"])
    expect(needs.nth(1).get_by_role("img")).to_have_attribute("aria-label", "missing")
    expect(instruction).to_contain_text("a virtual hand presses everything")
    calibration.hand, calibration.routine = True, pressing()
    expect(instruction).to_contain_text("The virtual hand presses the ball")
    expect(page.get_by_test_id("advice")).to_be_empty()
    expect(page.get_by_test_id("needs")).to_be_hidden()
    calibration.hand = False
    expect(instruction).to_contain_text("Press the ball of 4 mm radius")


def test_training_draws_its_loss_the_verdict_is_told_and_then_the_live_view_is_the_first_button(
    opened: Open, calibration: Scripted
) -> None:
    page = opened()
    for epoch, loss in ((1, 0.11), (2, 0.05), (3, 0.031)):
        calibration.routine = snapshot("fit", progress={"done": epoch, "wanted": 16, "unit": "epochs", "loss": loss})
        expect(page.get_by_test_id("done")).to_have_text(f"{epoch} of 16 epochs")
    expect(page.get_by_test_id("loss-now")).to_have_text("0.0310")
    expect(page.get_by_test_id("loss")).to_be_visible()
    verdict = {"passed": True, "depth_um": 10.5, "normal_deg": 1.88, "text": "Passed. 6 fresh presses."}
    passed = snapshot("finished", verdict=verdict, figures={"verify": {"depth_mm": 0.0105}}, actions=[])
    failed = snapshot("failed", verdict={**verdict, "passed": False, "text": "Not passed."}, actions=[])
    buttons = {"passed": ["Live view", "Calibrate again"], "failed": ["Calibrate again"]}
    for name, calibration.routine in (("passed", passed), ("failed", failed), ("passed", passed)):
        expect(page.get_by_test_id("verdict")).to_have_class(f"verdict-text {name}")
        expect(page.get_by_test_id("verdict")).to_have_text(str(calibration.routine["verdict"]["text"]))
        expect(page.get_by_test_id("actions").locator("> *")).to_have_text(buttons[name])
        service = "in service: 0123456789abcdef" if name == "passed" else ""
        expect(page.get_by_test_id("bundle")).to_have_text(service)
    expect(page.get_by_test_id("figures")).to_contain_text("10.5 µm")
    page.get_by_test_id("action-live").click()
    page.wait_for_function("() => window.gellight")


def test_a_circle_is_corrected_by_dragging_and_a_press_dropped(opened: Open, calibration: Scripted) -> None:
    calibration.routine = pressing()
    page = opened()
    page.wait_for_function("() => wizard.picture === 'difference' && wizard.shown > 1")
    box = page.get_by_test_id("picture").bounding_box()
    scale = box["width"] / WIDTH
    at = lambda x, y: (box["x"] + x * scale, box["y"] + y * scale)  # noqa: E731
    page.mouse.move(*at(300, 200))
    page.mouse.down()
    page.mouse.move(*at(340, 170))
    page.mouse.up()
    action, circle = wait_for(calibration, page, 1)[0]
    assert action == "correct"
    assert circle == pytest.approx({"center_x_px": 340, "center_y_px": 170, "contact_radius_px": 60}, abs=2)
    taken = {"number": 18, "state": "corrected", **circle}
    calibration.routine = pressing(press=taken)
    shown = page.evaluate("wizard.shown")
    page.wait_for_function("shown => wizard.shown > shown + 1", arg=shown)
    page.mouse.move(*at(340 + 60, 170))
    page.mouse.down()
    page.mouse.move(*at(340 + 75, 170))
    page.mouse.up()
    action, circle = wait_for(calibration, page, 2)[1]
    assert circle == pytest.approx({"center_x_px": 340, "center_y_px": 170, "contact_radius_px": 75}, abs=2)
    page.get_by_test_id("action-drop").click()
    assert wait_for(calibration, page, 3)[2] == ("drop", {})


def test_an_old_bundle_is_restored_and_a_damaged_one_is_not_offered(opened: Open, calibration: Scripted) -> None:
    made = "2026-11-01T10:00:00+00:00"
    calibration.bundles = [
        stored("aaaaaaaaaaaaaaaa", created=made, report=True),
        stored("bbbbbbbbbbbbbbbb", problem="<b>changed</b>"),
        stored("0123456789abcdef", created=made, in_service=True),
    ]
    page = opened()
    expect(page.get_by_test_id("bundles").locator("button")).to_have_count(1)
    expect(page.get_by_test_id("bundles").locator("a")).to_have_count(1)
    with page.context.expect_page() as shown:
        page.get_by_test_id("report-aaaaaaaaaaaaaaaa").click()
    expect(shown.value.locator("h1")).to_have_css("color", "rgb(255, 0, 0)")
    shown.value.close()
    expect(page.get_by_test_id("bundles")).to_contain_text("<b>changed</b>")
    page.get_by_test_id("restore-aaaaaaaaaaaaaaaa").click()
    assert wait_for(calibration, page, 1) == [("restore", "aaaaaaaaaaaaaaaa")]
    calibration.routine = pressing()
    expect(page.get_by_test_id("restore-aaaaaaaaaaaaaaaa")).to_be_disabled()


def test_the_zero_is_set_and_the_wizard_opened_from_the_live_page(
    browser: Browser, server: DashboardServer, source: FormulaSource, calibration: Scripted
) -> None:
    drift = {"kind": "drift", "severity": "notice", "text": "the light is 96 %", "figures": {}}
    source.figures["watch"] = {"state": "at rest", "findings": [drift]}
    with opening(browser, server) as open_page:
        page = open_page()
        page.get_by_test_id("zero").click()
        expect(page.get_by_test_id("watch-answer")).to_have_text("the zero is set")
        assert (calibration.asked, source.zeros) == ([], 1)
        page.get_by_test_id("calibrate").click()
        expect(page.get_by_test_id("action-begin")).to_be_visible()
        page.get_by_test_id("back").click()
        expect(page.get_by_test_id("findings")).to_be_visible()
