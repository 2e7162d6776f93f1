"""One browser: what it looks at, and how much of what it was sent it has taken."""

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
"""A tray, and one of `LAYERS`."""

# Steps that may be on their way: with two, a far client does not wait for each by turns.
_AHEAD = 2
_MOST_TRAYS = 99


class Pictures:
    """The last picture of each kind, which is all that anybody gets."""

    def __init__(self) -> None:
        self._latest: dict[Look, tuple[int, bytes]] = {}
        self._count = 0

    def put(self, look: Look, content: bytes) -> None:
        """Keep a picture in place of the one before."""
        self._count += 1
        self._latest[look] = (self._count, content)

    def newer(self, look: Look, than: int) -> tuple[int, bytes] | None:
        """The last picture with its number, if it is newer."""
        picture = self._latest.get(look)
        return picture if picture is not None and picture[0] > than else None

    def keep(self, wanted: frozenset[Look]) -> None:
        """Forget what nobody looks at: it would be shown as if it were new."""
        self._latest = {look: picture for look, picture in self._latest.items() if look in wanted}


class Client:
    """Sends one browser what is new, step by step, and never more than it takes.

    The browser acknowledges each step. What it has not taken is not sent, so that nothing piles
    up, here or on the way: the next step has what is new then.

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
        """Send until the connection ends."""
        try:
            await self._socket.send_str(json.dumps(greeting))
            while True:
                await self.changed.wait()
                self.changed.clear()
                # The next acknowledgement wakes us again.
                if self._sent - self._seen < _AHEAD and await self._step():
                    await asyncio.sleep(self._pause_s)
        except ConnectionError:
            # The browser went away; whoever reads from it hears of that too.
            return

    async def close(self) -> None:
        """Say goodbye."""
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
        """Take what the browser says.

        Raises
        ------
        ValueError
            When our page would not say that.
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
