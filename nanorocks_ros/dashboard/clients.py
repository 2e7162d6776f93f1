"""The connection to one browser: viewed images, and flow control by acknowledgements.

Tested by ``test/dashboard/test_server.py``.
"""

from __future__ import annotations

import asyncio
import json
import time
from typing import TYPE_CHECKING, Any

from nanorocks_ros.dashboard.tray_board import Cursor
from nanorocks_ros.dashboard.tray_pictures import LAYERS

if TYPE_CHECKING:
    from aiohttp.web import WebSocketResponse

    from nanorocks_ros.dashboard.board import Board

Look = tuple[int, str]
"""Tray number and one of `LAYERS`."""

# Unacknowledged steps: two hide the latency of a distant client.
_AHEAD = 2
_MOST_TRAYS = 99


class Pictures:
    """The latest image of each tray and layer; older images are dropped."""

    def __init__(self) -> None:
        self._latest: dict[Look, tuple[int, bytes]] = {}
        self._count = 0

    def put(self, look: Look, content: bytes) -> None:
        """Replace the image of a tray and layer."""
        self._count += 1
        self._latest[look] = (self._count, content)

    def newer(self, look: Look, than: int) -> tuple[int, bytes] | None:
        """The latest image with its number, or None if it is not newer."""
        picture = self._latest.get(look)
        return picture if picture is not None and picture[0] > than else None

    def keep(self, wanted: frozenset[Look]) -> None:
        """Drop images that no browser views: they would be shown as new later."""
        self._latest = {look: picture for look, picture in self._latest.items() if look in wanted}


class Client:
    """Sends the changes to one browser, no faster than it acknowledges them.

    The browser acknowledges each step. With too many steps unacknowledged nothing is sent, so
    that nothing queues up; the next step then has all changes.

    Parameters
    ----------
    socket : WebSocketResponse
    board : Board
    pictures : Pictures
    pause_s : float, [s]
        Between two steps.
    """

    def __init__(
        self, socket: WebSocketResponse, board: Board, pictures: Pictures, pause_s: float
    ) -> None:
        self._socket, self._board, self._pictures = socket, board, pictures
        self._pause_s = pause_s
        self._cursor = Cursor()
        self._shown: dict[Look, int] = {}
        self._sent = self._seen = 0
        self.changed = asyncio.Event()
        self.changed.set()
        self.looks: frozenset[Look] = frozenset()

    async def run(self, greeting: dict[str, Any]) -> None:
        """Send changes until the connection ends."""
        try:
            await self._socket.send_str(json.dumps(greeting))
            while True:
                await self.changed.wait()
                self.changed.clear()
                # The next acknowledgement wakes us again.
                if self._sent - self._seen < _AHEAD and await self._step():
                    await asyncio.sleep(self._pause_s)
        except ConnectionError:
            # The browser disconnected; the reader of the connection notices it, too.
            return

    async def close(self) -> None:
        """Close the connection with code 1001."""
        await self._socket.close(code=1001, message=b'the server ends')

    async def _step(self) -> bool:
        pictures = [
            (look, picture)
            for look in sorted(self.looks)
            if (picture := self._pictures.newer(look, self._shown.get(look, 0)))
        ]
        news = self._board.news(self._cursor, time.monotonic())
        if not pictures and not news:
            return False
        self._sent += 1
        for look, (number, content) in pictures:
            self._shown[look] = number
            tray, layer = look
            await self._socket.send_bytes(bytes((tray, LAYERS.index(layer))) + content)
        await self._socket.send_str(json.dumps({'n': self._sent, **news}, allow_nan=False))
        return True

    def hear(self, text: str) -> None:
        """Handle a message of the browser.

        Raises
        ------
        ValueError
            For a message that the page never sends.
        """
        message = json.loads(text)
        if not isinstance(message, dict):
            raise ValueError('no object')
        if type(seen := message.get('seen', 0)) is not int:
            raise ValueError('no number')
        self._seen = max(self._seen, min(seen, self._sent))
        if 'look' in message:
            self.looks = _looks(message['look'])
        self.changed.set()


def _looks(request: Any) -> frozenset[Look]:
    if request is None:
        return frozenset()
    tray, layers = request['tray'], request['layers']
    if type(tray) is not int or not 0 < tray <= _MOST_TRAYS or not isinstance(layers, list):
        raise ValueError('no tray with its layers')
    if any(layer not in LAYERS for layer in layers):
        raise ValueError('no such layer')
    return frozenset((tray, layer) for layer in layers)
