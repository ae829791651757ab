"""The dashboard's server: who may connect, and what is sent to whom."""

import asyncio
import json
import socket
import threading
import time

import aiohttp
import pytest

from gellight.base.errors import CameraError, ServerError
from gellight.dashboard.application import MOST_AT_ONCE, MOST_CLIENTS, Dashboard
from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource, bump
from tests.helpers.page_client import FRAME_S, SILENCE_S, Page, get, with_pages

UPGRADE = (
    "GET /ws HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


def masked(text: bytes) -> bytes:
    """Return a short text message as a browser sends it, masked by zeros."""
    return bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text


def test_a_credit_buys_one_frame_and_no_more(server: DashboardServer, source: FormulaSource) -> None:
    async def act(page: Page) -> None:
        first = source.put(bump(1.0, 0, 0))
        assert await page.is_silent(), "no frame without a credit"
        await page.credit()
        assert (await page.frame())["sequence"] == first
        source.put(bump(1.0, 1, 0))
        assert await page.is_silent(), "the credit is spent"

    with_pages(server, 1, act)


def test_the_same_frame_is_never_sent_twice(server: DashboardServer, source: FormulaSource) -> None:
    async def act(page: Page) -> None:
        source.put(bump(1.0, 0, 0))
        await page.credit(4)
        await page.frame()
        assert await page.is_silent()

    with_pages(server, 1, act)


def test_a_page_that_comes_late_gets_the_newest_frame(server: DashboardServer, source: FormulaSource) -> None:
    async def act(page: Page) -> None:
        for i in range(20):
            last = source.put(bump(1.0, i * 0.1, 0))
        await page.credit()
        assert (await page.frame())["sequence"] == last
        for i in range(20):
            last = source.put(bump(1.0, i * 0.1, 0))
        await page.credit()
        assert (await page.frame())["sequence"] == last, "what came in between is skipped, not queued"

    with_pages(server, 1, act)


def test_a_second_page_gets_the_frame_that_is_there(server: DashboardServer, source: FormulaSource) -> None:
    async def act(early: Page, late: Page) -> None:
        sequence = source.put(bump(1.0, 0, 0))
        await early.credit()
        assert (await early.frame())["sequence"] == sequence
        await late.credit()
        assert (await late.frame())["sequence"] == sequence

    with_pages(server, 2, act)


def test_a_slow_page_does_not_slow_another(server: DashboardServer, source: FormulaSource) -> None:
    async def act(slow: Page, fast: Page) -> None:
        await slow.credit()
        for _ in range(12):
            await fast.credit()
            last = source.put(bump(1.0, 0, 0))
            assert (await fast.frame())["sequence"] == last
        await slow.frame()
        await slow.credit()
        assert (await slow.frame())["sequence"] == last, "the slow page skips to the newest"

    with_pages(server, 2, act)


def test_credits_are_bounded(server: DashboardServer, source: FormulaSource) -> None:
    async def act(page: Page) -> None:
        for _ in range(5):
            await page.credit(8)
        await page.answer(type="release")  # all credits have been seen
        for i in range(8):
            source.put(bump(1.0, i * 0.1, 0))
            await page.frame()
        source.put(bump(1.0, 0, 0))
        assert await page.is_silent()

    with_pages(server, 1, act)


def test_status_comes_by_itself_and_without_nan(server: DashboardServer, source: FormulaSource) -> None:
    source.figures["fps"], begun_s = float("nan"), time.monotonic()

    async def act(page: Page) -> None:
        status = await page.text("status")
        assert status["fps"] is None
        assert status["sensor"] == "formula://bump"
        assert status["error"] is None
        assert status["clients"] == 1
        assert status["stage"]["objects"][0] == "BALL"
        assert status["stage"]["max_depth_mm"] == 2.0
        assert begun_s < status["now_s"] < time.monotonic()
        assert (await page.text("status"))["now_s"] > status["now_s"]

    with_pages(server, 1, act)


def test_the_error_that_stops_the_frames_is_in_the_status(server: DashboardServer, source: FormulaSource) -> None:
    def fail(after_sequence: int, timeout_s: float) -> None:
        raise CameraError("the cable is out: plug it in")

    source.wait_frame = fail  # type: ignore[assignment,method-assign]

    async def act(page: Page) -> None:
        await page.credit()
        while (await page.text("status"))["error"] != "the cable is out: plug it in":
            pass
        del source.wait_frame
        sequence = source.put(bump(1.0, 0, 0))
        assert (await page.frame())["sequence"] == sequence, "frames go on once the source does"
        while (await page.text("status"))["error"] is not None:
            pass

    with_pages(server, 1, act)


def test_without_pages_no_frame_is_fetched(server: DashboardServer, source: FormulaSource) -> None:
    source.put(bump(1.0, 0, 0))
    threading.Event().wait(SILENCE_S)
    assert source.asked == 0


def test_status_is_served_as_json(server: DashboardServer) -> None:
    status, text, headers = get(server, "status")
    assert (status, headers["Content-Type"].split(";")[0]) == (200, "application/json")
    assert json.loads(text)["frames"] == 1234


def test_the_page_may_load_nothing_from_elsewhere(server: DashboardServer) -> None:
    status, text, headers = get(server, "")
    assert status == 200
    assert "<title>GelLight</title>" in text
    assert headers["Content-Security-Policy"].startswith("default-src 'self';")


@pytest.mark.parametrize("path", ["nothing", "../server.py", "%2e%2e/server.py", "vendor/../../server.py", "vendor/"])
def test_nothing_but_the_page_is_served(server: DashboardServer, path: str) -> None:
    assert get(server, path)[0] in (403, 404)


@pytest.mark.parametrize("path", ["", "status", "ws", "main.js"])
def test_another_sites_page_is_refused(server: DashboardServer, path: str) -> None:
    assert get(server, path, Origin="https://example.org")[0] == 403
    assert get(server, path, Origin="http://127.0.0.1:1")[0] == 403
    assert get(server, path, Origin="null")[0] == 403


@pytest.mark.parametrize("host", ["example.org", "192.168.1.5:8420", "127.0.0.1.example.org", ""])
def test_another_hosts_name_is_refused(server: DashboardServer, host: str) -> None:
    assert get(server, "status", Host=host)[0] == 403


def test_this_machines_own_names_are_accepted(server: DashboardServer) -> None:
    port = server.url.rsplit(":", 1)[1].strip("/")
    for host in (f"localhost:{port}", f"127.0.0.1:{port}", f"[::1]:{port}"):
        assert get(server, "status", Host=host, Origin=f"http://{host}")[0] == 200


def test_the_server_listens_on_this_machine_only(server: DashboardServer) -> None:
    port = int(server.url.rsplit(":", 1)[1].strip("/"))
    with socket.socket() as outside, pytest.raises(OSError, match="refused"):
        outside.connect(("127.0.0.2", port))


def test_a_port_in_use_names_the_port_and_the_remedy(server: DashboardServer, source: FormulaSource) -> None:
    port = int(server.url.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(ServerError, match=rf"port {port} of 127\.0\.0\.1 is in use.*--port"):
        DashboardServer(source, port=port).start()


def test_stopping_closes_the_pages_and_frees_the_port(source: FormulaSource) -> None:
    server = DashboardServer(source, port=0).start()
    port = int(server.url.rsplit(":", 1)[1].strip("/"))

    async def run() -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(server.url + "ws") as page:
            await page.receive()
            await asyncio.to_thread(server.stop)
            async with asyncio.timeout(FRAME_S):
                while (message := await page.receive()).type is aiohttp.WSMsgType.TEXT:
                    pass
            assert message.type is aiohttp.WSMsgType.CLOSE or message.type is aiohttp.WSMsgType.CLOSED

    asyncio.run(run())
    server.stop()
    with DashboardServer(source, port=port) as again:
        assert get(again, "status")[0] == 200
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
        await loop.sock_connect(deaf, ("127.0.0.1", int(server.url.rsplit(":", 1)[1].strip("/"))))
        host = server.url.split("/")[2]
        await loop.sock_sendall(deaf, UPGRADE.format(host=host).encode())
        await loop.sock_recv(deaf, 100)
        for _ in range(12):
            await loop.sock_sendall(deaf, masked(b'{"type": "credit", "count": 8}'))
            source.put(bump(1.0, 0, 0))
            await asyncio.sleep(0.05)
        stopping = threading.Thread(target=server.stop)
        stopping.start()
        await asyncio.to_thread(stopping.join, 2 * FRAME_S)
        ended = not stopping.is_alive()
        deaf.close()
        await asyncio.to_thread(stopping.join)
        assert ended, "the server waits for a page that reads nothing"

    asyncio.run(run())


def test_a_thousand_pages_at_once_leave_the_others_their_frames(server: DashboardServer, source: FormulaSource) -> None:
    """Beyond 32 each is told why, and every place that becomes free is given away again."""

    async def act(page: Page) -> None:
        async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as session:
            wanted = [session.ws_connect(f"{server.url}ws", timeout=aiohttp.ClientWSTimeout(10)) for _ in range(1000)]
            answers = await asyncio.gather(*wanted, return_exceptions=True)
            refused = [one for one in answers if isinstance(one, aiohttp.WSServerHandshakeError)]
            assert (len(answers) - len(refused), {one.status for one in refused}) == (MOST_CLIENTS - 1, {503})
            await page.credit()
            last = source.put(bump(1.0, 0, 0))
            assert (await page.frame())["sequence"] == last
            for one in answers:
                if isinstance(one, aiohttp.ClientWebSocketResponse):
                    await one.close()
            again = await session.ws_connect(f"{server.url}ws")
            await again.close()

    with_pages(server, 1, act)


def test_a_page_that_commands_faster_than_is_done_is_told_to_wait(
    server: DashboardServer, source: FormulaSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on = threading.Event()
    monkeypatch.setattr(Dashboard, "_move_stage", lambda *_: go_on.wait(20))

    async def act(page: Page) -> None:
        for _ in range(3 * MOST_AT_ONCE):
            await page.send(type="release")
        answer = await page.text("error", "done")
        go_on.set()
        assert answer["message"] == f"{MOST_AT_ONCE} commands are being carried out: wait for them"

    with_pages(server, 1, act)
