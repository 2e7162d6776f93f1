"""Access to the page: from this machine alone, or with a token."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import secrets
import socket
import time
from collections import OrderedDict, deque
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from nanorocks_ros.errors import ConfigurationError, DashboardError

if TYPE_CHECKING:
    from collections.abc import Mapping

SHORTEST_TOKEN = 12
# Failed attempts per minute of one source, after which it is refused; others are not. Sources that
# are remembered: above that the one that failed first is forgotten.
_MOST_FAILURES, _PER_S = 30, 60.0
_MOST_SOURCES = 4096


class Access:
    """The access rules for requests.

    Parameters
    ----------
    host : str
        Address to listen on.
    token : str
        Empty: none on a loopback address, elsewhere one is made up.
    encrypted : bool
        Whether the page is served by HTTPS; then the cookie is never sent without.

    Raises
    ------
    ConfigurationError
        For a token that can be guessed.
    DashboardError
        For a host that has no address.
    """

    def __init__(self, host: str, token: str, *, encrypted: bool = False) -> None:
        if token and (len(token) < SHORTEST_TOKEN or not token.isascii() or ' ' in token):
            raise ConfigurationError(
                'token',
                f'has {len(token)} characters' if token.isascii() else 'is not plain ASCII',
                f'choose {SHORTEST_TOKEN} or more letters and digits, or leave it empty',
            )
        self.host = host
        self.encrypted = encrypted
        self.is_local = is_loopback(host)
        self.token = token or ('' if self.is_local else secrets.token_urlsafe(18))
        self._failures: OrderedDict[str, deque[float]] = OrderedDict()

    @property
    def cookie(self) -> str:
        """Value of the cookie that stands for the token; the same after a restart."""
        return hashlib.sha256(f'nanorocks {self.token}'.encode()).hexdigest()

    def host_is_ours(self, host: str) -> bool:
        """Whether the Host header of a request names this server.

        A page elsewhere can let its own name point to a loopback address, and so read what is
        served there without a token; the name in the request gives it away.
        """
        if not self.is_local:
            # The cookie is bound to the host name, and nothing is served without it.
            return True
        name = _hostname(f'//{host}')
        return name in ('localhost', self.host.lower()) or _is_loopback_number(name)

    def origin_is_ours(self, origin: str | None, host: str) -> bool:
        """Whether a request comes from our own page, or from no page at all."""
        if origin is None:
            return True
        try:
            return urlsplit(origin).netloc.lower() == host.lower()
        except ValueError:
            return False

    def is_token(self, text: str, source: str = '') -> bool:
        """Whether a text is the token; a wrong text counts as a failed attempt of its source."""
        right = bool(self.token) and _same(text, self.token)
        if not right:
            failures = self._failures.setdefault(source, deque(maxlen=_MOST_FAILURES))
            failures.append(time.monotonic())
            while len(self._failures) > _MOST_SOURCES:
                self._failures.popitem(last=False)
        return right

    def is_known(self, headers: Mapping[str, str], cookie: str, source: str = '') -> bool:
        """Whether a request has the cookie, or the token in a header."""
        if not self.token or _same(cookie, self.cookie):
            return True
        kind, _, given = headers.get('Authorization', '').partition(' ')
        return kind == 'Bearer' and not self.is_locked_out(source) and self.is_token(given, source)

    def is_locked_out(self, source: str) -> bool:
        """Whether a source has reached the limit of failed attempts per minute."""
        failures = self._failures.get(source)
        if failures is None or len(failures) < _MOST_FAILURES:
            return False
        return time.monotonic() - failures[0] < _PER_S


def is_loopback(host: str) -> bool:
    """Whether an address can be reached from this machine only.

    Raises
    ------
    DashboardError
        For a name without an address.
    """
    try:
        addresses = socket.getaddrinfo(host or None, 0, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise DashboardError(
            f'host {host!r}', 'has no address here', 'name one of this machine, or 127.0.0.1'
        ) from error
    return all(_is_loopback_number(str(address[0])) for *_, address in addresses)


def _same(given: str, right: str) -> bool:
    # In constant time.
    return hmac.compare_digest(given.encode('utf-8', 'replace'), right.encode())


def _hostname(url: str) -> str:
    try:
        return (urlsplit(url).hostname or '').lower()
    except ValueError:
        return ''


def _is_loopback_number(text: str) -> bool:
    try:
        return ipaddress.ip_address(text.partition('%')[0]).is_loopback
    except ValueError:
        return False
