"""What the page costs on the line: `python -m tests.benchmarks.page`, with `--kbit 1600 --latency-ms 75`.

A simulated sensor with a ball pressed 1 mm deep is served to Chromium through a line of that speed, which all its
connections share; the browser draws no 3D, which would take the processor from all else on a computer without graphics
card. Stated are the time and the bytes to the first picture, the bytes of a frame, frames a second and the age of what
is shown on the slow line; and, without a line, what encoding a frame costs the daemon.
"""

import argparse
import asyncio
import json
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from statistics import median

from playwright.sync_api import Browser, Page, sync_playwright

from gellight.daemon.assembly import open_session
from gellight.dashboard.made_once import MadeOnce
from gellight.dashboard.messages import encode
from gellight.dashboard.reference_views import ReferenceViews
from gellight.dashboard.server import DashboardServer
from gellight.frames.frames import TactileFrame
from tests.helpers.browsing import FLAGS, NO_GL
from tests.helpers.settings import loaded

SENSOR = "sim://?object=BALL&depth=1"
WATCHED_S = 10.0
PIECE_BYTES = 4096
PATIENCE_MS = 240_000


class SlowLine:
    """Passes connections on to a server, all together at `bytes_per_s`, each piece `latency_s` late."""

    def __init__(self, port: int, bytes_per_s: float, latency_s: float) -> None:
        """Wait for `open`."""
        self._port, self._rate, self._latency_s = port, bytes_per_s, latency_s
        self._free_s = 0.0
        self.bytes_to_page = 0
        self.port = 0

    async def open(self) -> None:
        """Listen on a free port of this machine."""
        listener = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        self.port = listener.sockets[0].getsockname()[1]

    async def _serve(self, page: asyncio.StreamReader, to_page: asyncio.StreamWriter) -> None:
        server, to_server = await asyncio.open_connection("127.0.0.1", self._port)
        with suppress(asyncio.CancelledError):  # asyncio reports a connection that was cancelled as an error
            await self._pass_both(page, to_page, server, to_server)

    async def _pass_both(
        self,
        page: asyncio.StreamReader,
        to_page: asyncio.StreamWriter,
        server: asyncio.StreamReader,
        to_server: asyncio.StreamWriter,
    ) -> None:
        await asyncio.gather(self._pass(page, to_server, 0), self._pass(server, to_page, 1), return_exceptions=True)

    async def _pass(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter, counted: int) -> None:
        while piece := await source.read(PIECE_BYTES):
            self.bytes_to_page += counted * len(piece)
            now_s = time.monotonic()
            self._free_s = max(self._free_s, now_s) + counted * len(piece) / self._rate
            if counted:  # the line is busy until then; the piece arrives the latency later
                await asyncio.sleep(max(self._free_s - now_s, 0))
            asyncio.get_running_loop().call_later(self._latency_s, sink.write, piece)
        asyncio.get_running_loop().call_later(self._latency_s, sink.close)


@contextmanager
def slow_line(port: int, kbit: float, latency_ms: float) -> Iterator[SlowLine]:
    """Run a line in a thread of its own."""
    line, loop = SlowLine(port, kbit * 125, latency_ms / 1e3), asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    asyncio.run_coroutine_threadsafe(line.open(), loop).result()
    try:
        yield line
    finally:
        asyncio.run_coroutine_threadsafe(ended(), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()


async def ended() -> None:
    """End all connections of the running loop."""
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


def watch_page(page: Page, line: SlowLine) -> dict[str, float]:
    """Open the page over the line and return what it took."""
    begun_s = time.monotonic()
    page.goto(f"http://127.0.0.1:{line.port}/", wait_until="commit")
    page.wait_for_function("() => window.gellight?.drawn > 0", timeout=PATIENCE_MS)
    first_s, first_bytes = time.monotonic() - begun_s, line.bytes_to_page
    drawn, ages = page.evaluate("gellight.drawn"), []
    begun_s, begun_bytes = time.monotonic(), line.bytes_to_page
    while time.monotonic() < begun_s + WATCHED_S:
        page.wait_for_timeout(200)
        ages.append(page.evaluate("gellight.age_ms") or 0.0)
    frames = page.evaluate("gellight.drawn") - drawn
    return {
        "first_picture_s": round(first_s, 2),
        "first_picture_kB": round(first_bytes / 1e3, 1),
        "frames_per_s": round(frames / WATCHED_S, 2),
        "kB_per_s": round((line.bytes_to_page - begun_bytes) / WATCHED_S / 1e3, 1),
        "median_age_ms": round(median(ages), 0),
    }


def cost_of_drawing(browser: Browser, url: str) -> dict[str, float]:
    """Return the processor time of a frame in the browser, on a laptop's page, and the frames drawn and given."""
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.goto(url)
    page.wait_for_function("() => gellight.drawn > 10", timeout=PATIENCE_MS)
    whole, own = browser.new_browser_cdp_session(), page.context.new_cdp_session(page)
    own.send("Performance.enable")

    def spent() -> tuple[float, float, float]:
        processes = whole.send("SystemInfo.getProcessInfo")["processInfo"]
        metrics = {each["name"]: each["value"] for each in own.send("Performance.getMetrics")["metrics"]}
        return sum(each["cpuTime"] for each in processes), metrics["TaskDuration"], page.evaluate("gellight.drawn")

    before = spent()
    page.wait_for_timeout(WATCHED_S * 1e3)
    all_s, thread_s, frames = (now - was for now, was in zip(spent(), before, strict=True))
    given = page.evaluate("gellight.fps")
    page.close()
    return {
        "browser_ms": round(all_s / frames * 1e3, 1),
        "page_thread_ms": round(thread_s / frames * 1e3, 1),
        "drawn_per_s": round(frames / WATCHED_S, 1),
        "given_per_s": round(given, 1),
    }


def main() -> None:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kbit", type=float, default=1600)
    parser.add_argument("--latency-ms", type=float, default=75, help="one way")
    chosen = parser.parse_args()
    figures: dict[str, object] = {"kbit_per_s": chosen.kbit, "latency_ms": chosen.latency_ms}
    with open_session(loaded({"sensor.url": SENSOR})) as daemon:
        frame = daemon.wait_frame(0, 60)
        figures |= cost_of_encoding(daemon.pixel_size_mm, frame)
        with DashboardServer(daemon, port=0) as server, sync_playwright() as playwright:
            path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
            browser = playwright.chromium.launch(executable_path=path, args=FLAGS + NO_GL)
            figures |= cost_of_drawing(browser, server.url)
            with slow_line(int(server.url.rsplit(":", 1)[1].strip("/")), chosen.kbit, chosen.latency_ms) as line:
                figures |= watch_page(browser.new_page(), line)
            browser.close()
    print(json.dumps(figures, indent=1))


def cost_of_encoding(pixel_size_mm: tuple[float, float], frame: TactileFrame) -> dict[str, float]:
    """Return the bytes of a frame and the median processor time to encode it."""
    references, once, times = ReferenceViews(), MadeOnce(), []
    for _ in range(31):
        begun_s = time.thread_time()
        message = encode(frame, pixel_size_mm=pixel_size_mm, references=references, once=once)
        times.append(time.thread_time() - begun_s)
    return {"frame_kB": round(len(message) / 1e3, 1), "encode_ms": round(median(times) * 1e3, 2)}


if __name__ == "__main__":
    main()
