"""Several sensors are several daemons: the page of one offers those of the others."""

import asyncio
import json
from collections.abc import Iterator
from unittest.mock import Mock

import pytest
from aiohttp import web
from playwright.sync_api import expect

from gellight.cli import one_sensor
from gellight.dashboard.application import Dashboard
from gellight.dashboard.server import DashboardServer
from gellight.stream.running import announced
from tests.helpers.browsing import Open
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.page_client import get


@pytest.fixture
def pages() -> dict[str, str]:
    return {}


@pytest.fixture
def server(source: FormulaSource, pages: dict[str, str]) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0, sensors=lambda: pages) as server:
        pages["left"] = server.url
        yield server


@pytest.fixture
def other(pages: dict[str, str]) -> Iterator[DashboardServer]:
    """The page of a second sensor."""
    with DashboardServer(FormulaSource(), port=0, sensors=lambda: pages) as other:
        pages["right"] = other.url
        yield other


def test_a_browser_of_this_computer_alone_is_told_of_all_pages(
    server: DashboardServer, other: DashboardServer, source: FormulaSource
) -> None:
    status, text, _ = get(f"{server.base}sensors")
    assert status == 200
    assert json.loads(text) == {"left": server.url, "right": other.url}
    dashboard = Dashboard(source, sensors=lambda: {"left": "http://127.0.0.1:8420/?token=secret"})
    answer = asyncio.run(dashboard._list_sensors(Mock(web.Request, remote="192.168.0.7")))
    assert json.loads(answer.text or "") == {}
    with (
        announced("left", "tcp/127.0.0.1:1", "sim://", page="http://127.0.0.1:8420/?token=secret", numbered=False),
        announced("bare", "tcp/127.0.0.1:2", "sim://", numbered=False),
    ):
        assert one_sensor.pages() == {"left": "http://127.0.0.1:8420/?token=secret"}


@pytest.mark.browser
def test_the_page_leads_to_that_of_another_sensor(opened: Open, other: DashboardServer) -> None:
    page = opened()
    choice = page.get_by_test_id("sensors")
    expect(choice).to_be_visible()
    assert choice.locator("option").all_text_contents() == ["left", "right"]
    expect(choice.locator("option:checked")).to_have_text("left")
    choice.select_option("right")
    page.wait_for_url(f"{other.base}**")
    expect(page.get_by_test_id("sensors").locator("option:checked")).to_have_text("right")


@pytest.mark.browser
def test_one_sensor_alone_has_nothing_to_choose(opened: Open) -> None:
    page = opened()
    with page.expect_response("**/sensors"):
        pass
    expect(page.get_by_test_id("sensors")).to_be_hidden()
