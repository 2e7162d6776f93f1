"""The server of the page of a film: to whom it answers, and when it ends."""

from __future__ import annotations

import asyncio
import threading
import time

import aiohttp
import numpy as np
import pytest

from nanorocks_ros.dashboard.film_server import FilmServer
from nanorocks_ros.errors import ConfigurationError

FRAMES = [np.full((40, 60, 3), level, np.uint8) for level in (60, 120, 180)]


def recognise(form):
    if 'species' not in form:
        raise ConfigurationError('--bead', 'is missing', 'mark one')
    return {'told': form}


@pytest.fixture
def running():
    """A server in a thread, and what it was told to save."""
    saved = []

    def save(form):
        recognise(form)
        saved.append(form)
        return 'mine.yaml'

    server = FilmServer(FRAMES, 'film.mp4', recognise, save)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.url:
        time.sleep(0.01)
    yield server, saved, thread
    if thread.is_alive():
        asyncio.run(ask(server, '/save', {'species': []}))
        thread.join(10)


async def ask(server, path, form=None, *, token=None, **options):
    """Status and content of an answer."""
    address, _, given = server.url.partition('/?token=')
    headers = {'Authorization': f'Bearer {given if token is None else token}'}
    headers |= options.pop('headers', {})
    async with aiohttp.ClientSession(headers=headers) as client:
        method = 'GET' if form is None and not options else 'POST'
        body = {'json': form} if form is not None else options
        async with client.request(method, address + path, **body) as answer:
            if answer.content_type == 'application/json':
                return answer.status, await answer.json()
            return answer.status, await answer.read()


def test_frames_and_what_is_recognised_are_served(running):
    server, _, _ = running
    assert server.url.startswith('http://127.0.0.1:')
    status, film = asyncio.run(ask(server, '/film'))
    assert (status, film) == (200, {'name': 'film.mp4', 'width': 60, 'height': 40, 'frames': 3})
    status, picture = asyncio.run(ask(server, '/frames/2'))
    assert status == 200
    assert picture.startswith(b'\xff\xd8')
    assert asyncio.run(ask(server, '/frames/3'))[0] == 404
    form = {'species': [1, 2]}
    assert asyncio.run(ask(server, '/recognise', form)) == (200, {'told': form})


def test_the_server_ends_once_something_is_saved(running):
    server, saved, thread = running
    status, answer = asyncio.run(ask(server, '/save', {}))
    assert (status, answer) == (400, {'error': '--bead: is missing; mark one'})
    assert saved == []
    status, answer = asyncio.run(ask(server, '/save', {'species': []}))
    assert (status, answer) == (200, {'saved': 'mine.yaml'})
    thread.join(10)
    assert not thread.is_alive()
    assert saved == [{'species': []}]


@pytest.mark.parametrize('path', ['/film', '/frames/0', '/film.js', '/recognise', '/save'])
def test_nothing_is_told_without_the_token(running, path):
    server, saved, _ = running
    form = {'species': []} if path in ('/recognise', '/save') else None
    assert asyncio.run(ask(server, path, form, token='a wrong token'))[0] == 401
    assert saved == []


def test_pages_of_others_and_other_names_are_refused(running):
    server, saved, _ = running
    for headers in ({'Origin': 'http://evil.example'}, {'Host': 'evil.example'}):
        answer = asyncio.run(ask(server, '/save', json={'species': []}, headers=headers))
        assert answer[0] in (403, 421)
    assert saved == []


@pytest.mark.parametrize('body', [b'', b'[]', b'{', b'\xff', b'[' * 3000, b'3', b'x' * 9000])
def test_what_no_page_sends_is_refused(running, body):
    server, saved, _ = running
    status, _ = asyncio.run(ask(server, '/save', data=body))
    assert status in (400, 413)
    assert saved == []
