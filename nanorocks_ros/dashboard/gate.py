"""Limits of connections and requests: how many, how long, how often.

Tested by ``test/dashboard/test_gate.py``.
"""

from __future__ import annotations

import asyncio
import ipaddress
import time
from collections import Counter, OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

# Sources that are remembered; the one that has been quiet for longest is forgotten first.
_MOST_SOURCES = 4096
_IPV6_NETWORK_BITS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class GateLimits:
    """What one server allows.

    Parameters
    ----------
    patience_s : float, [s]
        For the head of a request, its body, and between two requests.
    connections, connections_of_source : int
        Open at the same time.
    requests_per_s, requests_at_once : float
        Of one source, on average and in a burst.
    """

    patience_s: float = 10.0
    connections: int = 256
    connections_of_source: int = 96
    requests_per_s: float = 20.0
    requests_at_once: float = 200.0


def source_of(address: str) -> str:
    """The source that an address belongs to: an IPv4 address, or a network of IPv6.

    A host has as many addresses of its IPv6 network as it wants.
    """
    try:
        number = ipaddress.ip_address(address.partition('%')[0])
    except ValueError:
        return address
    if isinstance(number, ipaddress.IPv6Address):
        if number.ipv4_mapped is not None:
            return str(number.ipv4_mapped)
        network = ipaddress.ip_network((number, _IPV6_NETWORK_BITS), strict=False)
        return str(network)
    return str(number)


class RequestRate:
    """How often each source may ask (token bucket).

    Parameters
    ----------
    limits : GateLimits
    """

    def __init__(self, limits: GateLimits) -> None:
        self._limits = limits
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def allows(self, source: str) -> bool:
        """Count a request; whether it may be answered."""
        now = time.monotonic()
        most = self._limits.requests_at_once
        left, last = self._left.pop(source, (most, now))
        left = min(most, left + (now - last) * self._limits.requests_per_s)
        allowed = left >= 1.0
        self._left[source] = (left - allowed, now)
        while len(self._left) > _MOST_SOURCES:
            self._left.popitem(last=False)
        return allowed


class Gate:
    """Counts open connections, and closes those that do not get on.

    Parameters
    ----------
    limits : GateLimits
    """

    def __init__(self, limits: GateLimits) -> None:
        self.limits = limits
        self._open: Counter[str] = Counter()
        self._guards: dict[int, GuardedProtocol] = {}

    def protocol(self, make: Callable[[], asyncio.Protocol]) -> GuardedProtocol:
        """A protocol behind this gate."""
        return GuardedProtocol(self, make())

    def admits(self, source: str) -> bool:
        """Count a new connection; whether it may stay."""
        self._open[source] += 1
        return (
            self._open.total() <= self.limits.connections
            and self._open[source] <= self.limits.connections_of_source
        )

    def leave(self, source: str) -> None:
        """Count a connection that ended."""
        self._open[source] -= 1
        if not self._open[source]:
            del self._open[source]

    def note(self, inner: object, guard: GuardedProtocol | None) -> None:
        """Remember, or forget, which guard a protocol of the server has."""
        if guard is None:
            self._guards.pop(id(inner), None)
        else:
            self._guards[id(inner)] = guard

    def working(self, inner: object, *, busy: bool) -> None:
        """A request is being answered, or was: the time between two begins again."""
        guard = self._guards.get(id(inner))
        if guard is not None:
            guard.set_busy(busy)


class GuardedProtocol(asyncio.Protocol):
    """Passes everything to the protocol of the server, and counts the time without a request.

    Parameters
    ----------
    gate : Gate
    inner : asyncio.Protocol
    """

    def __init__(self, gate: Gate, inner: asyncio.Protocol) -> None:
        self._gate, self._inner = gate, inner
        self._transport: asyncio.Transport | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._source = ''
        self._admitted = False

    def connection_made(self, transport: Any) -> None:
        """Refuse at once what is above the limits."""
        self._transport = transport
        peer = transport.get_extra_info('peername')
        self._source = source_of(str(peer[0])) if peer else ''
        self._admitted = self._gate.admits(self._source)
        if not self._admitted:
            transport.abort()
            return
        self._gate.note(self._inner, self)
        self.set_busy(busy=False)
        self._inner.connection_made(transport)

    def set_busy(self, busy: bool) -> None:
        """Stop the clock while a request is answered; start it again behind that."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if not busy and self._transport is not None and not self._transport.is_closing():
            loop = asyncio.get_running_loop()
            self._timer = loop.call_later(self._gate.limits.patience_s, self._transport.abort)

    def data_received(self, data: bytes) -> None:
        """Pass on."""
        if self._admitted:
            self._inner.data_received(data)

    def eof_received(self) -> bool | None:
        """Pass on."""
        return self._inner.eof_received() if self._admitted else None

    def pause_writing(self) -> None:
        """Pass on."""
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """Pass on."""
        self._inner.resume_writing()

    def connection_lost(self, error: Exception | None) -> None:
        """Pass on, and leave."""
        if self._timer is not None:
            self._timer.cancel()
        self._gate.leave(self._source)
        if self._admitted:
            self._gate.note(self._inner, None)
            self._inner.connection_lost(error)
