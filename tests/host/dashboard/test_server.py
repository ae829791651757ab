"""The dashboard's server: who may connect, what is sent to whom, and what happens to nonsense."""

import asyncio
import json
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import aiohttp
import pytest

from gellight.base.errors import CameraError, InputError, ServerError
from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import HEIGHT, PIXEL_MM, WIDTH, FormulaSource, RecordingStage, bump
from tests.helpers.scripted_calibration import Scripted
from tests.helpers.view_messages import decode

FRAME_S = 5.0
"""more than any frame needs, even on a loaded machine"""
SILENCE_S = 0.6
UPGRADE = (
    "GET /ws HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


def masked(text: bytes) -> bytes:
    """Return a short text message as a browser sends it, masked by zeros."""
    return bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text


@pytest.fixture
def source() -> FormulaSource:
    return FormulaSource(stage=RecordingStage())


@pytest.fixture
def server(source: FormulaSource) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0) as server:
        yield server


class Page:
    """A client that speaks as the page does."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket

    async def send(self, **command: object) -> None:
        await self.socket.send_json(command)

    async def credit(self, count: int = 1) -> None:
        await self.send(type="credit", count=count)

    async def frame(self, timeout_s: float = FRAME_S) -> dict[str, Any]:
        """Return the header of the next frame."""
        async with asyncio.timeout(timeout_s):
            while True:
                message = await self.socket.receive()
                if message.type is aiohttp.WSMsgType.BINARY:
                    return decode(message.data).header
                assert message.type is aiohttp.WSMsgType.TEXT, message

    async def text(self, *kinds: str) -> dict[str, Any]:
        """Return the next text message of one of `kinds`."""
        async with asyncio.timeout(FRAME_S):
            while True:
                message = await self.socket.receive()
                assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message
                if message.type is aiohttp.WSMsgType.TEXT and (found := json.loads(message.data))["type"] in kinds:
                    return found

    async def answer(self, **command: object) -> dict[str, Any]:
        await self.send(**command)
        return await self.text("done", "error")

    async def is_silent(self) -> bool:
        try:
            await self.frame(SILENCE_S)
        except TimeoutError:
            return True
        return False


def with_pages(server: DashboardServer, count: int, act: Callable[..., Awaitable[None]]) -> None:
    """Run `act` with `count` connected pages."""

    async def run() -> None:
        async with aiohttp.ClientSession() as session:
            sockets = [await session.ws_connect(server.url + "ws", max_msg_size=0) for _ in range(count)]
            await act(*(Page(socket) for socket in sockets))

    asyncio.run(run())


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
    source.figures["fps"] = float("nan")

    async def act(page: Page) -> None:
        status = await page.text("status")
        assert status["fps"] is None
        assert status["sensor"] == "formula://bump"
        assert status["error"] is None
        assert status["clients"] == 1
        assert status["stage"]["objects"][0] == "BALL"
        assert status["stage"]["max_depth_mm"] == 2.0
        assert abs(status["now_s"] - time.monotonic()) < FRAME_S
        assert (await page.text("status"))["now_s"] > status["now_s"]

    with_pages(server, 1, act)


def test_press_and_release_reach_the_stage(server: DashboardServer, source: FormulaSource) -> None:
    async def act(page: Page) -> None:
        await page.credit()
        source.put(bump(1.0, 0, 0))
        await page.frame()
        press = {"type": "press", "object": "WAVE", "depth_mm": 0.75, "x_mm": -3, "y_mm": 4.5}
        assert await page.answer(**press) == {"type": "done", "command": "press"}
        assert await page.answer(type="release") == {"type": "done", "command": "release"}

    with_pages(server, 1, act)
    assert source.stage is not None
    assert source.stage.calls == [("WAVE", 0.75, -3.0, 4.5), None]


def test_a_running_calibration_is_in_the_status_and_nobody_else_may_press(source: FormulaSource) -> None:
    calibration = Scripted()
    calibration.calibrating = True

    async def act(page: Page) -> None:
        await page.credit()
        source.put(bump(1.0, 0, 0))
        await page.frame()
        assert (await page.text("status"))["calibrating"] is True
        for command in (PRESS, {"type": "release"}):
            assert "a calibration is running" in (await page.answer(**command))["message"]
        calibration.calibrating = False
        assert (await page.answer(**PRESS))["type"] == "done"
        while (await page.text("status"))["calibrating"]:
            pass

    with DashboardServer(source, port=0, calibration=calibration) as server:  # type: ignore[arg-type]
        with_pages(server, 1, act)
    assert source.stage is not None
    assert source.stage.calls == [("BALL", 0.5, 0.0, 0.0)]


def test_a_press_is_computed_before_it_is_made_and_stops_neither_frames_nor_status(
    server: DashboardServer, source: FormulaSource
) -> None:
    assert source.stage is not None
    stage = source.stage

    async def act(page: Page) -> None:
        await page.credit(8)
        source.put(bump(1.0, 0, 0))
        await page.frame()
        stage.may_prepare.clear()
        await page.send(**PRESS)
        while not stage.prepared:
            await asyncio.sleep(0.01)
        sequence = source.put(bump(1.0, 0, 0))
        assert (await page.frame())["sequence"] == sequence
        first = await page.text("status")
        assert (await page.text("status"))["now_s"] > first["now_s"]
        assert stage.calls == []
        stage.may_prepare.set()
        assert (await page.text("done", "error"))["type"] == "done"

    with_pages(server, 1, act)
    assert stage.calls == [("BALL", 0.5, 0.0, 0.0)]


def test_an_object_that_is_released_while_it_is_computed_is_not_pressed(
    server: DashboardServer, source: FormulaSource
) -> None:
    assert source.stage is not None
    stage = source.stage

    async def act(page: Page) -> None:
        await page.credit()
        source.put(bump(1.0, 0, 0))
        await page.frame()
        stage.may_prepare.clear()
        await page.send(**PRESS)
        while not stage.prepared:
            await asyncio.sleep(0.01)
        assert await page.answer(type="release") == {"type": "done", "command": "release"}
        stage.may_prepare.set()
        assert await page.text("done", "error") == {"type": "done", "command": "press"}

    with_pages(server, 1, act)
    assert stage.calls == [None]


PRESS = {"type": "press", "object": "BALL", "depth_mm": 0.5, "x_mm": 0.0, "y_mm": 0.0}
HALF_VIEW_MM = (WIDTH * PIXEL_MM / 2, HEIGHT * PIXEL_MM / 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "Invalid JSON"),
        ("[]", "Input should be"),
        ("{}", "Unable to extract tag"),
        ('{"type": "explode"}', "explode"),
        (json.dumps(PRESS | {"object": "HAND"}), "no object 'HAND': choose one of BALL"),
        (json.dumps(PRESS | {"depth_mm": -0.1}), "depth_mm: Input should be greater than or equal to 0"),
        (json.dumps(PRESS | {"depth_mm": 2.01}), "depth_mm = 2.01 is too deep: choose 0 to 2"),
        (json.dumps(PRESS | {"depth_mm": float("nan")}), "depth_mm: Input should be a finite number"),
        (json.dumps(PRESS | {"x_mm": float("inf")}), "x_mm: Input should be a finite number"),
        (json.dumps(PRESS | {"x_mm": HALF_VIEW_MM[0] + 0.01}), "x_mm = 18.826 is outside the view"),
        (json.dumps(PRESS | {"y_mm": -HALF_VIEW_MM[1] - 0.01}), "y_mm = -14.122 is outside the view"),
        (json.dumps(PRESS | {"y_mm": "0"}), "y_mm: Input should be a valid number"),
        (json.dumps(PRESS | {"force": 1}), "force: Extra inputs are not permitted"),
        ('{"type": "press"}', "object: Field required"),
        ('{"type": "credit", "count": 0}', "count: Input should be greater than or equal to 1"),
        ('{"type": "credit", "count": 1e99}', "count: Input should be a valid integer"),
    ],
)
def test_a_bad_command_is_answered_and_harms_nothing(
    server: DashboardServer, source: FormulaSource, text: str, said: str
) -> None:
    async def act(page: Page) -> None:
        await page.credit()
        source.put(bump(1.0, 0, 0))
        await page.frame()
        await page.socket.send_str(text)
        assert said in (await page.text("done", "error"))["message"]
        assert (await page.answer(**PRESS))["type"] == "done"

    with_pages(server, 1, act)
    assert source.stage is not None
    assert source.stage.calls == [("BALL", 0.5, 0.0, 0.0)]


def test_binary_commands_are_answered_with_an_error(server: DashboardServer) -> None:
    async def act(page: Page) -> None:
        await page.socket.send_bytes(b"\0\1")
        assert "not binary" in (await page.text("error"))["message"]

    with_pages(server, 1, act)


def test_a_huge_command_closes_only_its_own_connection(server: DashboardServer) -> None:
    async def act(greedy: Page, other: Page) -> None:
        await greedy.socket.send_str(" " * 100_000)
        async with asyncio.timeout(FRAME_S):
            while (message := await greedy.socket.receive()).type is aiohttp.WSMsgType.TEXT:
                pass
        assert message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)
        assert (await other.answer(type="release"))["type"] == "done"

    with_pages(server, 2, act)


def test_a_press_before_the_first_frame_is_answered(server: DashboardServer) -> None:
    async def act(page: Page) -> None:
        assert "no frame has been seen yet" in (await page.answer(**PRESS))["message"]

    with_pages(server, 1, act)


def test_what_the_stage_refuses_is_told(server: DashboardServer, source: FormulaSource) -> None:
    def refuse() -> None:
        raise InputError("the stage is stuck: oil it")

    assert source.stage is not None
    source.stage.release = refuse  # type: ignore[method-assign]

    async def act(page: Page) -> None:
        answer = await page.answer(type="release")
        assert answer == {"type": "error", "command": "release", "message": "the stage is stuck: oil it"}

    with_pages(server, 1, act)


def test_a_sensor_without_stage_says_so() -> None:
    with DashboardServer(FormulaSource(), port=0) as server:

        async def act(page: Page) -> None:
            assert (await page.text("status"))["stage"] is None
            assert "no stage" in (await page.answer(type="release"))["message"]

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


def get(server: DashboardServer, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    async def run() -> tuple[int, str, dict[str, str]]:
        async with aiohttp.ClientSession() as session, session.get(server.url + path, headers=headers) as response:
            return response.status, await response.text(), dict(response.headers)

    return asyncio.run(run())


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
