"""The token: who brings none, or a wrong one, gets nothing; who brings it once needs it no more."""

import ssl
import stat
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import aiohttp
import pytest
from playwright.sync_api import Browser

from gellight.base.errors import ConfigError, ServerError
from gellight.base.runtime_folder import folder, own_token
from gellight.base.settings import load_settings
from gellight.dashboard.access import cookie, is_loopback
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import becomes_live, draw, opening
from tests.helpers.children import run
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.page_client import get, pages

TOKEN = "a-token_of-our-0wn"
PATHS = ("", "status", "ws", "metrics", "health", "sensors", "main.js", "calibration", "nothing")


@pytest.fixture
def server(source: FormulaSource) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0, token=TOKEN) as server:
        yield server


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    ("brought", "bearer", "query"),
    [
        (None, None, ""),
        ("", "", "?token="),
        (TOKEN[:-1], f"Bearer {TOKEN[:-1]}", f"?token={TOKEN[:-1]}"),
        (TOKEN + "x", f"Bearer {TOKEN}x", f"?token={TOKEN}x"),
        ("\xff", "Bearer \udcff", "?token=%ff"),
    ],
)
def test_without_the_token_nothing_is_answered(
    server: DashboardServer, path: str, brought: str | None, bearer: str | None, query: str
) -> None:
    headers = {} if bearer is None else {"Authorization": bearer}
    headers |= {} if brought is None else {"Cookie": f"{cookie(server.base.strip('/'))}={brought}"}
    status, text, answered = get(server.base + path + query, headers=headers)
    assert status == 401
    assert "open the address that `gellight run` has printed" in text
    assert "Set-Cookie" not in answered


def test_the_address_that_is_printed_becomes_a_cookie_and_a_program_has_a_header(server: DashboardServer) -> None:
    assert server.url.endswith(f"/?token={TOKEN}")
    status, _, headers = get(server.base + f"status?token={TOKEN}&more=1")
    assert (status, headers["Location"]) == (303, "/status?more=1")
    made = headers["Set-Cookie"]
    name = cookie(server.base.strip("/"))
    assert made.startswith(f"{name}={TOKEN};")
    assert "HttpOnly" in made
    assert "Max-Age=2592000" in made, "a month"
    assert "SameSite=Strict" in made
    assert get(server.base + "status", cookies={name: TOKEN})[0] == 200
    assert get(server.base + "metrics", headers={"Authorization": f"Bearer {TOKEN}"})[0] == 200


def test_a_websocket_needs_the_token_and_another_site_is_refused_with_it(server: DashboardServer) -> None:
    with pages(cookies={cookie(server.base.strip("/")): TOKEN}) as connect:
        assert connect(server.base).text("status")
        with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
            connect(server.base, headers={"Origin": "http://example.org"})
    with pages() as connect, pytest.raises(aiohttp.WSServerHandshakeError, match="401"):
        connect(server.base)


def test_beyond_this_machine_a_token_is_drawn_and_any_name_of_the_host_will_do(source: FormulaSource) -> None:
    with DashboardServer(source, port=0, host="0.0.0.0") as one, DashboardServer(source, port=0, host="0.0.0.0") as two:
        tokens = [server.url.partition("?token=")[2] for server in (one, two)]
        assert min(map(len, tokens)) >= 32
        assert tokens[0] != tokens[1]
        port = one.url.partition("?")[0].rsplit(":", 1)[1].strip("/")
        there = f"http://127.0.0.1:{port}/status"
        assert get(there)[0] == 401
        assert get(there, headers={"Host": "sensor.lan", "Authorization": f"Bearer {tokens[0]}"})[0] == 200
        assert get(there, headers={"Authorization": f"Bearer {tokens[1]}"})[0] == 401


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "localhost"])
def test_on_this_machine_it_is_the_token_of_this_user(source: FormulaSource, host: str) -> None:
    with DashboardServer(source, port=0, host=host) as server, DashboardServer(source, port=0) as again:
        assert server.token == again.token == own_token()
        assert stat.S_IMODE((folder() / "page.token").stat().st_mode) == 0o600
        assert get(server.base + "status")[0] == 200
        assert get(server.base + "status", headers={"Authorization": ""})[0] == 401


def test_two_pages_of_one_computer_keep_their_cookies(source: FormulaSource) -> None:
    """A browser gives the cookies of a host to all of its ports."""
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    with DashboardServer(source, port=0, token="a" * 20) as one, DashboardServer(source, port=0, token="b" * 20) as two:
        for address in (one.url, two.url, one.base, two.base):
            assert browser.open(address).status == 200


@pytest.mark.parametrize(
    ("host", "own"), [("127.0.0.1", True), ("127.0.0.9", True), ("::1", True), ("localhost", True), ("0.0.0.0", False),
                      ("::", False), ("192.168.1.5", False), ("sensor.lan", False)],
)  # fmt: skip
def test_which_addresses_are_of_this_machine_alone(host: str, own: bool) -> None:
    assert is_loopback(host) == own


@pytest.mark.parametrize("host", ["203.0.113.7", "no-such-host.invalid"])
def test_an_address_of_another_computer_is_refused_with_the_remedy(source: FormulaSource, host: str) -> None:
    with pytest.raises(ServerError, match=rf"{host} is no address of this computer: .*dashboard.host"):
        DashboardServer(source, port=0, host=host).start()


@pytest.mark.parametrize("token", ["short", "with a space in the middle", "é" * 20])
def test_a_token_that_could_be_guessed_or_not_be_typed_is_refused(token: str) -> None:
    with pytest.raises(ConfigError, match=r"dashboard\.token"):
        load_settings({"dashboard.token": token})


@pytest.mark.browser
def test_a_browser_opens_the_address_once_and_then_without_the_token(
    browser: Browser, server: DashboardServer, source: FormulaSource
) -> None:
    with opening(browser, server) as opened:
        page = opened()
        draw(page, source, 0.5)
        becomes_live(page, source)
        assert TOKEN not in page.url
        page.goto(server.base)
        draw(page, source, 0.6)


# ---- over TLS ----


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
def encrypted(source: FormulaSource, files: Path) -> Iterator[DashboardServer]:
    own = {"tls_cert": str(files / "own.pem"), "tls_key": str(files / "own.key")}
    with DashboardServer(source, port=0, token=TOKEN, **own) as server:
        yield server


def test_page_cookie_and_frames_are_encrypted(encrypted: DashboardServer, files: Path) -> None:
    trusting = ssl.create_default_context(cafile=files / "own.pem")
    base, origin = encrypted.base, encrypted.base.strip("/")
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    assert base.startswith("https://")
    assert "Secure" in get(encrypted.url, ssl=trusting)[2]["Set-Cookie"]
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
def test_a_browser_shows_frames_over_tls(browser: Browser, encrypted: DashboardServer, source: FormulaSource) -> None:
    with browser.new_context(ignore_https_errors=True) as context:
        page = context.new_page()
        page.goto(encrypted.url)
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
