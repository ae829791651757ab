"""Who may use the dashboard: this machine, or whoever has the token.

On the loopback address a request whose Host is not this machine, or which comes from the page of another site (Origin),
is refused; so a foreign web page in the same browser cannot reach the sensor. Beyond it, and wherever a token is set,
every request has to bring the token: as `?token=` in the address that is printed, which makes a cookie of it, or as
`Authorization: Bearer` for programs.
"""

import hmac
import ipaddress
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from aiohttp import web

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
LOOPBACK_NAMES = {"127.0.0.1", "localhost", "::1"}
COOKIE = "gellight-token"
COOKIE_S = 30 * 24 * 3600


def is_loopback(host: str) -> bool:
    """Whether only programs of this machine reach what listens on `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def host_name(host: str) -> str | None:
    """Return the name in a Host header, without the port; None where there is none."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:  # half of a bracket
        return None


def guard(token: str):  # type: ignore[no-untyped-def]  # what `web.middleware` returns has no name
    """Return the middleware that lets in who may; token: empty where nobody but this machine reaches the server."""

    @web.middleware
    async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
        host = request.headers.get("Host", "")
        if not token and host_name(host) not in LOOPBACK_NAMES:
            raise web.HTTPForbidden(
                text=f"Host {host!r} is not this machine: open http://127.0.0.1 with the port shown"
            )
        origin = request.headers.get("Origin")
        if origin is not None and origin != f"{request.scheme}://{host}":
            raise web.HTTPForbidden(text=f"Origin {origin!r} is another site: open the dashboard's own page")
        if token and not _has(request, token):
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


def _has(request: web.Request, token: str) -> bool:
    """Whether a request brings the token. A comparison takes as long whatever is wrong."""
    bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
    return _same(request.cookies.get(COOKIE, ""), token) or _same(bearer, token)


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
    answer.set_cookie(COOKIE, token, max_age=COOKIE_S, httponly=True, samesite="Strict", secure=request.secure)
    raise answer
