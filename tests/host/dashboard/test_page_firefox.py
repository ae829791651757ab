"""The live page in Firefox: what the other tests prove in Chromium, once."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource, two_bumps
from tests.helpers.firefox import Firefox, firefox

pytestmark = pytest.mark.nightly


@pytest.fixture
def page(server: DashboardServer, source: FormulaSource, tmp_path: Path) -> Iterator[Firefox]:
    program = shutil.which("firefox-esr") or shutil.which("firefox")
    if program is None:
        pytest.skip("needs Firefox: sudo apt-get install firefox-esr")
    source.put(two_bumps(truth_factor=1.02))
    with firefox(program, tmp_path) as page:
        page.open(server.url)
        page.wait("window.gellight?.drawn > 0 && gellight.surface !== 'waiting'")
        yield page
        assert page.complaints == []


def text(page: Firefox, element: str) -> str:
    return str(page.evaluate(f"document.getElementById('{element}').textContent"))


def test_figures_pictures_and_contacts_are_drawn(page: Firefox) -> None:
    page.wait("document.getElementById('contacts').rows.length === 2")
    assert text(page, "indentation") == "1.000"
    assert text(page, "truth-error").startswith("indentation 1.020 mm")
    for name in ("depth", "truth", "image", "difference", "normal"):
        page.wait(f"""(() => {{ const canvas = document.getElementById('{name}');
            const {{ data }} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            return new Set(new Uint32Array(data.buffer)).size > 20; }})()""")


def test_a_press_arrives_where_the_mouse_points_and_follows_it(page: Firefox, source: FormulaSource) -> None:
    page.wait("!document.getElementById('press').hidden")
    page.drag("depth", (0.5, 0.5), (0.75, 0.25))
    page.wait("document.getElementById('stage-now').textContent.includes('nothing')")
    *presses, released = source.stage.calls
    first, last = presses[0], presses[-1]
    assert first[2:] == pytest.approx((0.0, 0.0), abs=0.3)
    assert last[2:] == pytest.approx((9.4, -7.1), abs=0.3)
    assert released is None


def test_a_line_gives_its_section(page: Firefox) -> None:
    page.evaluate("document.getElementById('measure').click()")
    page.drag("depth", (0.2, 0.6), (0.9, 0.6))
    page.wait("gellight.section")
    assert "mm long, deepest" in text(page, "section-text")
