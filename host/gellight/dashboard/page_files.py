"""The files of the page over HTTP: compressed, and sent again only when they have changed.

aiohttp's own static route sends a compressed file only where one lies beside the plain one; here the page's files are
compressed when they are first asked for, and kept.
"""

import asyncio
import gzip
import hashlib
from dataclasses import dataclass
from functools import lru_cache
from mimetypes import MimeTypes
from pathlib import Path

from aiohttp import ETag, web

FOR_EVER = "public, max-age=31536000, immutable"
"""for what never changes under its name"""
VENDOR = "vendor/"
"""libraries, in folders that name their version"""
INDEX = "index.html"


@dataclass(frozen=True)
class PageFile:
    """A file of the page, as it is sent."""

    kind: str
    """its media type"""
    plain: bytes
    packed: bytes
    """the same, gzip"""
    tag: str
    """changes when the file does"""


class PageFiles:
    """Every file of a folder, and nothing outside it."""

    def __init__(self, folder: Path) -> None:
        """Serve the files that are in `folder` now; one that is changed later is sent as it is then."""
        self._files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}

    def add_routes(self, app: web.Application) -> None:
        """Add the routes to an application, after all others: they take every path that is left."""
        app.router.add_get("/{name:.*}", self._send)

    async def _send(self, request: web.Request) -> web.Response:
        name = request.match_info["name"] or INDEX
        path = self._files.get(name)
        if path is None:
            raise web.HTTPNotFound(text=f"the page has no file {name!r}")
        file = await asyncio.to_thread(read, path, path.stat().st_mtime_ns)
        return _answer(request, file, name)


def _answer(request: web.Request, file: PageFile, name: str) -> web.Response:
    known = any(tag.value == file.tag for tag in request.if_none_match or ())
    packed = "gzip" in request.headers.get("Accept-Encoding", "") and len(file.packed) < len(file.plain)
    response = web.Response(status=304) if known else web.Response(body=file.packed if packed else file.plain)
    if not known:
        response.content_type = file.kind
        response.headers.update({"Content-Encoding": "gzip"} if packed else {})
    response.headers["Vary"] = "Accept-Encoding"
    response.etag = ETag(file.tag)
    if name.startswith(VENDOR):
        response.headers["Cache-Control"] = FOR_EVER
    return response


@lru_cache(maxsize=256)
def read(path: Path, changed_ns: int) -> PageFile:
    """Read and compress a file that was changed at `changed_ns`."""
    plain = path.read_bytes()
    kind = MimeTypes().guess_type(path.name)[0] or "application/octet-stream"
    return PageFile(kind, plain, gzip.compress(plain, mtime=0), hashlib.sha256(plain).hexdigest()[:32])
