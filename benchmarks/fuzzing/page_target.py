"""Damaged requests to the live page."""

from __future__ import annotations

import logging
import socket
from typing import TYPE_CHECKING

from benchmarks.fuzzing.mutations import damaged, generator_of
from benchmarks.fuzzing.outcomes import CLEAN_ERROR, SAME, TOLD, TRACEBACK, Outcome
from nanorocks_ros.dashboard.board import Board
from nanorocks_ros.dashboard.gate import GateLimits
from nanorocks_ros.dashboard.server import PageServer
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import DashboardSettings

if TYPE_CHECKING:
    from pathlib import Path

_PATIENCE_S = 10.0
_UPGRADE = (
    b'GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
    b'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n'
)
_FRAME = b'\x81\x8b\x00\x00\x00\x00{"seen": 1}'
_BASES = (
    b'GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n',
    b'POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 5\r\nConnection: close\r\n\r\nhello',
    _UPGRADE + _FRAME,
    b'GET /?token=abcdefghijklmnop HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n'
    b'Cookie: a=b; c="d"\r\nAuthorization: Bearer abcdefghijkl\r\n\r\n',
    b'POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n'
    b'5\r\nhello\r\n0\r\n\r\n',
)


class _Errors(logging.Handler):
    """Keeps what the server logs as its own fault."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(self.format(record))


class Requests:
    """Requests to a page that this process serves."""

    kind = 'requests'

    def __init__(self, _folder: Path) -> None:
        self._errors = _Errors()
        logging.getLogger().addHandler(self._errors)
        settings = DashboardSettings(port=0)
        # As strict as outside, but with less patience, and for one source that asks often.
        limits = GateLimits(patience_s=0.3, requests_per_s=1e6, requests_at_once=1e6)
        self._server = PageServer(settings, Board(load_trays()), '/nanorocks', limits)
        self._server.start()

    def run(self, number: int) -> Outcome:
        base = _BASES[number % len(_BASES)]
        content, damage = damaged(base, generator_of(self.kind, number))
        before = len(self._errors.texts)
        answer = self._ask(content)
        if len(self._errors.texts) > before:
            return Outcome(TRACEBACK, 'requests', damage, self._errors.texts[-1][-300:])
        if self._ask(_BASES[0])[:12] != b'HTTP/1.1 200':
            return Outcome(TRACEBACK, 'requests', damage, 'the page is not served any more')
        status = answer[9:12]
        name = SAME if status in (b'200', b'101') else CLEAN_ERROR if status else TOLD
        return Outcome(name, 'requests', damage, status.decode('ascii', 'replace'))

    def _ask(self, content: bytes) -> bytes:
        """The first bytes of the answer; empty when the server closes the connection."""
        with socket.create_connection(('127.0.0.1', self._server.port), _PATIENCE_S) as connection:
            try:
                connection.sendall(content)
                return connection.recv(512)
            except OSError:
                return b''
