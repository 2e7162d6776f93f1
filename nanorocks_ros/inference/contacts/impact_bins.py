"""Restitutions of contacts in ranges of the impact speed, each by itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.inference.contacts.restitution_exponent import kept_beside_contacts
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.records import Interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.impact_likelihoods import Impacts
    from nanorocks_ros.inference.flights.flight_losses import Slowing

# Least contacts of a range, and most ranges.
_LEAST, _MOST = 15, 8
# Nodes of the likelihood of one range, dense towards 1.
_NODES = 1.0 - np.linspace(1.0, 0.03, 200) ** 2
_CONSTANT = np.zeros(1)


class SpeedBin(NamedTuple):
    """Contacts in a range of impact speeds: geometric mean and ends, number, restitution."""

    speed: float
    lowest: float
    highest: float
    contacts: int
    restitution: Interval


def speed_bins(
    impacts: Impacts, slowing: Slowing, ends: NDArray[np.float64], loss_factor: float = 1.0
) -> tuple[SpeedBin, ...]:
    """Restitutions in ranges with equally many contacts; none from too few contacts.

    Parameters
    ----------
    impacts : Impacts
    slowing : Slowing
        What slows beads between contacts.
    ends : ndarray (3,)
        Probabilities of lower end, value and upper end. Errors common to all ranges are left out.
    loss_factor : float, optional
        On 1 - restitution.
    """
    contacts = len(impacts.rows)
    number = min(contacts // _LEAST, _MOST)
    if number == 0:
        return ()
    order = np.argsort(impacts.speeds)
    bins = []
    for part in np.array_split(order, number):
        some = impacts.part(part)
        lower, value, upper = (
            1.0 - loss_factor * (1.0 - _quantiles(some, slowing, ends))
        ).tolist()
        bins.append(
            SpeedBin(
                speed=some.reference,
                lowest=float(some.speeds.min()),
                highest=float(some.speeds.max()),
                contacts=part.size,
                restitution=Interval(value, lower, upper),
            )
        )
    return tuple(bins)


def _quantiles(
    impacts: Impacts, slowing: Slowing, ends: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Quantiles of a restitution that is constant over the range."""
    kept = kept_beside_contacts(impacts, slowing)
    logs = np.array([impacts.logs(case, _NODES, _CONSTANT)[:, 0] for case in kept])
    term = Likelihood1D(restitution=_NODES, log_likelihood=log_sum(logs) - math.log(len(kept)))
    return term.posterior((float(_NODES[0]), float(_NODES[-1]))).quantiles(ends)
