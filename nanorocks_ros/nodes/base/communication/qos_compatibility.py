"""QoS policies by which a publisher offers less than a subscription requests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rclpy.qos import QoSProfile

# From the weakest to the strongest. No topic here requests a deadline, liveliness or lifespan.
_POLICIES: dict[str, tuple[Any, ...]] = {
    'reliability': (ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE),
    'durability': (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL),
}


class Mismatch(NamedTuple):
    """A policy by which a publisher and a subscription do not match."""

    policy: str
    offered: str
    requested: str


def mismatches(offered: Sequence[QoSProfile], requested: Sequence[QoSProfile]) -> list[Mismatch]:
    """Every policy by which some publisher and some subscription do not match.

    Parameters
    ----------
    offered : sequence of QoSProfile
        Of the publishers.
    requested : sequence of QoSProfile
        Of the subscriptions.

    Returns
    -------
    list of Mismatch
        Without duplicates.
    """
    unique: dict[Mismatch, None] = {}
    for publisher in offered:
        for subscription in requested:
            for policy, order in _POLICIES.items():
                offer, request = getattr(publisher, policy), getattr(subscription, policy)
                comparable = offer in order and request in order
                if comparable and order.index(offer) < order.index(request):
                    unique[Mismatch(policy, offer.name, request.name)] = None
    return list(unique)
