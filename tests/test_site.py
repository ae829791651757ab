"""`make docs`: the site is built, strictly, and has what is made of the commands and the docstrings."""

import json
import re
import sys
from pathlib import Path

import pytest
from typer.main import get_command

import gellight
from gellight.cli.main import app
from tests.helpers.children import run
from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build it; a link that leads nowhere fails."""
    out = tmp_path_factory.mktemp("site")
    done = run([sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", out], cwd=CHECKOUT)
    assert done.returncode == 0, done.stderr
    return out


def test_every_verb_has_a_page_with_all_that_stands_below_it(site: Path) -> None:
    verbs = vars(get_command(app))["commands"]
    assert {page.name for page in (site / "verbs").iterdir()} == set(verbs)
    page = (site / "verbs/calibrate/index.html").read_text()
    for text in ("gellight calibrate fit", "--ball-radius-mm", "Radius of the ball"):
        assert text in page


def test_every_public_name_is_described(site: Path) -> None:
    page = (site / "api/index.html").read_text()
    for name in gellight.__all__:
        assert name.startswith("_") or f".{name}" in page
    assert "newest frame" in page


def test_the_search_finds_pages_and_the_front_page_has_its_pictures(site: Path) -> None:
    found = json.loads((site / "search/search_index.json").read_text())["docs"]
    assert any("bundle" in entry["text"] for entry in found if entry["location"].startswith("glossary"))
    assert 'data-md-component="search"' in (site / "index.html").read_text()
    assert "sensor.press" in re.sub("<[^>]*>", "", (site / "first_touch/index.html").read_text())
    assert 'src="pictures/press.webp"' in (site / "index.html").read_text()
    assert (site / "pictures/press.webp").exists()
