"""Published sticking thresholds of dust and beads against mass.

Each curve has its source. Constants that were not checked against the published text are marked
unverified, and so is the curve in tables and figures (`label`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.kinetic_theory import check_positive, check_restitution

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

UNVERIFIED = 'unverified'
_GRAM, _CENTIMETRE = 1e-3, 1e-2

# Relative speed at the onset of clustering by tray, twice the mean speed of the beads, [m/s], the
# sticking threshold of the paper. [B19] section 3.2.3.
PAPER_STICKING_SPEEDS = {1: 0.0104, 3: 0.0109, 5: 0.0128}


@dataclass(frozen=True, slots=True, kw_only=True)
class ThresholdCurve:
    """A sticking threshold that is a power of the mass, v = v1 (m / m1)^p.

    Parameters
    ----------
    name : str
        Meaning of the curve, for a legend.
    mass : float, [kg]
        The mass m1 at which the threshold is `speed`.
    speed : float, [m/s]
    exponent : float
    source : str
        Publication.
    verified : bool
        Whether the constants were checked against the publication.
    """

    name: str
    mass: float
    speed: float
    exponent: float
    source: str
    verified: bool

    @property
    def label(self) -> str:
        """Name and source, with a mark if unverified."""
        mark = '' if self.verified else f' ({UNVERIFIED})'
        return f'{self.name}: {self.source}{mark}'

    def threshold(self, mass: ArrayLike) -> NDArray[np.float64]:
        """The threshold at some masses [kg], [m/s].

        Raises
        ------
        ConfigurationError
            For a mass that is not positive and finite.
        """
        masses = np.asarray(mass, dtype=np.float64)
        if not (np.isfinite(masses).all() and (masses > 0.0).all()):
            raise ConfigurationError('mass', f'{masses.min()!r}', 'give positive finite numbers')
        return np.asarray(self.speed * (masses / self.mass) ** self.exponent)


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedSpeeds:
    """Speeds at which collisions led to sticking; the source gives no mass.

    Parameters
    ----------
    name : str
    lower, upper : float, [m/s]
    source : str
    """

    name: str
    lower: float
    upper: float
    source: str


# The two limits of Windmark et al., after Weidling et al.: below the first all collisions stick,
# above the second all bounce; (m / m1)^(-5/18) cm/s. Not checked against the text.
ALWAYS_STICKING = ThresholdCurve(
    name='all stick below',
    mass=3.0e-12 * _GRAM,
    speed=_CENTIMETRE,
    exponent=-5.0 / 18.0,
    source='Windmark 2012 after Weidling 2012',
    verified=False,
)
ALWAYS_BOUNCING = ThresholdCurve(
    name='all bounce above',
    mass=3.3e-3 * _GRAM,
    speed=_CENTIMETRE,
    exponent=-5.0 / 18.0,
    source='Windmark 2012 after Weidling 2012',
    verified=False,
)
CURVES = ALWAYS_STICKING, ALWAYS_BOUNCING

# The mass above which aggregates bounce goes as v^(-4/3), so the threshold as m^(-3/4): abstract
# of Oshiro et al. 2025, arXiv:2502.03107, there "consistent with the findings of previous
# experiments". The abstract has no constant: a slope, not a curve.
BOUNCING_SLOPE = -3.0 / 4.0
BOUNCING_SLOPE_SOURCE = 'Oshiro 2025, arXiv:2502.03107'

# Abstract of Weidling et al. 2012, arXiv:1105.3909: seven of 125 collisions of aggregates of 0.5
# to 2 mm stuck, at 0.2 to 3 cm/s; those of a millimetre always stick below 8e-5 m/s.
STICKING_SEEN = PublishedSpeeds(
    name='7 of 125 collisions stuck, aggregates of 0.5 to 2 mm',
    lower=0.002,
    upper=0.03,
    source='Weidling 2012, arXiv:1105.3909',
)
MILLIMETRE_STICKS_BELOW = 8e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredThreshold:
    """A sticking threshold measured in one tray.

    Parameters
    ----------
    tray : int
    mass, lightest, heaviest : float, [kg]
        Mean mass of a bead, and range of the masses.
    speed : float, [m/s]
    lower, upper : float, [m/s]
        Ends of its interval; equal to the speed if unknown.
    source : str

    Raises
    ------
    ConfigurationError
        For numbers that are not positive, or an interval without the speed.
    """

    tray: int
    mass: float
    lightest: float
    heaviest: float
    speed: float
    lower: float
    upper: float
    source: str

    def __post_init__(self) -> None:
        check_positive(
            mass=self.mass,
            lightest=self.lightest,
            heaviest=self.heaviest,
            speed=self.speed,
            upper=self.upper,
        )
        if not (0.0 <= self.lower <= self.speed <= self.upper):
            raise ConfigurationError(
                f'threshold of tray {self.tray}',
                f'{self.speed:g} m/s is not within {self.lower:g} to {self.upper:g} m/s',
                'give an interval that holds it',
            )


def collapse_time_factor(restitution: float) -> float:
    """Factor on the collapse time of a cloud of bouncing particles, 1 / (1 - e^2).

    Relative to perfectly inelastic collisions, for clouds of low mass, in which collisions do not
    fragment particles and are faster than the free fall.

    Parameters
    ----------
    restitution : float, [0, 1]
        Between particles.

    Returns
    -------
    float
        1 at a restitution of 0; infinite at 1.

    Raises
    ------
    ConfigurationError
        For a restitution outside 0 to 1.

    References
    ----------
    [B19] section 4.2 ("Particle Cloud Collapse"), after Wahlberg Jansson, Johansen 2014,
    arXiv:1408.2535. The paper says "up to a factor 5" at 0.89: it is 4.81.
    """
    check_restitution(restitution=restitution)
    loss = 1.0 - restitution**2
    return 1.0 / loss if loss > 0.0 else math.inf
