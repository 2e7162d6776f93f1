"""Contacts in a gas: their speeds for another drag, and how the drag shifts the restitution.

A flight is measured in its middle. Until the contact its speed falls by exp(-drag time), and
likewise after a contact, so that a restitution read without drag is too low by the drag times both
times.

Tested by ``test/inference/contacts/test_dragged_contacts.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Measured, Rebound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.inference.flights.flight_losses import Slowing
    from nanorocks_ros.records import PairCollision

# Relative error of a speed below which a contact gets no more weight.
_LEAST_ERROR = 0.01
# A hit of floor or lid that shows ends a flight, so that beside a contact less is lost than by the
# friction rate: what made the restitution of the beads right over that, and its relative spread,
# in trays 1 and 3, frictions of 0.01 to 0.1, drags of 0 and 0.02 /s (`benchmarks.drawn_friction`
# tells whether it holds).
FRICTION_FACTOR, FRICTION_SPREAD = 0.7, 0.6


def dragged(contact: Rebound | PairCollision, drag: float) -> Rebound | PairCollision:
    """A contact with the speeds that it has for another drag of the gas, [1/s]."""
    change = drag - contact.drag
    if change == 0.0:
        return contact
    if isinstance(contact, Rebound):
        slower = float(np.exp(-change * contact.incoming_drag_time))
        faster = float(np.exp(change * contact.outgoing_drag_time))
        return replace(
            contact,
            incoming=_scaled(contact.incoming, slower),
            outgoing=_scaled(contact.outgoing, faster),
            tangential_incoming=slower * contact.tangential_incoming,
            tangential_outgoing=faster * contact.tangential_outgoing,
            drag=drag,
        )
    before = np.exp(-change * contact.before_drag_times)
    after = np.exp(change * contact.after_drag_times)
    return replace(
        contact,
        before=before[:, np.newaxis] * contact.before,
        after=after[:, np.newaxis] * contact.after,
        before_errors=before * contact.before_errors,
        after_errors=after * contact.after_errors,
        drag=drag,
    )


def _scaled(speed: Measured, factor: float) -> Measured:
    return Measured(factor * speed.value, factor * speed.error)


def loss_sums(contacts: Sequence[Rebound | PairCollision]) -> NDArray[np.float64]:
    """Weighted sums over contacts, (4,), for `loss_beside_contacts`.

    Of 1, the drag time, the friction length, and the drag time times the drag taken out. The
    weights are those of the contacts in an estimate of the restitution. Sums of more contacts add
    up.
    """
    rows = np.array([_weight_and_loss(contact) for contact in contacts]).reshape(-1, 4)
    weight, time, length, drag = rows.T
    return np.array([weight.sum(), weight @ time, weight @ length, (weight * time) @ drag])


def _weight_and_loss(contact: Rebound | PairCollision) -> tuple[float, float, float, float]:
    if isinstance(contact, Rebound):
        time = contact.incoming_drag_time + contact.outgoing_drag_time
        square = contact.incoming.error**2 + contact.outgoing.error**2
        speed = contact.incoming.value
    else:
        time = float(np.mean(contact.before_drag_times + contact.after_drag_times))
        square = float(np.sum(contact.before_errors**2 + contact.after_errors**2))
        speed = float(np.linalg.norm(contact.before[1] - contact.before[0]))
    weight = 1.0 / (square / speed**2 + _LEAST_ERROR**2)
    return weight, time, contact.friction_length, contact.drag


def loss_beside_contacts(sums: NDArray[np.float64], slowing: Slowing) -> Measured:
    """Mean relative loss between flights and contacts that is not taken out yet, with its error.

    Parameters
    ----------
    sums : ndarray (4,)
        From `loss_sums`.
    slowing : Slowing
    """
    weight, time, length, taken_out = sums.tolist()
    if not weight > 0.0:
        return Measured(0.0, 0.0)
    reach = np.array([time, FRICTION_FACTOR * length]) / weight
    by_friction = max(float(slowing.values[1] * reach[1]), 0.0)
    variance = float(reach @ slowing.covariance @ reach) + (FRICTION_SPREAD * by_friction) ** 2
    return Measured(float(slowing.values @ reach) - taken_out / weight, math.sqrt(variance))
