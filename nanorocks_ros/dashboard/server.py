"""The server of the page, in a thread of its own."""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import os
import socket
import threading
import time
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from nanorocks_ros import __version__
from nanorocks_ros.dashboard.access import Access
from nanorocks_ros.dashboard.board import columns
from nanorocks_ros.dashboard.clients import Client, Look, Pictures
from nanorocks_ros.dashboard.encryption import encryption
from nanorocks_ros.dashboard.gate import Gate, GateLimits
from nanorocks_ros.dashboard.page_process import TOKEN_VARIABLE
from nanorocks_ros.errors import DashboardError

try:
    from aiohttp import WSMsgType, web
    from aiohttp.http_exceptions import HttpProcessingError

    from nanorocks_ros.dashboard.routes import LIVE, make_site
except ImportError as error:
    raise DashboardError(
        'the live page', 'needs aiohttp', "install it: pip install 'nanorocks_ros[dashboard]'"
    ) from error

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Future

    from nanorocks_ros.dashboard.board import Board
    from nanorocks_ros.records import ArrayRecord
    from nanorocks_ros.settings import DashboardSettings

# Path of a cycle that is over.
_CYCLE = r'/cycles/{tray:\d{1,2}}/{cycle:\d{1,9}}'
_MOST_CLIENTS = 64
_MOST_SAID_BYTES = 4096
# A browser that does not answer within half of that is gone.
_HEARTBEAT_S = 20.0
_FAREWELL_S = 1.0


def _is_our_fault(record: logging.LogRecord) -> bool:
    """Whether a log record is about more than a malformed request, which is answered with 400."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, HttpProcessingError | web.RequestPayloadError)


def _note_fault(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Say in one line what the system refuses, such as a connection without a free descriptor."""
    error = context.get('exception')
    if isinstance(error, OSError):
        # Sockets that the other side has closed are no fault at all.
        if not isinstance(error, ConnectionError):
            _requests.warning('%s: %s', context.get('message', 'the live page'), error)
        return
    loop.default_exception_handler(context)


_requests = logging.getLogger(__name__)
_requests.addFilter(_is_our_fault)


