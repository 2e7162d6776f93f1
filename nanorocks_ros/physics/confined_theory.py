"""Kinetic theory of a cooling gas of beads between close walls; derived in docs/method/theory.md.

Each class of beads has its own temperatures along x, y and z: in a flat tray the walls cool the
motion along z most, and beads, which collide almost side by side, return little energy to it.
Velocities are Gaussian and uncorrelated before a collision; contact rates are from
`contact_rates`. Nothing is fitted. In the steady state all temperatures fall at the same rate,
by Haff's law.

Against simulation (`python -m benchmarks closed_forms`) the restitution of the beads of trays 1, 3
and 5 comes out within 0.01 from 0.9 up, 0.03 at 0.8 and, with walls from 0.9 to 0.99, 0.04 at 0.7.
Lower ones fail with nearly elastic walls: the steady state, with 3 to 6 times more energy along z,
is reached too late; `confined_decay` integrates up to it. For the grains of trays 6 to 8 it is
0.02 too high at 0.9 (tray 7: at 0.8), and 0.1 at 0.8, where they form clusters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import integrate, optimize, special

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.physics.contact_rates import BeadClasses, Contacts, bead_classes, contacts
from nanorocks_ros.physics.kinetic_theory import check_positive, check_restitution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Mean of |x| of a normal law of variance 1; of |x|^3 it is twice that.
_MEAN = math.sqrt(2.0 / math.pi)
_LOWEST_TRIED = 0.05
_PRECISION = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class Cooling:
    """A gas that cools by Haff's law.

    Parameters
    ----------
    decay_rate : float, [1/m]
        1 / (v0 tau), v0 being the mean projected speed of all beads.
    granular_temperature : ndarray (n, 3), [m^2/s^2]
        Of each class of beads along x, y and z, at a mean projected speed of 1 m/s.
    """

    decay_rate: float
    granular_temperature: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfinedGas:
    """Beads in a box; make one with `confined_gas`.

    Parameters
    ----------
    beads : BeadClasses
    contacts : Contacts
    """

    beads: BeadClasses
    contacts: Contacts

    def cooling(self, restitution: float, wall_restitution: float, width: float = 0.0) -> Cooling:
        """The steady state: all temperatures fall at one rate.

        Parameters
        ----------
        restitution, wall_restitution : float, [0, 1]
        width : float, [0, 1]
            Full width of the uniform distribution of the restitution of single collisions,
            about `restitution`.

        Raises
        ------
        ConfigurationError
            For a restitution outside [0, 1].
        FitError
            When no steady state is found.
        """
        check_restitution(restitution=restitution, wall_restitution=wall_restitution)
        masses = self.beads.masses
        start = np.repeat(np.log(masses.mean() / masses), 3)

        def imbalance(logs: NDArray[np.float64]) -> NDArray[np.float64]:
            temperature = np.exp(logs).reshape(-1, 3)
            rates = self._log_rates(temperature, restitution, wall_restitution, width).ravel()
            differences: NDArray[np.float64] = rates - rates.mean()
            # One of these differences follows from the others; the scale is free.
            differences[0] = self.mean_projected_speed(temperature) - 1.0
            return differences

        scale = self.mean_projected_speed(np.exp(start).reshape(-1, 3))
        solution = optimize.root(imbalance, start - 2.0 * math.log(scale), tol=1e-10)
        if not solution.success:
            raise FitError(
                'confined theory',
                f'no steady state at restitutions {restitution:g} and {wall_restitution:g}',
                'use the decay library',
            )
        temperature = np.exp(solution.x).reshape(-1, 3)
        rate = -float(self._log_rates(temperature, restitution, wall_restitution, width).mean())
        return Cooling(decay_rate=0.5 * rate, granular_temperature=temperature)

    def decay_rate(self, restitution: float, wall_restitution: float, width: float = 0.0) -> float:
        """1 / (v0 tau) [1/m] of the mean projected speed in the steady state.

        Raises
        ------
        ConfigurationError, FitError
            As `cooling`.
        """
        return self.cooling(restitution, wall_restitution, width).decay_rate

    def restitution(self, decay_rate: float, wall_restitution: float, width: float = 0.0) -> float:
        """Restitution between beads for a decay rate; the range of the theory is not checked.

        Parameters
        ----------
        decay_rate : float, [1/m], > 0
        wall_restitution : float, [0, 1]
        width : float, [0, 1]
            As for `cooling`.

        Raises
        ------
        ConfigurationError
            When a value cannot be used.
        FitError
            When no restitution gives this decay.
        """
        check_positive(decay_rate=decay_rate)

        def excess(restitution: float) -> float:
            return self.decay_rate(restitution, wall_restitution, width) - decay_rate

        if excess(1.0) > 0.0:
            raise FitError(
                'confined theory',
                f'walls of restitution {wall_restitution:g} alone give '
                f'{self.decay_rate(1.0, wall_restitution):.3g} /m, more than {decay_rate:.3g} /m',
                'give a higher restitution of the walls',
            )
        if excess(_LOWEST_TRIED) < 0.0:
            raise FitError(
                'confined theory',
                f'no restitution makes a decay of {decay_rate:.3g} /m',
                'check v0, tau and the tray; sticking beads slow down faster',
            )
        return float(optimize.brentq(excess, _LOWEST_TRIED, 1.0, xtol=_PRECISION))

    def speeds(
        self,
        times: NDArray[np.float64],
        restitution: float,
        wall_restitution: float,
        granular_temperature: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Mean projected speed of a gas that does not start in the steady state.

        Parameters
        ----------
        times : ndarray (n_times,), [s]
            Since the start, rising.
        restitution, wall_restitution : float, [0, 1]
        granular_temperature : ndarray (n, 3), [m^2/s^2], > 0
            Of each class of beads, at time 0.

        Returns
        -------
        ndarray (n_times,), [m/s]
            Over all beads.

        Raises
        ------
        ConfigurationError
            When a value cannot be used.
        """
        check_restitution(restitution=restitution, wall_restitution=wall_restitution)
        start = np.asarray(granular_temperature, dtype=np.float64)
        if start.shape != (self.beads.counts.size, 3) or not (start > 0.0).all():
            raise ConfigurationError(
                'granular_temperature',
                f'has the shape {start.shape}',
                f'give three positive numbers for each of {self.beads.counts.size} classes',
            )

        def slope(_: float, logs: NDArray[np.float64]) -> NDArray[np.float64]:
            temperature = np.exp(logs).reshape(-1, 3)
            return self._log_rates(temperature, restitution, wall_restitution).ravel()

        course = integrate.solve_ivp(
            slope,
            (0.0, float(times[-1])),
            np.log(start).ravel(),
            t_eval=times,
            method='LSODA',
            rtol=1e-6,
            atol=1e-8,
        )
        return np.array(
            [self.mean_projected_speed(np.exp(logs.reshape(-1, 3))) for logs in course.y.T]
        )

    def mean_projected_speed(self, granular_temperature: NDArray[np.float64]) -> float:
        """Mean over all beads of the mean modulus of velocity in the x-y plane, [m/s].

        Parameters
        ----------
        granular_temperature : ndarray (n, 3), [m^2/s^2]
        """
        means = _projected(granular_temperature)
        return float(self.beads.counts @ means / self.beads.counts.sum())

    def species_speeds(self, granular_temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean projected speed of each species of the tray, (n_species,), [m/s]."""
        beads = self.beads
        weights = beads.counts * _projected(granular_temperature)
        sums = np.bincount(beads.species, weights)
        speeds: NDArray[np.float64] = sums / np.bincount(beads.species, beads.counts)
        return speeds

    def collision_rates(
        self, granular_temperature: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Collisions of one bead per second, with each class (n, n) and each pair of walls (n, 3).

        Parameters
        ----------
        granular_temperature : ndarray (n, 3), [m^2/s^2]
        """
        spread = self._approach(granular_temperature)
        pairs = (self.contacts.pairs * spread).sum(axis=-1) * (0.5 * _MEAN)
        return pairs, _MEAN * self.contacts.walls * np.sqrt(granular_temperature)

    def velocity_relaxation(
        self, granular_temperature: NDArray[np.float64], restitution: float
    ) -> NDArray[np.float64]:
        """Rate at which bead collisions take a bead's velocity, (n, 3), [1/s].

        -<v_i dv_i/dt> / <v_i^2> of each class along each axis: what the autocorrelation of the
        velocity falls by at first. Rebounds from walls are not in it.

        Parameters
        ----------
        granular_temperature : ndarray (n, 3), [m^2/s^2]
        restitution : float, [0, 1]

        Raises
        ------
        ConfigurationError
            For a restitution outside [0, 1].
        """
        check_restitution(restitution=restitution)
        spread, squares = self._approach(granular_temperature), self.contacts.squares
        weighted = self.contacts.pairs * spread * self._partner_shares()
        summed = np.einsum('abq,abqi->ai', weighted, squares)
        rates: NDArray[np.float64] = _MEAN * (1.0 + restitution) * summed
        return rates

    def _partner_shares(self) -> NDArray[np.float64]:
        """Mass of the second bead over that of both, (n, n, 1)."""
        masses = self.beads.masses
        shares: NDArray[np.float64] = (masses / (masses[:, np.newaxis] + masses))[..., np.newaxis]
        return shares

    def _approach(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviation of the relative velocity along each direction, (n, n, ...)."""
        sums = temperature[:, np.newaxis] + temperature
        squares = np.einsum('abqi,abi->abq', self.contacts.squares, sums)
        spread: NDArray[np.float64] = np.sqrt(squares)
        return spread

    def _log_rates(
        self,
        temperature: NDArray[np.float64],
        restitution: float,
        wall_restitution: float,
        width: float = 0.0,
    ) -> NDArray[np.float64]:
        """Rates of change of ln T, (n, 3), [1/s]; derived in docs/method/theory.md."""
        share = self._partner_shares()
        kick, kick_squared = 1.0 + restitution, (1.0 + restitution) ** 2 + width**2 / 12.0
        spread, squares = self._approach(temperature), self.contacts.squares
        weighted = self.contacts.pairs * spread * share
        gained = kick_squared * np.einsum('abq,abqi->ai', weighted * spread**2 * share, squares)
        lost = 2.0 * kick * np.einsum('abq,abqi->ai', weighted, squares)
        walls = 2.0 * (1.0 - wall_restitution**2) * self.contacts.walls * np.sqrt(temperature)
        rates: NDArray[np.float64] = _MEAN * (gained / temperature - lost - walls)
        return rates


def _projected(temperature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of sqrt(vx^2 + vy^2) for each class; velocities normal, with two variances."""
    along, across = temperature[:, 0], temperature[:, 1]
    projected: NDArray[np.float64] = _MEAN * np.sqrt(along) * special.ellipe(1.0 - across / along)
    return projected


def confined_gas(tray: Tray, sizes: int = 3) -> ConfinedGas:
    """Confined gas of the beads of a tray.

    Parameters
    ----------
    tray : Tray
    sizes : int, > 0
        Number of diameters that represent a species with a range.

    Raises
    ------
    ConfigurationError
        When the tray is too crowded for the theory.
    """
    beads = bead_classes(tray, sizes)
    return ConfinedGas(beads=beads, contacts=contacts(beads, tray.dimensions))
