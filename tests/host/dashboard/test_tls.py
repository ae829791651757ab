"""The dashboard over TLS: page, frames and cookie are encrypted, and files that cannot be used are refused."""

import ssl
from collections.abc import Iterator
from pathlib import Path

import aiohttp
import pytest
from playwright.sync_api import Browser

from gellight.base.errors import ConfigError
from gellight.base.settings import load_settings
from gellight.cli.run_options import RunOptions
from gellight.cli.several_sensors import SensorProcess
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import becomes_live, draw
from tests.helpers.children import run
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.page_client import get, pages

TOKEN = "a-token_of-our-0wn"
EC = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with two certificates, their keys, and a key with a password."""
    folder = tmp_path_factory.mktemp("tls")
    for name, locked in (("own", ["-nodes"]), ("other", ["-nodes"]), ("locked", ["-passout", "pass:secret"])):
        made = ["-keyout", f"{name}.key", "-out", f"{name}.pem", "-subj", "/CN=localhost"]
        names = ["-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
        run(["openssl", "req", "-x509", *EC, *locked, *made, *names], cwd=folder, check=True)
    return folder


@pytest.fixture
def server(source: FormulaSource, files: Path) -> Iterator[DashboardServer]:
    own = {"tls_cert": str(files / "own.pem"), "tls_key": str(files / "own.key")}
    with DashboardServer(source, port=0, token=TOKEN, **own) as server:
        yield server


def test_page_cookie_and_frames_are_encrypted(server: DashboardServer, files: Path) -> None:
    trusting = ssl.create_default_context(cafile=files / "own.pem")
    base, origin = server.base, server.base.strip("/")
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    assert base.startswith("https://")
    assert "Secure" in get(server.url, ssl=trusting)[2]["Set-Cookie"]
    assert "wss://127.0.0.1" in get(base, ssl=trusting, headers=bearer)[2]["Content-Security-Policy"]
    with pages() as connect:
        assert connect(base, ssl=trusting, headers=bearer | {"Origin": origin}).text("status")
        with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
            connect(base, ssl=trusting, headers=bearer | {"Origin": origin.replace("https", "http")})
    with pytest.raises(aiohttp.ClientConnectorCertificateError):
        get(base)  # a certificate that nobody vouches for
    with pytest.raises(aiohttp.ClientError):
        get(base.replace("https", "http"))


@pytest.mark.browser
def test_a_browser_shows_frames_over_tls(browser: Browser, server: DashboardServer, source: FormulaSource) -> None:
    with browser.new_context(ignore_https_errors=True) as context:
        page = context.new_page()
        page.goto(server.url)
        draw(page, source, 0.5)
        becomes_live(page, source)


@pytest.mark.parametrize(
    ("cert", "key", "said"),
    [
        ("own.pem", "", "dashboard.tls_cert and dashboard.tls_key belong together"),
        ("", "own.key", "dashboard.tls_cert and dashboard.tls_key belong together"),
        ("own.pem", "missing.key", r"missing\.key is no file"),
        ("own.pem", "other.key", "no certificate with its private key"),
        ("own.key", "own.key", "no certificate with its private key"),
        ("locked.pem", "locked.key", "without a password"),
    ],
)
def test_files_that_cannot_be_used_are_refused(
    source: FormulaSource, files: Path, cert: str, key: str, said: str
) -> None:
    given = [str(files / name) if name else "" for name in (cert, key)]
    with pytest.raises(ConfigError, match=said):
        DashboardServer(source, port=0, tls_cert=given[0], tls_key=given[1])


def test_of_several_sensors_the_page_alone_is_encrypted() -> None:
    """The dashboards of their processes are reached by that page alone, on this computer."""
    settings = load_settings({"dashboard.tls_cert": "a.pem", "dashboard.tls_key": "a.key"})
    inner = SensorProcess(1, settings, RunOptions())._settings.dashboard
    assert (inner.host, inner.tls_cert, inner.tls_key) == ("127.0.0.1", "", "")