class PageServer:
    """The live page.

    All but the two properties may be used from any thread; the board belongs to ours.

    Parameters
    ----------
    settings : DashboardSettings
    board : Board
    namespace : str
        Of the graph, for the page.
    limits : GateLimits, optional

    Raises
    ------
    ConfigurationError
        For a token that can be guessed, or a certificate that cannot be used.
    """

    def __init__(
        self,
        settings: DashboardSettings,
        board: Board,
        namespace: str,
        limits: GateLimits | None = None,
    ) -> None:
        self._settings, self._board = settings, board
        self._greeting = {
            'namespace': namespace,
            'version': __version__,
            'columns': columns(),
        }
        token = settings.token or os.environ.get(TOKEN_VARIABLE, '')
        self._encryption = encryption(settings.certificate, settings.private_key)
        encrypted = self._encryption is not None
        self._access = Access(settings.host, token, encrypted=encrypted)
        self._gate = Gate(limits or GateLimits())
        self._listener: asyncio.Server | None = None
        self._pictures = Pictures()
        self._clients: set[Client] = set()
        self._loop = asyncio.new_event_loop()
        self._runner: web.AppRunner | None = None
        self._thread = threading.Thread(target=self._run, name='live page', daemon=True)
        self._port = settings.port
        self.wanted: frozenset[Look] = frozenset()

    @property
    def port(self) -> int:
        """Port on which the page is served."""
        return self._port

    @property
    def clients(self) -> int:
        """Number of connected browsers."""
        return len(self._clients)

    @property
    def url(self) -> str:
        """Address of the page, with the token."""
        host = self._settings.host
        if host in ('0.0.0.0', '::'):
            host = socket.gethostname()
        shown = f'[{host}]' if ':' in host else host
        query = f'?token={self._access.token}' if self._access.token else ''
        scheme = 'http' if self._encryption is None else 'https'
        return f'{scheme}://{shown}:{self._port}/{query}'

    def start(self) -> None:
        """Listen.

        Raises
        ------
        DashboardError
            When the address or the port cannot be used.
        """
        self._thread.start()
        try:
            asyncio.run_coroutine_threadsafe(self._open(), self._loop).result()
        except OSError as error:
            self.stop()
            if error.errno == errno.EADDRNOTAVAIL:
                raise DashboardError(
                    f'host {self._settings.host!r}',
                    'is no address of this machine',
                    'name one of its own, 0.0.0.0 for all of them, or 127.0.0.1',
                ) from error
            raise DashboardError(
                f'port {self._port} of {self._settings.host}',
                # What asyncio says begins with the address again.
                os.strerror(error.errno) if error.errno else str(error),
                'choose another port, 0 for any that is free, or end who has it',
            ) from error

    def stop(self) -> None:
        """Close all connections and end the thread."""
        if self._loop.is_closed():
            return
        farewell: Future[None] = asyncio.run_coroutine_threadsafe(self._close(), self._loop)
        try:
            farewell.result(3 * _FAREWELL_S)
        except TimeoutError:
            farewell.cancel()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_FAREWELL_S)

    def expect(self, tray: int) -> None:
        """Show a tray that has no results yet."""
        self._soon(self._board.expect, tray, time.monotonic())

    def take(self, record: ArrayRecord) -> None:
        """Show a result."""
        self._soon(self._board.take, record, time.monotonic())

    def diagnose(
        self, statuses: Sequence[tuple[str, int, str, Sequence[tuple[str, str]]]]
    ) -> None:
        """Show the diagnostics of nodes: name, level, text, names and values."""
        self._soon(self._board.diagnose, statuses, time.monotonic())

    def show(self, look: Look, content: bytes) -> None:
        """Show an image that a browser views."""
        self._soon(self._pictures.put, look, content)

    def _soon(self, work: Callable[..., None], *arguments: Any) -> None:
        def do() -> None:
            work(*arguments)
            for client in self._clients:
                client.changed.set()

        self._loop.call_soon_threadsafe(do)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.set_exception_handler(_note_fault)
        self._loop.run_forever()
        self._loop.close()

    async def _open(self) -> None:
        routes = [web.get(LIVE, self._live), web.get(_CYCLE, self._past_cycle)]
        application = make_site(self._access, self._port, self._gate, routes)
        self._runner = web.AppRunner(
            application,
            access_log=None,
            logger=_requests,
            shutdown_timeout=_FAREWELL_S,
            handle_signals=False,
            keepalive_timeout=self._gate.limits.patience_s,
        )
        await self._runner.setup()
        make = self._runner.server
        assert make is not None
        self._listener = await self._loop.create_server(
            lambda: self._gate.protocol(make),
            self._settings.host or None,
            self._port,
            ssl=self._encryption,
            backlog=128,
        )
        self._port = self._listener.sockets[0].getsockname()[1]

    async def _close(self) -> None:
        await asyncio.gather(*(client.close() for client in self._clients), return_exceptions=True)
        if self._listener is not None:
            self._listener.close()
        if self._runner is not None:
            await self._runner.cleanup()

    async def _past_cycle(self, request: web.Request) -> web.Response:
        tray, cycle = (int(request.match_info[name]) for name in ('tray', 'cycle'))
        past = self._board.past_cycle(tray, cycle)
        if past is None:
            return web.json_response({'error': 'this cycle is not kept any more'}, status=404)
        return web.json_response(asdict(past), dumps=partial(json.dumps, allow_nan=False))

    async def _live(self, request: web.Request) -> web.StreamResponse:
        if len(self._clients) >= _MOST_CLIENTS:
            return web.Response(status=503, text=f'{_MOST_CLIENTS} browsers look already\n')
        connection = web.WebSocketResponse(
            heartbeat=_HEARTBEAT_S,
            max_msg_size=_MOST_SAID_BYTES,
            compress=False,
            timeout=_FAREWELL_S,
        )
        try:
            await connection.prepare(request)
        except ValueError:
            # aiohttp expects plain ASCII in the heads of the handshake.
            return web.Response(status=400, text='no handshake\n')
        except ConnectionResetError:
            # Gone already, which is no fault of the server: nobody gets this answer.
            return web.Response(status=400, text='gone\n')
        pause_s = 1.0 / self._settings.picture_rate
        client = Client(connection, self._board, self._pictures, pause_s)
        self._clients.add(client)
        sender = asyncio.ensure_future(client.run(self._greeting))
        # When the server ends, it is by an exception in here.
        try:
            # Whoever is gone when a ping is answered is no fault of the server.
            with suppress(ConnectionResetError):
                await self._hear(connection, client)
        finally:
            sender.cancel()
            self._clients.discard(client)
            self._note_looks()
        return connection

    async def _hear(self, connection: web.WebSocketResponse, client: Client) -> None:
        async for message in connection:
            try:
                if message.type is not WSMsgType.TEXT:
                    raise ValueError('no text')
                client.hear(message.data)
            except (ValueError, KeyError, TypeError, RecursionError):
                await connection.close(code=1008, message=b'not what the page says')
                return
            self._note_looks()

    def _note_looks(self) -> None:
        self.wanted = frozenset[Look]().union(*(client.looks for client in self._clients))
        self._pictures.keep(self.wanted)
