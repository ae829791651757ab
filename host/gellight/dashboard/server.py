"""The dashboard's server: a thread that serves the page, on 127.0.0.1 unless another address is given."""

import asyncio
import errno
import logging
import secrets
import socket
import ssl
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Self

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from gellight.base.errors import ConfigError, ServerError, first_line
from gellight.base.runtime_folder import own_token
from gellight.daemon.calibration_service import CalibrationService
from gellight.daemon.session import SensorSession
from gellight.dashboard.access import is_loopback
from gellight.dashboard.application import Dashboard
from gellight.dashboard.fetched import ScanController

logger = logging.getLogger(__name__)
_requests = logging.getLogger(f"{__name__}.requests")
_requests.addFilter(lambda record: not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError)))
"""aiohttp's log, without the traceback of a request that it refuses, as one too long: who sent it is told"""

HOST = "127.0.0.1"
DEFAULT_PORT = 8420  # chosen; the documents name it


class DashboardServer:
    """Serves the dashboard of one sensor in a thread of its own; a context manager."""

    def __init__(
        self,
        source: SensorSession,
        *,
        port: int = DEFAULT_PORT,
        calibration: CalibrationService | None = None,
        scan: ScanController | None = None,
        sensors: Callable[[], Mapping[str, str]] = dict,
        host: str = HOST,
        token: str = "",
        tls_cert: str = "",
        tls_key: str = "",
    ) -> None:
        """Serve `source`, as `Dashboard` does; port 0 takes any free one.

        token: that every request has to bring; by default one is drawn where other computers reach `host`, else it is
        the one that this user has.
        tls_cert, tls_key: PEM files to encrypt by; ConfigError where they are none or do not belong together.
        """
        self._tls = _tls(tls_cert, tls_key)
        self._dashboard, self._port, self._host = Dashboard(source, calibration, scan, sensors), port, host
        self.token = token or (own_token() if is_loopback(host) else secrets.token_urlsafe(24))
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._ready = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="dashboard", daemon=True)

    @property
    def url(self) -> str:
        """Where the page is, with the token."""
        return f"{self.base}?token={self.token}"

    @property
    def base(self) -> str:
        """Where the page is, for who has its cookie."""
        everywhere = self._host in ("0.0.0.0", "::")
        shown = socket.gethostname() if everywhere else f"[{self._host}]" if ":" in self._host else self._host
        scheme = "https" if self._tls else "http"
        return f"{scheme}://{shown}:{self._port}/"

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
        app = self._dashboard.application(self.token)
        runner = web.AppRunner(app, access_log=None, logger=_requests, shutdown_timeout=1.0)
        await runner.setup()
        try:
            self._port = await _listen(runner, self._host, self._port, self._tls)
            self._ready.set()
            await self._stop.wait()
        finally:
            await runner.cleanup()


def _tls(cert: str, key: str) -> ssl.SSLContext | None:
    """Return what encrypts by these files; None where none are given."""
    if not (cert or key):
        return None
    if not (cert and key):
        raise ConfigError("dashboard.tls_cert and dashboard.tls_key belong together: give both, or neither")
    for path in (cert, key):
        if not Path(path).is_file():
            raise ConfigError(
                f"{path} is no file: dashboard.tls_cert is a certificate, dashboard.tls_key its private key, both PEM"
            )
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        context.load_cert_chain(cert, key, password="")
    except (ssl.SSLError, OSError, ValueError) as error:
        raise ConfigError(
            f"{cert} and {key} are no certificate with its private key ({first_line(error)}): give PEM files "
            "without a password"
        ) from error
    return context


async def _listen(runner: web.AppRunner, host: str, port: int, tls: ssl.SSLContext | None) -> int:
    try:
        await web.TCPSite(runner, host, port, ssl_context=tls).start()
    except OSError as error:
        raise ServerError(_cannot_listen(error, host, port)) from error
    return int(runner.addresses[0][1])


def _cannot_listen(error: OSError, host: str, port: int) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {host} is in use by another program: stop it, or set another dashboard.port"
    if error.errno == errno.EACCES:
        return f"port {port} of {host} needs root: set a dashboard.port above 1023"
    if error.errno == errno.EADDRNOTAVAIL or isinstance(error, socket.gaierror):
        return (
            f"{host} is no address of this computer: choose another one as dashboard.host, such as 127.0.0.1 or 0.0.0.0"
        )
    return f"cannot listen on port {port} of {host} ({error}): set another dashboard.port"
