"""The routes of the site: page, files, login, live connection.

Tested by ``test/dashboard/test_server.py``.
"""

from __future__ import annotations

import asyncio
import hashlib
from importlib import resources
from typing import TYPE_CHECKING, Any

from aiohttp import web

from nanorocks_ros.dashboard.gate import RequestRate, source_of

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable, Mapping

    from nanorocks_ros.dashboard.access import Access
    from nanorocks_ros.dashboard.gate import Gate

    Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

_TYPES = {
    '.html': 'text/html',
    '.js': 'text/javascript',
    '.css': 'text/css',
    '.svg': 'image/svg+xml',
    '.LICENSE': 'text/plain',
}
_HEADERS = {
    'Content-Security-Policy': (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
    # Without any, the origin of the form that gives the token would not be told either.
    'Referrer-Policy': 'same-origin',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cache-Control': 'no-cache',
    'Server': 'nanorocks',
}
LIVE = '/live'
"""Path of the live connection."""

_MOST_POSTED_BYTES = 4096
_YEAR_S = 365 * 86400
# Served without a token.
_IN_FRONT = frozenset(('/login', '/style.css', '/icon.svg'))
_AFTER_A_WRONG_TOKEN_S = 0.5


def make_site(
    access: Access, port: int, gate: Gate, routes: Iterable[web.RouteDef], folder: str = 'page'
) -> web.Application:
    """The routes, behind the checks of who asks.

    Parameters
    ----------
    access : Access
    port : int
        Tells the cookies of two pages on one host apart.
    gate : Gate
    routes : iterable of RouteDef
        Beside the page, its files and the login.
    folder : str
        Of the page and its files, which come before those of the live page.
    """
    files = {**_files('page'), **_files(folder)}
    entrance = _Entrance(access, f'nanorocks_{port}', files)
    middlewares = [_timed(gate), entrance.check]
    site = web.Application(middlewares=middlewares, client_max_size=_MOST_POSTED_BYTES)
    site.on_response_prepare.append(_add_headers)
    site.router.add_get('/', entrance.page)
    site.router.add_routes(routes)
    site.router.add_get('/login', entrance.ask)
    site.router.add_post('/login', entrance.log_in)
    for name, serve in files.items():
        site.router.add_get(f'/{name}', serve)
    return site


def _timed(gate: Gate) -> Any:
    """Limit how often a source asks, and how long the body of a request takes."""
    rate = RequestRate(gate.limits)

    @web.middleware
    async def limit(request: web.Request, handler: Handler) -> web.StreamResponse:
        if not rate.allows(source_of(request.remote or '')):
            return web.Response(
                status=429, text='too many requests\n', headers={'Retry-After': '1'}
            )
        gate.working(request.protocol, busy=True)
        try:
            if request.path == LIVE:
                return await handler(request)
            return await asyncio.wait_for(handler(request), gate.limits.patience_s)
        except asyncio.TimeoutError:
            return _refused(408, 'the request took too long')
        finally:
            gate.working(request.protocol, busy=False)

    return limit


def _files(name: str) -> dict[str, Handler]:
    folder = resources.files(__package__).joinpath(name)
    return {
        path.name: _served(path.read_bytes(), _TYPES[f'.{path.name.rpartition(".")[2]}'])
        for path in folder.iterdir()
        if f'.{path.name.rpartition(".")[2]}' in _TYPES
    }


def _served(content: bytes, kind: str) -> Handler:
    tag = f'"{hashlib.sha256(content).hexdigest()[:32]}"'

    async def serve(request: web.Request) -> web.StreamResponse:
        if request.headers.get('If-None-Match') == tag:
            return web.Response(status=304, headers={'ETag': tag})
        return web.Response(
            body=content, content_type=kind, charset='utf-8', headers={'ETag': tag}
        )

    return serve


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(_HEADERS)


class _Entrance:
    """Checks access and serves the login form."""

    def __init__(self, access: Access, cookie: str, files: Mapping[str, Handler]) -> None:
        self._access, self._cookie = access, cookie
        self._page, self._form = files['index.html'], files['login.html']

    @web.middleware
    async def check(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse requests with a foreign host or origin, or without the token."""
        if 'Host' not in request.headers:
            # Old versions of aiohttp make one up.
            return _refused(400, 'asked for without a host')
        if not self._access.host_is_ours(request.host):
            return _refused(421, 'not served under this name; open it as http://127.0.0.1')
        origin = request.headers.get('Origin')
        if not self._access.origin_is_ours(origin, request.host):
            return _refused(403, 'asked for by a page of somebody else')
        cookie = request.cookies.get(self._cookie, '')
        source = source_of(request.remote or '')
        known = self._access.is_known(request.headers, cookie, source)
        if known or request.path in _IN_FRONT:
            return await handler(request)
        if request.path == '/':
            return await self._first_visit(request)
        return _refused(401, 'the token is missing')

    async def _first_visit(self, request: web.Request) -> web.StreamResponse:
        given = request.query.get('token')
        if given is None:
            return web.Response(status=303, headers={'Location': '/login'})
        return await self._answer(given, source_of(request.remote or ''))

    async def page(self, request: web.Request) -> web.StreamResponse:
        """The page; a token in the address is moved to the cookie: addresses are stored."""
        if 'token' in request.query:
            return await self._first_visit(request)
        return await self._page(request)

    async def ask(self, request: web.Request) -> web.StreamResponse:
        """The login form."""
        return await self._form(request)

    async def log_in(self, request: web.Request) -> web.StreamResponse:
        """Take the token from the form."""
        try:
            given = (await request.post()).get('token', '')
        except (ValueError, LookupError, web.RequestPayloadError):
            return _refused(400, 'not what the form says')
        text = given.strip() if isinstance(given, str) else ''
        return await self._answer(text, source_of(request.remote or ''))

    async def _answer(self, given: str, source: str) -> web.StreamResponse:
        if not self._access.token:
            return web.Response(status=303, headers={'Location': '/'})
        locked = self._access.is_locked_out(source)
        if locked or not self._access.is_token(given, source):
            await asyncio.sleep(_AFTER_A_WRONG_TOKEN_S)
            return web.Response(status=303, headers={'Location': '/login#wrong'})
        response = web.Response(status=303, headers={'Location': '/'})
        response.set_cookie(
            self._cookie,
            self._access.cookie,
            httponly=True,
            samesite='Strict',
            max_age=_YEAR_S,
            secure=self._access.encrypted,
        )
        return response


def _refused(status: int, why: str) -> web.Response:
    return web.Response(status=status, text=f'{why}\n')
