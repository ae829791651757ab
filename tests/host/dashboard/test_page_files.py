"""The page's files: few bytes over the line, sent again only when they have changed."""

import asyncio
import gzip
from collections.abc import Mapping
from dataclasses import replace

import aiohttp
import numpy as np

from gellight.dashboard.application import PAGE
from gellight.dashboard.fetched import FOR_EVER
from gellight.dashboard.messages import IdentityCache, encode
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
    assert (status, headers["Content-Encoding"]) == (200, "gzip")
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


def test_a_map_that_stays_the_same_is_packed_once() -> None:
    once, made = IdentityCache(), []
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
    once, taken = IdentityCache(), np.zeros(3)
    numbers = iter(range(9))
    assert [once.of("depth", (taken,), lambda: next(numbers)) for _ in range(3)] == [0, 1, 2]
    assert not once._made


def test_frames_at_rest_touched_and_at_rest_again_come_out_as_they_are() -> None:
    once, references = IdentityCache(), ReferenceViews()
    touched, rest = bump(1.2, 3.0, -2.0), bump(0.0, 0.0, 0.0)
    for array in (rest.depth_mm, rest.contact.mask):
        array.flags.writeable = False
    for frame in (rest, replace(rest), touched, rest):
        view = decode(encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=references, once=once))
        assert np.abs(view.depth_mm - frame.depth_mm.reshape(240, 2, 320, 2).mean(axis=(1, 3))).max() < 0.3e-3
        assert view.contact.any() == frame.contact.mask.any()
