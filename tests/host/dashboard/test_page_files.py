"""The page's files: few bytes over the line, sent again only when they have changed."""

import asyncio
import gzip
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread

import aiohttp
import numpy as np
import pytest
from aiohttp import web

from gellight.dashboard.application import PAGE
from gellight.dashboard.messages import MadeOnce, encode
from gellight.dashboard.page_files import FOR_EVER, PageFiles
from gellight.dashboard.server import DashboardServer
from gellight.dashboard.view import ReferenceViews
from tests.helpers.dashboard_source import PIXEL_MM, bump
from tests.helpers.page_client import bearer
from tests.helpers.view_messages import decode


def get(url: str, **headers: str) -> tuple[int, bytes, Mapping[str, str]]:
    """Return status, body as it came over the line, and headers."""

    async def run() -> tuple[int, bytes, Mapping[str, str]]:
        async with (
            aiohttp.ClientSession(auto_decompress=False) as session,
            session.get(url, headers=bearer() | headers) as response,
        ):
            return response.status, await response.read(), response.headers.copy()

    return asyncio.run(run())


PACKED = {"Accept-Encoding": "gzip, deflate, br"}
PLAIN = {"Accept-Encoding": "identity"}


def test_text_comes_compressed_and_is_the_file(server: DashboardServer) -> None:
    status, body, headers = get(server.base + "main.js", **PACKED)
    assert (status, headers["Content-Encoding"], headers["Vary"]) == (200, "gzip", "Accept-Encoding")
    assert gzip.decompress(body) == (PAGE / "main.js").read_bytes()
    assert "javascript" in headers["Content-Type"]


def test_who_cannot_unpack_gets_it_plain(server: DashboardServer) -> None:
    _, body, headers = get(server.base + "main.js", **PLAIN)
    assert "Content-Encoding" not in headers
    assert body == (PAGE / "main.js").read_bytes()


def test_what_the_browser_has_is_not_sent_again(server: DashboardServer) -> None:
    tag = get(server.base + "main.js", **PACKED)[2]["ETag"]
    status, body, headers = get(server.base + "main.js", **PACKED, **{"If-None-Match": tag})
    assert (status, body, headers["ETag"], headers["Cache-Control"]) == (304, b"", tag, "no-cache")
    assert get(server.base + "main.js", **PACKED, **{"If-None-Match": '"another"'})[0] == 200


def test_libraries_are_kept_by_the_browser_for_good(server: DashboardServer) -> None:
    vendored = next((PAGE / "vendor").glob("*/three.module.min.js")).relative_to(PAGE).as_posix()
    assert get(server.base + vendored, **PACKED)[2]["Cache-Control"] == FOR_EVER
    assert any(character.isdigit() for character in vendored), "the folder names the version"


def test_all_that_the_page_loads_is_small(server: DashboardServer) -> None:
    names = [path.relative_to(PAGE).as_posix() for path in PAGE.rglob("*.js")]
    assert sum(len(get(server.base + name, **PACKED)[1]) for name in names) < 260_000


def imported(name: str) -> set[str]:
    """Return the modules that a module of the page needs before it runs."""
    text = (PAGE / name).read_text()
    found = set(re.findall(r'^import .*? from "\./([^"]+)";', text, re.MULTILINE))
    return found.union(*(imported(other) for other in found))


@pytest.mark.parametrize(("page", "main"), [("index.html", "main.js"), ("calibrate.html", "wizard.js")])
def test_all_modules_are_asked_for_at_once_and_not_one_after_the_other(page: str, main: str) -> None:
    asked = re.findall(r'<link rel="modulepreload" href="([^"]+)">', (PAGE / page).read_text())
    assert sorted(asked) == sorted(imported(main))
    assert not [name for name in asked if name.startswith("vendor/")], "the first picture does not wait for 3D"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "page").mkdir()
    (tmp_path / "page" / "a.js").write_text("let first;")
    (tmp_path / "secret.txt").write_text("not of the page")
    return tmp_path / "page"


@pytest.fixture
def address(folder: Path) -> Iterator[str]:
    """Serve `folder` in a loop of its own."""
    loop, ready = asyncio.new_event_loop(), Event()
    found: list[str] = []

    async def serve() -> web.AppRunner:
        app = web.Application()
        PageFiles(folder).add_routes(app)
        runner = web.AppRunner(app)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        found.append(f"http://127.0.0.1:{runner.addresses[0][1]}/")
        ready.set()
        return runner

    runners: list[web.AppRunner] = []
    thread = Thread(target=lambda: (runners.append(loop.run_until_complete(serve())), loop.run_forever()))
    thread.start()
    ready.wait(10)
    yield found[0]
    asyncio.run_coroutine_threadsafe(runners[0].cleanup(), loop).result(10)
    loop.call_soon_threadsafe(loop.stop)
    thread.join()


def test_a_file_that_changes_is_sent_as_it_is_then(folder: Path, address: str) -> None:
    before = get(address + "a.js")
    (folder / "a.js").write_text("let second;")
    os.utime(folder / "a.js", ns=(1, 1))
    after = get(address + "a.js")
    assert (before[1], after[1]) == (b"let first;", b"let second;")
    assert before[2]["ETag"] != after[2]["ETag"]


def test_nothing_outside_the_folder_is_served(address: str) -> None:
    for name in ("../secret.txt", "%2e%2e/secret.txt", "..%2fsecret.txt", "", "a.js/", "/etc/passwd"):
        assert get(address + name)[0] == 404, name


def test_a_map_that_stays_the_same_is_packed_once() -> None:
    once, made = MadeOnce(), []
    flat = np.zeros(3)
    flat.flags.writeable = False
    for _ in range(3):
        assert once.of("depth", (flat, "truth"), lambda: made.append(1) or len(made)) == 1
    assert once.of("contact", (flat, "truth"), lambda: 7) == 7
    other = flat.copy()
    other.flags.writeable = False
    assert once.of("depth", (other, "truth"), lambda: 2) == 2
    assert once.of("depth", (flat, "truth"), lambda: 3) == 3


def test_a_map_that_may_change_is_packed_each_time_and_not_kept() -> None:
    once, taken = MadeOnce(), np.zeros(3)
    numbers = iter(range(9))
    assert [once.of("depth", (taken,), lambda: next(numbers)) for _ in range(3)] == [0, 1, 2]
    assert not once._made


def test_frames_at_rest_touched_and_at_rest_again_come_out_as_they_are() -> None:
    once, references = MadeOnce(), ReferenceViews()
    touched, rest = bump(1.2, 3.0, -2.0), bump(0.0, 0.0, 0.0)
    for array in (rest.depth_mm, rest.contact.mask):
        array.flags.writeable = False
    for frame in (rest, replace(rest), touched, rest):
        view = decode(encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=references, once=once))
        assert np.abs(view.depth_mm - frame.depth_mm.reshape(240, 2, 320, 2).mean(axis=(1, 3))).max() < 0.3e-3
        assert view.contact.any() == frame.contact.mask.any()
