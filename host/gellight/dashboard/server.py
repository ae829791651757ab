"""The dashboard's server: a thread that serves the page on 127.0.0.1, and nowhere else."""

import asyncio
import errno
import logging
import threading
from typing import Self

from aiohttp import web

from gellight.base.errors import ServerError
from gellight.daemon.calibration_service import CalibrationService
from gellight.daemon.daemon import Daemon
from gellight.dashboard.application import Dashboard

logger = logging.getLogger(__name__)

HOST = "127.0.0.1"
DEFAULT_PORT = 8420


class DashboardServer:
    """Runs the dashboard in a thread of its own; a context manager."""

    def __init__(
        self, source: Daemon, *, port: int = DEFAULT_PORT, calibration: CalibrationService | None = None
    ) -> None:
        """Serve `source` on 127.0.0.1, with the wizard where there is a `calibration`; port 0 takes any free one."""
        self._calibration = calibration
        self._source = source
        self._port = port
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._ready = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="dashboard", daemon=True)

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self._port}/"

    def start(self) -> Self:
        """Listen; ServerError where the port cannot be had."""
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            self._thread.join()
            raise self._failure
        return self

    def stop(self) -> None:
        """Close every connection and end the thread; harmless when called twice."""
        if self._loop is not None and self._stop is not None and self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join()

    def __enter__(self) -> Self:
        """Start."""
        return self.start()

    def __exit__(self, *problem: object) -> None:
        """Stop."""
        self.stop()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:
            self._failure = error
            if self._ready.is_set():
                logger.exception("the dashboard ended")
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        runner = web.AppRunner(
            Dashboard(self._source, self._calibration).application(), access_log=None, shutdown_timeout=1.0
        )
        await runner.setup()
        try:
            self._port = await _listen(runner, self._port)
            self._ready.set()
            await self._stop.wait()
        finally:
            await runner.cleanup()


async def _listen(runner: web.AppRunner, port: int) -> int:
    try:
        await web.TCPSite(runner, HOST, port).start()
    except OSError as error:
        raise ServerError(_cannot_listen(error, port)) from error
    return int(runner.addresses[0][1])


def _cannot_listen(error: OSError, port: int) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {HOST} is in use by another program: stop it, or choose another port with --port"
    if error.errno == errno.EACCES:
        return f"port {port} of {HOST} needs root: choose one above 1023 with --port"
    return f"cannot listen on port {port} of {HOST} ({error}): choose another port with --port"
