"""Connections and requests of the live page are limited in number, time and rate."""

from __future__ import annotations

import logging
import socket
import ssl
import subprocess
import time

import pytest

from nanorocks_ros.dashboard.board import Board
from nanorocks_ros.dashboard.gate import GateLimits, RequestRate, source_of
from nanorocks_ros.dashboard.server import PageServer
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import DashboardSettings

PAGE = b'GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n'
PATIENCE_S = 0.4


@pytest.fixture
def strict():
    """Start a server with these limits."""
    started = []

    def start(**limits):
        server = PageServer(
            DashboardSettings(port=0),
            Board(load_trays()),
            '/nanorocks',
            GateLimits(**{'patience_s': PATIENCE_S, **limits}),
        )
        started.append(server)
        server.start()
        return server

    yield start
    for server in started:
        server.stop()


def connect(server):
    return socket.create_connection(('127.0.0.1', server.port), 10.0)


def ask(server, request=PAGE):
    """The whole answer; the server closes the connection."""
    with connect(server) as connection:
        connection.sendall(request)
        return received(connection)


def drip(connection):
    for byte in PAGE:
        connection.sendall(bytes([byte]))
        time.sleep(0.05)


def received(connection):
    content = b''
    try:
        while part := connection.recv(65536):
            content += part
    except ConnectionError:
        pass
    return content


@pytest.mark.parametrize('sent', [b'', b'GET / HT', b'GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n'])
def test_a_connection_without_a_whole_request_is_closed(strict, sent):
    server = strict()
    with connect(server) as connection:
        connection.sendall(sent)
        assert received(connection) == b''
    assert ask(server).startswith(b'HTTP/1.1 200')


def test_drops_of_a_head_do_not_hold_the_connection(strict):
    """One byte now and then."""
    server = strict()
    with connect(server) as connection, pytest.raises(ConnectionError):
        drip(connection)


def test_a_body_that_does_not_come_is_not_waited_for(strict):
    server = strict()
    request = (
        b'POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n'
        b'Content-Type: application/x-www-form-urlencoded\r\n\r\ntoken='
    )
    assert ask(server, request).startswith(b'HTTP/1.1 408')


def test_connections_above_the_limit_are_refused_and_others_served(strict):
    server = strict(connections=5, patience_s=20.0)
    idle = [connect(server) for _ in range(5)]
    assert ask(server) == b''
    for connection in idle:
        connection.close()
    deadline = time.monotonic() + 10.0
    while not ask(server).startswith(b'HTTP/1.1 200'):
        assert time.monotonic() < deadline


def test_a_source_that_asks_too_often_is_told(strict):
    server = strict(requests_per_s=0.001, requests_at_once=3)
    answers = [ask(server)[:12] for _ in range(5)]
    assert answers == [b'HTTP/1.1 200'] * 3 + [b'HTTP/1.1 429'] * 2


def test_sockets_that_are_closed_early_leave_no_traceback(strict, caplog):
    server = strict()
    with caplog.at_level(logging.DEBUG):
        for _ in range(20):
            with connect(server) as connection:
                connection.sendall(PAGE)
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b'\1\0\0\0\0\0\0\0')
        assert ask(server).startswith(b'HTTP/1.1 200')
    assert not [record for record in caplog.records if record.exc_info]


def test_one_source_does_not_use_up_the_rate_of_another():
    rate = RequestRate(GateLimits(requests_per_s=0.001, requests_at_once=2))
    assert [rate.allows('a') for _ in range(3)] == [True, True, False]
    assert rate.allows('b')


@pytest.mark.parametrize(('address', 'source'), [
    ('10.0.0.7', '10.0.0.7'),
    ('::ffff:10.0.0.7', '10.0.0.7'),
    ('2001:db8:1:2:3:4:5:6', '2001:db8:1:2::/64'),
    ('fe80::1%eth0', 'fe80::/64'),
    ('', ''),
])  # fmt: skip
def test_a_network_of_ipv6_is_one_source(address, source):
    assert source_of(address) == source


def test_the_page_is_served_by_https_with_a_certificate(tmp_path):
    key, certificate = tmp_path / 'key.pem', tmp_path / 'certificate.pem'
    subprocess.run(
        ['openssl', 'req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-days', '2', '-subj',
         '/CN=localhost', '-keyout', str(key), '-out', str(certificate)],
        check=True, capture_output=True,
    )  # fmt: skip
    settings = DashboardSettings(port=0, certificate=str(certificate), private_key=str(key))
    server = PageServer(settings, Board(load_trays()), '/nanorocks')
    server.start()
    try:
        assert server.url.startswith('https://')
        context = ssl.create_default_context(cafile=str(certificate))
        with context.wrap_socket(connect(server), server_hostname='localhost') as connection:
            connection.sendall(PAGE)
            assert received(connection).startswith(b'HTTP/1.1 200')
        assert not ask(server).startswith(b'HTTP/1.1 200')
    finally:
        server.stop()


def test_a_certificate_that_cannot_be_used_is_one_line(tmp_path):
    (tmp_path / 'x.pem').write_text('no certificate')
    for settings in (
        DashboardSettings(certificate=str(tmp_path / 'x.pem')),
        DashboardSettings(certificate=str(tmp_path / 'missing.pem')),
        DashboardSettings(private_key=str(tmp_path / 'x.pem')),
    ):
        with pytest.raises(ConfigurationError) as refusal:
            PageServer(settings, Board(load_trays()), '/nanorocks')
        assert '\n' not in str(refusal.value)
