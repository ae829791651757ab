"""A scan led by the page, in a real browser: presses beside each other, the map, undo, and the folder of the verb."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from gellight.base.errors import InputError
from gellight.daemon.assembly import open_session
from gellight.dashboard.server import DashboardServer
from gellight.lab.report.pictures import encode_png
from gellight_scan.beside import ScanBeside
from gellight_scan.scan import Scan
from tests.helpers.browsing import opening
from tests.helpers.dashboard_source import FormulaSource, two_bumps
from tests.helpers.settings import loaded
from tests.helpers.windows import SIZES, window, wrong

pytestmark = pytest.mark.browser

PATIENCE_MS = 200_000
"""a press is computed, held and joined, which takes a minute beside much else"""


def says(page: Page, words: str) -> None:
    expect(page.get_by_test_id("scan-said")).to_contain_text(words, timeout=PATIENCE_MS)


def test_the_page_leads_a_scan_of_the_simulated_part(browser: Browser, tmp_path: Path) -> None:
    with (
        open_session(loaded({"sensor.url": "sim://?board=0"})) as daemon,
        ScanBeside(daemon, root=tmp_path) as scan,
        DashboardServer(daemon, port=0, scan=scan) as server,
        opening(browser, server) as open_page,
    ):
        page = open_page()
        page.get_by_test_id("scan").click()
        page.get_by_test_id("scan-start").click()
        page.get_by_test_id("scan-here").click()
        says(page, "press 0: the gel reached")
        page.get_by_test_id("scan-right").click()
        says(page, "press 1: the gel reached")
        says(page, "joined to 0")
        expect(page.locator("#scan-map .pressed")).to_have_count(2)
        assert page.evaluate("() => fetch('scan/map').then((answer) => answer.status)") == 200
        assert page.evaluate("() => fetch('scan/file/map.ply').then((answer) => answer.status)") == 200
        with page.expect_download() as saving:
            page.get_by_test_id("scan-files").get_by_text("X3P").click()
        kept = tmp_path / saving.value.suggested_filename
        saving.value.save_as(kept)
        assert kept.name == "map.x3p"
        assert "main.xml" in zipfile.ZipFile(kept).namelist()
        page.get_by_test_id("scan-undo").click()
        says(page, "press 1 is taken back")
        expect(page.locator("#scan-map .pressed")).to_have_count(1)
        page.get_by_test_id("scan-below").click()
        says(page, "joined to 0")
        page.get_by_test_id("scan-end").click()
        expect(page.get_by_test_id("scan-step")).to_have_text("Ended")
    again = Scan(tmp_path / "part")
    assert again.placed == [0, 1]
    shift_mm = again.solved.poses[1][:2, 3]
    assert shift_mm == pytest.approx([0, 14.1], abs=0.2), "the sensor went down the part by half a view"


class HandScan:
    """A scan on a real sensor that shows all that the page has a place for."""

    def state(self) -> dict[str, object]:
        corners = np.array([[0, 0], [37.6, 0], [37.6, 28.2], [0, 28.2]])
        return {
            "scanning": True, "phase": "press", "refused": True, "said": "it could not be joined: press again " * 4,
            "folder": "/a/folder/with/a/long/name" * 4, "presses": 12, "last": 11, "lost": [4, 7, 9], "version": 3,
            "map": {"size_mm": [56.4, 42.3], "reached": 0.21, "seam_um": 2.3},
            "outlines": {0: corners.tolist(), 11: (corners + np.array([18.8, 14.1])).tolist()},
            "sides": {"right": {"shift_mm": [22.6, 0], "outline": (corners + np.array([41.4, 14.1])).tolist()}},
        }  # fmt: skip

    def picture(self) -> bytes:
        return encode_png(np.zeros((42, 56, 3), np.uint8))

    def begin(self, name: str) -> None: ...
    def take_back(self) -> None:
        raise InputError("the disk is full")

    def end(self) -> None: ...
    def file(self, name: str) -> bytes:
        raise InputError("there is no map yet")


def test_a_hand_is_told_where_to_press_and_what_was_refused(browser: Browser) -> None:
    source = FormulaSource()
    source.put(two_bumps(truth_factor=1.02))
    with (
        DashboardServer(source, port=0, scan=HandScan()) as server,  # type: ignore[arg-type]
        window(browser, server.url, "() => gellight.drawn > 0") as (page, resize),
    ):
        expect(page.get_by_test_id("scan-sides")).to_have_text("not scanned yet: right")
        for size in ("phone", "tablet", "laptop"):
            for scheme in ("light", "dark"):
                resize(*SIZES[size])
                page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
                assert wrong(page, "overlaps", "cut", "beyond") == {}, (size, scheme)
        page.get_by_test_id("scan-undo").click()
        expect(page.get_by_test_id("scan-said")).to_have_text("the disk is full")
        page.get_by_test_id("scan-files").get_by_text("STL").click()
        expect(page.get_by_test_id("scan-said")).to_have_text("there is no map yet")
        expect(page.get_by_test_id("scan-said")).to_have_class("hint wrong")
