"""Several sensors are several daemons: the page of one offers those of the others."""

import asyncio
import json
from collections.abc import Iterator
from unittest.mock import Mock

import pytest
from aiohttp import web
from playwright.sync_api import expect

from gellight.dashboard import application
from gellight.dashboard.server import DashboardServer
from gellight.stream.running import announced
from tests.helpers.browsing import Open
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.page_client import get


@pytest.fixture
def other(server: DashboardServer) -> Iterator[DashboardServer]:
    """The page of a second sensor; both daemons are announced, and a third one that has no page."""
    with (
        DashboardServer(FormulaSource(), port=0) as other,
        announced("left", "tcp/127.0.0.1:1", "sim://", page=server.url, numbered=False),
        announced("right", "tcp/127.0.0.1:2", "sim://", page=other.url, numbered=False),
        announced("bare", "tcp/127.0.0.1:3", "sim://", numbered=False),
    ):
        yield other


def test_a_browser_of_this_computer_is_told_of_the_other_pages(server: DashboardServer, other: DashboardServer) -> None:
    status, text, _ = get(f"{server.base}sensors")
    assert status == 200
    assert json.loads(text) == [{"name": "left", "page": server.url}, {"name": "right", "page": other.url}]


@pytest.mark.usefixtures("other")
def test_another_computer_is_told_of_none_for_the_addresses_have_tokens() -> None:
    answer = asyncio.run(application._list_sensors(Mock(web.Request, remote="192.168.0.7")))
    assert json.loads(answer.text or "") == []


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
def test_one_sensor_alone_has_nothing_to_choose(opened: Open, server: DashboardServer) -> None:
    with announced("left", "tcp/127.0.0.1:1", "sim://", page=server.url, numbered=False):
        page = opened()
        with page.expect_response("**/sensors"):
            pass
        expect(page.get_by_test_id("sensors")).to_be_hidden()
