"""The dashboard's server: who may connect, and what is sent to whom."""

import asyncio
import json
import re
import resource
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import islice
from unittest.mock import Mock
from urllib.parse import urlsplit

import aiohttp
import pytest

from gellight.base.errors import CameraError, ServerError
from gellight.dashboard.metrics import metric_lines
from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource, bump
from tests.helpers.page_client import SILENCE_S, Page, bearer, get, pages, post

END_S = 10.0
"""within which a server ends that waits for nobody"""
UPGRADE = (
    "GET /ws HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\nAuthorization: {bearer}\r\n\r\n"
)


def masked(text: bytes) -> bytes:
    """Return a short text message as a browser sends it, masked by zeros."""
    return bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text


def test_a_credit_buys_one_frame_which_is_the_newest_and_never_the_same_twice(
    client: Page, source: FormulaSource
) -> None:
    for i in range(20):
        last = source.put(bump(1.0, i * 0.1, 0))
    assert client.is_silent(), "no frame without a credit"
    client.credit()
    assert client.frame()["sequence"] == last
    for i in range(20):
        last = source.put(bump(1.0, i * 0.1, 0))
    assert client.is_silent(), "the credit is spent"
    client.credit(4)
    assert client.frame()["sequence"] == last, "what came in between is skipped, not queued"
    assert client.is_silent(), "it is not sent twice"


def test_a_slow_page_does_not_slow_another(open_page: Callable[[], Page], source: FormulaSource) -> None:
    slow, fast = open_page(), open_page()
    slow.credit()
    for _ in range(12):
        fast.credit()
        last = source.put(bump(1.0, 0, 0))
        assert fast.frame()["sequence"] == last
    slow.frame()
    slow.credit()
    assert slow.frame()["sequence"] == last, "the slow page skips to the newest"


def test_credits_are_bounded(client: Page, source: FormulaSource) -> None:
    for _ in range(5):
        client.credit(8)
    client.send("0")
    client.text("error")  # all credits have been seen
    for i in range(8):
        source.put(bump(1.0, i * 0.1, 0))
        client.frame()
    source.put(bump(1.0, 0, 0))
    assert client.is_silent()


def test_status_comes_by_itself_and_without_nan(open_page: Callable[[], Page], source: FormulaSource) -> None:
    source.figures["fps"], begun_s = float("nan"), time.monotonic()
    page = open_page()
    status = page.text("status")
    assert status["fps"] is None
    assert status["sensor"] == "formula://bump"
    assert status["error"] is None
    assert status["clients"] == 1
    assert status["stage"]["objects"][0] == "BALL"
    assert status["stage"]["max_depth_mm"] == 2.0
    assert begun_s < status["now_s"] < time.monotonic()
    assert page.text("status")["now_s"] > status["now_s"]


def test_the_error_that_stops_the_frames_is_in_the_status(client: Page, source: FormulaSource) -> None:
    source.wait_frame = Mock(side_effect=CameraError("the cable is out: plug it in"))  # type: ignore[assignment,method-assign]
    client.credit()
    while client.text("status")["error"] != "the cable is out: plug it in":
        pass
    del source.wait_frame
    sequence = source.put(bump(1.0, 0, 0))
    assert client.frame()["sequence"] == sequence, "frames go on once the source does"
    while client.text("status")["error"] is not None:
        pass


def test_without_pages_no_frame_is_fetched(server: DashboardServer, source: FormulaSource) -> None:
    source.put(bump(1.0, 0, 0))
    threading.Event().wait(SILENCE_S)
    assert source.asked == 0


def test_the_page_may_load_nothing_from_elsewhere(server: DashboardServer) -> None:
    status, text, headers = get(server.base)
    assert status == 200
    assert "<title>GelLight</title>" in text
    assert headers["Content-Security-Policy"].startswith("default-src 'self';")


