"""Requests that are none: answered as such, and nothing of them in the terminal."""

from __future__ import annotations

import logging
import socket

import pytest

_FORM = b'POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nContent-Type: '


_LIVE = (
    b'GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
    b'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n'
)


def answer(server, request):
    with socket.create_connection(('127.0.0.1', server.port), timeout=10) as connection:
        connection.sendall(request)
        return connection.recv(4096)


@pytest.mark.parametrize(
    'request_',
    [
        b'GET / HTTP/1.1\r\n\r\n',
        b'nonsense\r\n\r\n',
        b'\x16\x03\x01\x02\x00\x01\x00\x01\xfc',
        b'GET / HTTP/1.1\r\nHost: localhost\r\nCookie: \x00\r\n\r\n',
        b'POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Length: abc\r\n\r\n',
        _LIVE.replace(b'dGhl', b'dG\xff\xfe') + b'\r\n',
        _LIVE.replace(b'websocket\r', b'web\xba\x92socket\r') + b'\r\n',
        _FORM + b'multipart/form-data\r\n\r\nabcde',
        _FORM + b'multipart/form-data; boundary=x\r\n\r\nabcde',
        _FORM + b'application/x-www-form-urlencoded; charset=nonsense\r\n\r\nabcde',
        _FORM + b'application/x-www-form-urlencoded\r\nContent-Encoding: gzip\r\n\r\nabcde',
    ],
    ids=str,
)
def test_a_request_that_is_none_is_answered_400_without_a_traceback(serve, caplog, request_):
    server = serve()
    assert answer(server, request_).split(b'\r\n')[0].endswith(b' 400 Bad Request')
    assert caplog.records == []
    assert answer(server, b'GET / HTTP/1.1\r\nHost: localhost\r\n\r\n').startswith(
        b'HTTP/1.1 200 OK'
    )


def test_a_fault_of_ours_is_still_said(serve, caplog):
    serve()
    log = logging.getLogger('nanorocks_ros.dashboard.server')
    log.error('Error handling request', exc_info=ValueError('ours'))
    assert 'ours' in caplog.text
