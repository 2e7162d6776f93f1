"""Probability of the friction of floor, lid and walls: its prior, and what rebounds say of it.

Rebounds from the side walls show a friction that is a lower estimate of the true one, since beads
that roll, or slip in the vertical direction, too, lose less, and what floor and lid take off
beside a rebound counts as drag: a share of friction / (1 + friction / 0.05). From 0.6 to 1.1 is
taken, which contains what `benchmarks.drawn_friction` found for frictions of 0.01 to 0.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.special import log_ndtr, ndtri_exp

from nanorocks_ros.inference.decay.friction_terms import HIGHEST_FRICTION
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.records import walls_rub
from nanorocks_ros.settings import PriorSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
    from nanorocks_ros.records import Measured

_FRICTION = HIGHEST_FRICTION * np.linspace(0.0, 1.0, 61) ** 2
_SHARE_SHOWN, _ROLLING, _SHARES = (0.6, 1.1), 0.05, 14
# Likelihoods of decays are smooth in ln(1 + friction / this).
_SCALE = 0.01
# Friction with which the decay of beads that count as smooth is read far too low.
_STRONG, _CERTAIN = 0.1, 0.95
# Smallest half width of a prior, of the order of the grid.
_SHARPEST = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionWeights:
    """Probability of the friction of floor, lid and walls.

    Parameters
    ----------
    friction, weight : ndarray (n,)
        Rising; the weights sum to 1.
    """

    friction: NDArray[np.float64]
    weight: NDArray[np.float64]

    @property
    def highest(self) -> float:
        """Friction that is exceeded with a probability of 0.01."""
        return float(np.interp(0.99, np.cumsum(self.weight), self.friction))

    def mixed(
        self, nodes: NDArray[np.float64], log_likelihood: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Logarithm of a likelihood with the friction integrated over.

        Parameters
        ----------
        nodes : ndarray (m,)
            Rising frictions, from 0; likelihoods beyond the last are those of the last.
        log_likelihood : ndarray (m, n_places)

        Returns
        -------
        ndarray (n_places,)
        """
        possible = self.weight > 0.0
        within = np.minimum(self.friction[possible], nodes[-1])
        logs = PchipInterpolator(_even(nodes), log_likelihood)(_even(within))
        # In the logarithm: the likeliest friction of a point may have next to no weight.
        return np.asarray(log_sum(logs + np.log(self.weight[possible])[:, np.newaxis]))


def friction_weights(prior: PriorSettings, contacts: ContactTerms) -> FrictionWeights | None:
    """The friction with its prior and with rebounds; None where neither tells of any.

    A decay alone cannot tell friction from restitution: without rebounds, and without a friction
    in the prior, beads count as smooth.

    Parameters
    ----------
    prior : PriorSettings
        The prior is a Cauchy distribution, with long tails, so that rebounds can overrule it.
    contacts : ContactTerms
    """
    likelihood = contacts.friction_likelihood
    if likelihood is None and prior.friction == 0.0:
        return None
    prior_weight = _steps(_FRICTION) / (
        1.0 + ((_FRICTION - prior.friction) / max(prior.friction_error, _SHARPEST)) ** 2
    )
    low, high = _SHARE_SHOWN
    shares = low + (high - low) * (np.arange(_SHARES) + 0.5) / _SHARES
    shown = shares * shown_at_most(_FRICTION)[:, np.newaxis]
    logs = np.zeros(shown.shape)
    if likelihood is not None:
        logs = np.interp(shown, likelihood.restitution, likelihood.log_likelihood)
    both = prior_weight[:, np.newaxis] * np.exp(logs - logs.max())
    both /= both.sum()
    return FrictionWeights(friction=_FRICTION, weight=both.sum(axis=1))


def is_friction_told(prior: PriorSettings, shown: Measured) -> bool:
    """Whether the prior tells the friction, or rebounds tell a strong one from none.

    The prior does with a friction above 0, or with a smaller error than the default: then 0 was
    measured. Rebounds do where they show friction, or where the 95 % interval of what they show
    ends below what they show of a friction of 0.1 at the least.

    Parameters
    ----------
    prior : PriorSettings
    shown : Measured
        Friction of the side walls by rebounds.
    """
    by_prior = prior.friction > 0.0 or prior.friction_error < PriorSettings().friction_error
    if by_prior or walls_rub(shown):
        return True
    if not shown.known:
        return False
    # Of a Gaussian without its part below 0.
    beyond = math.log(0.5 * (1.0 - _CERTAIN)) + float(log_ndtr(shown.value / shown.error))
    upper = shown.value - shown.error * float(ndtri_exp(beyond))
    return upper < _SHARE_SHOWN[0] * float(shown_at_most(np.array(_STRONG)))


def shown_at_most(friction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frictions of which rebounds show a share.

    Parameters
    ----------
    friction : ndarray
        Of floor, lid and walls.
    """
    return friction / (1.0 + friction / _ROLLING)


def _even(friction: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.log1p(friction / _SCALE))


def _steps(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Width around each node."""
    edges = np.concatenate((nodes[:1], 0.5 * (nodes[1:] + nodes[:-1]), nodes[-1:]))
    return np.diff(edges)
