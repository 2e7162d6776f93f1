"""Where a publisher offers less than a subscriber asks for."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

# From the least to the most. Nothing here asks for deadlines or signs of life.
_ORDERS = {
    'reliability': (ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE),
    'durability': (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL),
}


def mismatches(offered, asked):
    """Every policy by which some publisher and some subscriber do not go together.

    Parameters
    ----------
    offered, asked : sequence of QoSProfile

    Returns
    -------
    list of (str, str, str)
        Policy, what is offered, what is asked for.
    """
    found = {}
    for have in offered:
        for want in asked:
            for policy, order in _ORDERS.items():
                one, other = getattr(have, policy), getattr(want, policy)
                if one in order and other in order and order.index(one) < order.index(other):
                    found[policy, one.name, other.name] = None
    return list(found)
