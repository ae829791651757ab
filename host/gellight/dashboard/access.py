"""Who may use the dashboard: whoever has the token, which programs of this user find.

Every request has to bring it: as `?token=` in the address that is printed, which makes a cookie of it, or as
`Authorization: Bearer` for programs. So neither other users of this computer nor foreign web pages reach the sensor, by
whatever name they call it. A request that comes from the page of another site (Origin) is refused even with it.
"""

import hmac
import ipaddress
from collections.abc import Awaitable, Callable

from aiohttp import web

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
COOKIE = "gellight-token"
COOKIE_S = 30 * 24 * 3600  # chosen: 30 days; after that the printed address is needed again


def is_loopback(host: str) -> bool:
    """Whether only programs of this machine reach what listens on `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def guard(token: str):  # type: ignore[no-untyped-def]  # what `web.middleware` returns has no name
    """Return the middleware that lets in who brings `token`."""

    @web.middleware
    async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
        host = request.headers.get("Host", "")
        origin = request.headers.get("Origin")
        if origin is not None and origin != f"{request.scheme}://{host}":
            raise web.HTTPForbidden(text=f"Origin {origin!r} is another site: open the dashboard's own page")
        if not _has(request, token):
            return _let_in(request, token)
        response = await handler(request)
        if not response.prepared:
            frames = f"{'wss' if request.secure else 'ws'}://{host}"
            policy = f"default-src 'self'; img-src 'self' blob:; connect-src 'self' {frames}"
            response.headers.setdefault("Content-Security-Policy", policy)
            response.headers["X-Content-Type-Options"] = "nosniff"
            response.headers.setdefault("Cache-Control", "no-cache")
        return response

    return guarded


def cookie(host: str) -> str:
    """Return the name of the cookie for a Host header: a browser gives a computer's cookies to all of its ports."""
    port = host.rpartition(":")[2]
    return f"{COOKIE}-{port}" if port.isdecimal() and port.isascii() else COOKIE


def _has(request: web.Request, token: str) -> bool:
    """Whether a request brings the token. A comparison takes as long whatever is wrong."""
    bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
    return _same(request.cookies.get(cookie(request.headers.get("Host", "")), ""), token) or _same(bearer, token)


def _same(said: str, token: str) -> bool:
    return hmac.compare_digest(said.encode("utf-8", "surrogateescape"), token.encode())


def _let_in(request: web.Request, token: str) -> web.Response:
    """Make a cookie of `?token=` and lead to the address without it; HTTPUnauthorized where it is missing or wrong."""
    if not _same(request.query.get("token", ""), token):
        raise web.HTTPUnauthorized(
            text="the dashboard needs its token: open the address that `gellight run` has printed",
            headers={"WWW-Authenticate": "Bearer"},
        )
    left = {name: value for name, value in request.query.items() if name != "token"}
    answer = web.HTTPSeeOther(str(request.rel_url.with_query(left)))
    name = cookie(request.headers.get("Host", ""))
    answer.set_cookie(name, token, max_age=COOKIE_S, httponly=True, samesite="Strict", secure=request.secure)
    raise answer
