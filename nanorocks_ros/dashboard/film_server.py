"""The page on which a film is described: its frames, what is recognised, and the saving.

It listens on the loopback address only, with a token, and ends when something is saved.

Tested by ``test/dashboard/test_film_server.py``.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any

from nanorocks_ros.dashboard.access import Access
from nanorocks_ros.dashboard.gate import Gate, GateLimits
from nanorocks_ros.errors import DashboardError, NanorocksError
from nanorocks_ros.recordings.messages.image_messages import encode_jpeg

try:
    from aiohttp import web

    from nanorocks_ros.dashboard.routes import make_site
except ImportError as error:
    raise DashboardError(
        'the page of a film', 'needs aiohttp', "install it: pip install 'nanorocks_ros[dashboard]'"
    ) from error

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

_HOST = '127.0.0.1'
# The beads of 25 frames of 4k take some ten seconds on a slow machine.
_LIMITS = GateLimits(patience_s=300.0)
_QUALITY = 90
_FAREWELL_S = 1.0


class FilmServer:
    """Serves the page until something is saved, or until Ctrl-C.

    Parameters
    ----------
    frames : sequence of ndarray of uint8, (rows, columns, 3), bgr
    name : str
        Of the film.
    recognise : callable
        Takes what the page says, gives what it shows; raises NanorocksError for what cannot be.
    save : callable
        Takes the same, and gives the name of the file that it wrote.

    Attributes
    ----------
    url : str
        With the token; empty before the page is served.
    """

    def __init__(
        self,
        frames: Sequence[NDArray[np.uint8]],
        name: str,
        recognise: Callable[[Mapping[str, Any]], dict[str, Any]],
        save: Callable[[Mapping[str, Any]], str],
    ) -> None:
        self._frames, self._name = frames, name
        self._recognise, self._save = recognise, save
        self._access = Access(_HOST, secrets.token_urlsafe(18))
        # One after the other: each uses all there is.
        self._worker = ThreadPoolExecutor(1)
        self.url = ''

    def run(self) -> None:
        """Serve; the address is printed.

        Raises
        ------
        DashboardError
            When no port of this machine can be had.
        KeyboardInterrupt
            At Ctrl-C; nothing is saved then.
        """
        try:
            asyncio.run(self._serve())
        finally:
            self._worker.shutdown(wait=False, cancel_futures=True)

    async def _serve(self) -> None:
        self._saved = asyncio.Event()
        try:
            listening = socket.create_server((_HOST, 0))
        except OSError as error:
            raise DashboardError(
                f'host {_HOST}', error.strerror or str(error), 'describe the film by options'
            ) from error
        port = listening.getsockname()[1]
        gate = Gate(_LIMITS)
        runner = web.AppRunner(
            make_site(self._access, port, gate, self._routes(), 'film_page'),
            access_log=None,
            shutdown_timeout=_FAREWELL_S,
            handle_signals=False,
        )
        await runner.setup()
        make = runner.server
        assert make is not None
        server = await asyncio.get_running_loop().create_server(
            lambda: gate.protocol(make), sock=listening
        )
        self.url = f'http://{_HOST}:{port}/?token={self._access.token}'
        # Printed, not logged: the token is in the address.
        print(f'nanorocks: open {self.url} (Ctrl-C ends without saving)', flush=True)
        try:
            await self._saved.wait()
            # The page is told before the connection ends.
            await asyncio.sleep(_FAREWELL_S / 2)
        finally:
            server.close()
            await runner.cleanup()

    def _routes(self) -> list[web.RouteDef]:
        return [
            web.get('/film', self._film),
            web.get(r'/frames/{number:\d{1,4}}', self._frame),
            web.post('/recognise', self._answer_recognise),
            web.post('/save', self._answer_save),
        ]

    async def _film(self, _: web.Request) -> web.Response:
        height, width = self._frames[0].shape[:2]
        shape = {'width': width, 'height': height, 'frames': len(self._frames)}
        return web.json_response({'name': self._name, **shape})

    async def _frame(self, request: web.Request) -> web.Response:
        number = int(request.match_info['number'])
        if number >= len(self._frames):
            return web.Response(status=404, text='no such frame\n')
        content = await self._work(partial(encode_jpeg, self._frames[number], _QUALITY))
        return web.Response(body=content, content_type='image/jpeg')

    async def _answer_recognise(self, request: web.Request) -> web.Response:
        return await self._answer(request, self._recognise)

    async def _answer_save(self, request: web.Request) -> web.Response:
        answer = await self._answer(request, lambda form: {'saved': self._save(form)})
        if answer.status == 200:
            self._saved.set()
        return answer

    async def _answer(
        self, request: web.Request, work: Callable[[Mapping[str, Any]], dict[str, Any]]
    ) -> web.Response:
        """What comes of the form in a request; 400 with a sentence for what cannot be."""
        try:
            form = await request.json()
            if not isinstance(form, dict):
                raise ValueError('no object')
        except (ValueError, LookupError, RecursionError):
            return web.json_response({'error': 'not what the page says'}, status=400)
        try:
            answer = await self._work(partial(work, form))
        except NanorocksError as error:
            return web.json_response({'error': str(error)}, status=400)
        return web.json_response(answer, dumps=partial(json.dumps, allow_nan=False))

    async def _work(self, work: Callable[[], Any]) -> Any:
        return await asyncio.get_running_loop().run_in_executor(self._worker, work)
