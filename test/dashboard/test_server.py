"""What is served, to whom, and what slow and hostile clients cannot do."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import struct
from contextlib import asynccontextmanager
from dataclasses import replace

import aiohttp
import pytest

from nanorocks_ros.errors import DashboardError
from nanorocks_ros.records import Measured

TOKEN = 'correct-horse-battery'
_PATIENCE_S = 10.0


@asynccontextmanager
async def session(server):
    address = f'http://127.0.0.1:{server.port}'
    timeout = aiohttp.ClientTimeout(total=_PATIENCE_S)
    jar = aiohttp.CookieJar(unsafe=True)  # of addresses in numbers, too
    async with aiohttp.ClientSession(address, timeout=timeout, cookie_jar=jar) as client:
        yield client


async def status(server, path='/', **options):
    async with (
        session(server) as client,
        client.get(path, allow_redirects=False, **options) as answer,
    ):
        return answer.status


@asynccontextmanager
async def live(server, **options):
    async with session(server) as client, client.ws_connect('/live', **options) as connection:
        assert (await connection.receive_json())['namespace'] == '/nanorocks'
        yield connection


async def step(connection):
    """The next step, acknowledged, and the pictures before it."""
    pictures = []
    while True:
        message = await connection.receive(_PATIENCE_S)
        if message.type is aiohttp.WSMsgType.BINARY:
            pictures.append(message.data)
            continue
        answer = json.loads(message.data)
        await connection.send_json({'seen': answer['n']})
        return answer, pictures


async def seen(connection, server, *looks):
    """Wait until the server knows what we look at."""
    for _ in range(200):
        if server.wanted == frozenset(looks):
            return
        await asyncio.sleep(0.02)
    raise AssertionError(server.wanted)


def test_every_answer_keeps_other_pages_and_scripts_out(serve):
    server = serve()

    async def check():
        async with session(server) as client:
            for path in ('/', '/app.js', '/style.css', '/nothing', '/login'):
                async with client.get(path) as answer:
                    policy = answer.headers['Content-Security-Policy']
                    assert "default-src 'none'" in policy
                    assert 'unsafe' not in policy
                    assert answer.headers['X-Content-Type-Options'] == 'nosniff'
                    assert answer.status == (404 if path == '/nothing' else 200)

    asyncio.run(check())


def test_only_files_of_the_page_are_served(serve):
    server = serve()

    for path in ('/../server.py', '/%2e%2e/server.py', '/page/app.js', '//etc/passwd'):
        connection = http.client.HTTPConnection('127.0.0.1', server.port, timeout=_PATIENCE_S)
        connection.request('GET', path)
        assert connection.getresponse().status == 404
        connection.close()


def test_a_file_that_a_browser_has_is_not_sent_again(serve):
    server = serve()

    async def check():
        async with session(server) as client:
            async with client.get('/app.js') as answer:
                tag = answer.headers['ETag']
            async with client.get('/app.js', headers={'If-None-Match': tag}) as answer:
                assert answer.status == 304

    asyncio.run(check())


def test_other_names_and_other_pages_are_refused(serve):
    server = serve()

    async def check():
        assert await status(server, headers={'Host': f'evil.example:{server.port}'}) == 421
        for origin in ('http://evil.example', 'null'):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                async with live(server, headers={'Origin': origin}):
                    pass
            assert refused.value.status == 403
        async with live(server, headers={'Origin': f'http://127.0.0.1:{server.port}'}):
            pass

    asyncio.run(check())


def test_without_the_token_there_is_the_form_alone(serve):
    server = serve(token=TOKEN)

    async def check():
        for path in ('/app.js', '/live', '/charts.js'):
            assert await status(server, path) == 401
        assert await status(server, '/login') == 200
        assert await status(server, '/') == 303
        assert await status(server, '/?token=wrong-wrong-wrong') == 303
        assert await status(server, '/live', headers={'Authorization': 'Bearer no'}) == 401
        async with live(server, headers={'Authorization': f'Bearer {TOKEN}'}):
            pass

    asyncio.run(check())


def test_the_token_in_the_address_becomes_a_cookie_that_scripts_cannot_read(serve):
    server = serve(token=TOKEN)
    assert server.url == f'http://127.0.0.1:{server.port}/?token={TOKEN}'

    async def check():
        async with session(server) as client:
            async with client.get(f'/?token={TOKEN}', allow_redirects=False) as answer:
                cookie = answer.headers['Set-Cookie']
                assert answer.headers['Location'] == '/'
            assert 'HttpOnly' in cookie
            assert 'SameSite=Strict' in cookie
            assert TOKEN not in cookie
            async with client.get('/') as answer:
                assert answer.status == 200
            async with client.ws_connect('/live') as connection:
                assert 'namespace' in await connection.receive_json()

    asyncio.run(check())


def test_an_address_that_others_reach_is_served_with_a_token_that_is_made_up(serve):
    server = serve(host='0.0.0.0')
    assert '?token=' in server.url

    async def check():
        assert await status(server, '/live') == 401
        given = server.url.partition('?token=')[2]
        assert await status(server, '/app.js', headers={'Authorization': f'Bearer {given}'}) == 200

    asyncio.run(check())


def test_a_port_in_use_is_named():
    from nanorocks_ros.dashboard.board import Board
    from nanorocks_ros.dashboard.server import PageServer
    from nanorocks_ros.settings import DashboardSettings

    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = taken.getsockname()[1]
        server = PageServer(DashboardSettings(port=port), Board({}), '/nanorocks')
        with pytest.raises(DashboardError) as refused:
            server.start()
    assert str(refused.value).startswith(f'port {port} of 127.0.0.1: ')
    assert 'in use; choose another port' in str(refused.value)


def test_whoever_comes_late_gets_the_whole_cycle_at_once(serve, results):
    server = serve()
    for record in results.all:
        server.take(record)

    async def check():
        async with live(server) as connection:
            answer, _ = await step(connection)
            tray = answer['trays']['1']
            assert len(tray['cor']['rows']) == len(results.cors)
            of_cycle = [speed for speed in results.speeds if speed.cycle == tray['cycle']]
            assert len(tray['speed']['rows']) == len(of_cycle)
            assert tray['latest']['cor']['restitution'] == pytest.approx(
                results.cors[-1].restitution.value
            )

    asyncio.run(check())


def test_a_picture_goes_to_those_who_look_at_it(serve):
    server = serve()

    async def check():
        async with live(server) as viewer, live(server) as other_viewer:
            await viewer.send_json({'look': {'tray': 2, 'layers': ['tracks']}})
            await seen(viewer, server, (2, 'tracks'))
            server.show((2, 'tracks'), b'jpeg')
            server.diagnose([('/n', 0, '', [])])
            assert (await step(viewer))[1] == [b'\x02\x01jpeg']
            assert (await step(other_viewer))[1] == []
            await viewer.send_json({'look': None})
            await seen(viewer, server)
        for _ in range(100):
            if server.clients == 0:
                return
            await asyncio.sleep(0.02)
        raise AssertionError('still there')

    asyncio.run(check())


@pytest.mark.parametrize(
    'said',
    ['no json', '[]', '{"look": 3}', '{"look": {"tray": 1, "layers": ["../etc"]}}',
     '{"look": {"tray": -1, "layers": []}}', '{"seen": "9"}', '[' * 4000],
)  # fmt: skip
def test_whoever_says_what_the_page_does_not_is_sent_away(serve, said):
    server = serve()

    async def check():
        async with live(server) as connection:
            await connection.send_str(said)
            message = await connection.receive(_PATIENCE_S)
            assert message.type is aiohttp.WSMsgType.CLOSE
            assert message.data == 1008
        async with live(server):
            pass

    asyncio.run(check())


def raw_client(server):
    """A client that opens the live connection and reads nothing."""
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
    client.settimeout(_PATIENCE_S)
    client.connect(('127.0.0.1', server.port))
    client.sendall(
        b'GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
        b'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n'
    )
    client.sendall(_text_frame({'look': {'tray': 1, 'layers': ['tray']}}))
    return client


def _text_frame(message):
    content = json.dumps(message).encode()
    assert len(content) < 126
    return bytes((0x81, 0x80 | len(content))) + bytes(4) + content  # masked with zeros


def test_whoever_leaves_behind_many_pings_is_no_fault_of_the_server(serve, caplog):
    server = serve()
    for _ in range(5):
        client = raw_client(server)
        client.sendall((b'\x89\x80' + bytes(4)) * 5000)
        # It is reset at once, not closed in good order.
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))
        client.close()

    async def check():
        async with live(server):
            pass

    asyncio.run(check())
    server.stop()
    assert [record.message for record in caplog.records if record.levelname == 'ERROR'] == []


def drained(client):
    """All that was sent to a client and is still on the way."""
    client.settimeout(0.5)
    size = 0
    try:
        while received := client.recv(1 << 20):
            size += len(received)
    except TimeoutError:
        return size
    return size


@pytest.mark.parametrize('claims', [False, True], ids=['silent', 'claims to have read'])
def test_a_client_that_does_not_read_holds_up_nobody_and_piles_up_nothing(serve, results, claims):
    server = serve()
    picture = bytes(200_000)
    rounds = 60
    slow = raw_client(server)

    async def check():
        async with live(server) as quick:
            await quick.send_json({'look': {'tray': 1, 'layers': ['tray']}})
            await seen(quick, server, (1, 'tray'))
            for k in range(rounds):
                server.show((1, 'tray'), picture)
                server.take(replace(results.speeds[-1], mean_projected_speed=Measured(0.001 * k)))
                if claims:
                    slow.sendall(_text_frame({'seen': k}))
                answer, pictures = await step(quick)
                assert pictures in ([], [b'\x01\x00' + picture])
            speed = answer['trays']['1']['latest']['speed']
            assert speed['mean_projected_speed'] == pytest.approx(0.001 * (rounds - 1))

    asyncio.run(check())
    # Two steps; or, of one who lies, what the system itself keeps for a connection.
    limit = 6e6 if claims else 2.2 * len(picture) + 20_000
    assert drained(slow) < limit < rounds * len(picture)
    slow.close()


def test_browsers_beyond_the_most_are_told(serve):
    server = serve()

    async def check():
        async with session(server) as client:
            open_ones = [await client.ws_connect('/live') for _ in range(64)]
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await client.ws_connect('/live')
            assert refused.value.status == 503
            for connection in open_ones:
                await connection.close()

    asyncio.run(check())


def test_the_end_of_the_server_is_told(serve):
    server = serve()

    async def check():
        async with live(server) as connection:
            await asyncio.to_thread(server.stop)
            message = await connection.receive(_PATIENCE_S)
            assert message.type is aiohttp.WSMsgType.CLOSE

    asyncio.run(check())