def test_a_request_that_is_too_long_is_refused_without_a_traceback(
    server: DashboardServer, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    with socket.create_connection(("127.0.0.1", urlsplit(server.base).port or 0), 5) as client:
        client.sendall(b"GET /" + b"a" * 20_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert client.recv(100).startswith(b"HTTP/1.0 400 Bad Request")
    assert (capfd.readouterr().err, caplog.text) == ("", "")


@pytest.mark.parametrize("path", ["", "status", "ws", "main.js"])
def test_another_sites_page_is_refused(server: DashboardServer, path: str) -> None:
    for origin in ("https://example.org", "http://127.0.0.1:1", "null"):
        assert get(server.base + path, headers={"Origin": origin})[0] == 403


@pytest.mark.parametrize("host", ["example.org", "192.168.1.5:8420", "127.0.0.1.example.org", "", "[", ":x"])
def test_a_page_of_a_name_that_points_here_has_no_cookie(server: DashboardServer, host: str) -> None:
    assert get(server.base + "status", headers={"Host": host, "Authorization": ""})[0] == 401


def test_this_machines_own_names_are_accepted(server: DashboardServer) -> None:
    port = server.base.rsplit(":", 1)[1].strip("/")
    for host in (f"localhost:{port}", f"127.0.0.1:{port}", f"[::1]:{port}"):
        assert get(server.base + "status", headers={"Host": host, "Origin": f"http://{host}"})[0] == 200


def test_a_port_in_use_names_the_port_and_the_remedy(server: DashboardServer, source: FormulaSource) -> None:
    port = int(server.base.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(ServerError, match=rf"port {port} of 127\.0\.0\.1 is in use.*dashboard\.port"):
        DashboardServer(source, port=port).start()


def test_stopping_closes_the_pages_and_frees_the_port(source: FormulaSource) -> None:
    server = DashboardServer(source, port=0).start()
    port = int(server.base.rsplit(":", 1)[1].strip("/"))
    with pages() as connect:
        page = connect(server.base)
        page.text("status")
        server.stop()
        assert page.is_closed()
    server.stop()
    with DashboardServer(source, port=port) as again:
        assert get(again.base + "status")[0] == 200
    assert not [thread.name for thread in threading.enumerate() if thread.name.startswith("dashboard")]


def test_a_page_that_reads_nothing_does_not_hold_up_the_end(source: FormulaSource) -> None:
    server = DashboardServer(source, port=0).start()
    source.put(bump(1.0, 0, 0))

    async def run() -> None:
        """Ask for frames and read none, until what waits for the page stays where it is."""
        deaf = socket.socket()
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.setblocking(False)
        loop = asyncio.get_running_loop()
        await loop.sock_connect(deaf, ("127.0.0.1", int(server.base.rsplit(":", 1)[1].strip("/"))))
        host = server.base.split("/")[2]
        await loop.sock_sendall(deaf, UPGRADE.format(host=host, bearer=bearer()["Authorization"]).encode())
        await loop.sock_recv(deaf, 100)
        for _ in range(12):
            await loop.sock_sendall(deaf, masked(b'{"count": 8}'))
            source.put(bump(1.0, 0, 0))
            await asyncio.sleep(0.05)
        stopping = threading.Thread(target=server.stop)
        stopping.start()
        await asyncio.to_thread(stopping.join, END_S)
        ended = not stopping.is_alive()
        deaf.close()
        await asyncio.to_thread(stopping.join)
        assert ended, "the server waits for a page that reads nothing"

    asyncio.run(run())


def test_a_thousand_pages_at_once_leave_the_others_their_frames(
    server: DashboardServer, client: Page, source: FormulaSource
) -> None:
    """Beyond 32 each is told why, and every place that becomes free is given away again."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, most), most))  # both ends of each lie in this process

    async def crowd() -> None:
        async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0), headers=bearer()) as session:
            wanted = [session.ws_connect(f"{server.base}ws", timeout=aiohttp.ClientWSTimeout(60)) for _ in range(1000)]
            answers = await asyncio.gather(*wanted, return_exceptions=True)
            refused = [one for one in answers if isinstance(one, aiohttp.WSServerHandshakeError)]
            assert (len(answers) - len(refused), {one.status for one in refused}) == (31, {503})
            await asyncio.to_thread(client.credit)
            last = source.put(bump(1.0, 0, 0))
            assert (await asyncio.to_thread(client.frame))["sequence"] == last
            for one in answers:
                if isinstance(one, aiohttp.ClientWebSocketResponse):
                    await one.close()
            again = await session.ws_connect(f"{server.base}ws")
            await again.close()

    asyncio.run(crowd())


def test_who_commands_faster_than_is_done_is_told_to_wait(server: DashboardServer, source: FormulaSource) -> None:
    assert source.stage is not None
    source.stage.may_prepare.clear()
    press = {"type": "press", "object": "BALL", "depth_mm": 0.5, "x_mm": 0.0, "y_mm": 0.0}
    with ThreadPoolExecutor(20) as crowd:
        answers = [crowd.submit(post, server.base, press) for _ in range(20)]
        refused = [answer.result() for answer in islice(as_completed(answers), 4)]
        source.stage.may_prepare.set()
    told = {"message": "16 commands are being carried out: wait for them"}
    assert refused == [(429, told)] * 4
    assert sorted(answer.result()[0] for answer in answers) == [200] * 16 + [429] * 4


# ---- what Prometheus and a health check are told ----


LINE = re.compile(r'[a-z_]+(\{[a-z]+="[^"]*"\})? [-+0-9.e]+')


def test_every_figure_has_its_type_and_a_number(server: DashboardServer) -> None:
    _, text, headers = get(server.base + "metrics")
    assert headers["Content-Type"].startswith("text/plain; version=0.0.4")
    lines = text.splitlines()
    values = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
    assert [line for line in lines if not line.startswith("# ") and not LINE.fullmatch(line)] == []
    assert values["gellight_frames_total"] == "1234"
    assert values["gellight_up"] == "1"
    assert values['gellight_frame_age_seconds{quantile="0.95"}'] == "0.0178"
    assert values['gellight_stage_seconds{stage="gelnet"}'] == "0.0081"
    assert {line.split()[2] for line in lines if line.startswith("# TYPE")} == {
        line.partition("{")[0] for line in values
    }


def test_health_is_200_or_503_with_the_reason(source: FormulaSource, server: DashboardServer) -> None:
    status, text, _ = get(server.base + "health")
    assert (status, json.loads(text)) == (200, {"ok": True, "error": None})
    source.error = "reconnecting to sensor A"
    status, text, _ = get(server.base + "health")
    assert (status, json.loads(text)["error"]) == (503, "reconnecting to sensor A")


def test_touch_force_findings_and_counters_are_shown_whole_where_they_are_known() -> None:
    weighed = {"touch": {"indentation_mm": 0.5, "area_mm2": 9.0, "force": {"normal_n": 1.25, "error_n": 0.1}}}
    assert {"gellight_indentation_mm 0.5", "gellight_force_newtons 1.25"} <= set(metric_lines(weighed))
    for unknown in ({"touch": None}, {"touch": {**weighed["touch"], "force": None}}):
        assert not [line for line in metric_lines(unknown) if "force" in line]
    status = {"error": "away", "frames": 0, "fps": 0.0, "frame_age_ms": {}, "watch": {"findings": [{"kind": "drift"}]}}
    lines = list(metric_lines(status))
    assert 'gellight_finding{kind="drift"} 1' in lines
    assert "gellight_up 0" in lines
    assert not [line for line in lines if "celsius" in line or "frame_age" in line or "indentation" in line]
    warm = metric_lines({"ring": {"chip_c": 41.4, "ring_c": None}})
    assert [line for line in warm if line.startswith("gellight_light")] == ['gellight_light_celsius{part="chip"} 41.4']
    for frames in (999_999, 1_000_001, 12_345_678_901):
        assert f"gellight_frames_total {frames}" in list(metric_lines({"frames": frames, "error": None}))
