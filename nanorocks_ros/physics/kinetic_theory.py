"""Kinetic theory of a gas of equal, smooth, inelastic spheres without walls.

Valid for a homogeneous gas far from any wall: filling factors up to 0.3 (the contact value is
good to 0.3 % there) and restitutions from 0.8 up, where the cooling rate is good to 1 %; below,
velocity correlations of colliding beads reduce it by some per cent. The walls of the trays of the
flight take about half of the energy, so that `kinetic_restitution` is far too low for their
decays: use `confined_theory` there.
"""

from __future__ import annotations

import math

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.physics.error_propagation import Estimate, propagated

# Coefficient of the decay rate of the mean 3-D speed: sqrt(2)/6, from integrals over the Maxwell
# distribution.
HAFF_COEFFICIENT = math.sqrt(2.0) / 6.0
# Ratio of mean projected to mean 3-D speed of an isotropic gas.
PROJECTION = math.pi / 4.0
# Filling factor at which the fluid freezes, and the equation of state ends.
FREEZING = 0.494


def filling_factor(diameter: float, number_density: float) -> float:
    """Volume fraction of the beads: diameter [m], number density [1/m^3].

    Raises
    ------
    ConfigurationError
        When a value is not positive and finite, or the gas would be denser than a fluid can be.
    """
    check_positive(diameter=diameter, number_density=number_density)
    filling = math.pi / 6.0 * number_density * diameter**3
    if filling >= FREEZING:
        raise ConfigurationError(
            'number_density',
            f'fills {filling:.3g} of the volume',
            f'give less than {FREEZING}, where hard spheres freeze',
        )
    return filling


def check_positive(**values: float) -> None:
    """Refuse values that are not positive and finite, by their names.

    Raises
    ------
    ConfigurationError
    """
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ConfigurationError(name, f'{value!r}', 'give a positive finite number')


def check_restitution(**values: float) -> None:
    """Refuse restitutions outside [0, 1], by their names.

    Raises
    ------
    ConfigurationError
    """
    for name, value in values.items():
        if not 0.0 <= value <= 1.0:
            raise ConfigurationError(name, f'{value!r}', 'give a number from 0 to 1')


def contact_value(filling: float) -> float:
    """Pair correlation at contact, (1 - phi/2) / (1 - phi)^3.

    Parameters
    ----------
    filling : float, [0, 0.494)

    References
    ----------
    Carnahan, Starling 1969, J. Chem. Phys. 51, 635, doi:10.1063/1.1672048.
    """
    return (1.0 - 0.5 * filling) / (1.0 - filling) ** 3


def kinetic_decay_rate(restitution: float, diameter: float, number_density: float) -> float:
    """1 / (v0 tau) [1/m] of the mean projected speed: (4/pi) (sqrt(2)/6) (1 - e^2) pi d^2 n g.

    Parameters
    ----------
    restitution : float, [0, 1]
    diameter : float, [m], > 0
    number_density : float, [1/m^3], > 0

    Raises
    ------
    ConfigurationError
        When a value cannot be used.

    References
    ----------
    Haff 1983, J. Fluid Mech. 134, 401; derivation in docs/method/theory.md.
    """
    check_restitution(restitution=restitution)
    return _decay_at_zero(diameter, number_density) * (1.0 - restitution**2)


def _decay_at_zero(diameter: float, number_density: float) -> float:
    crowding = contact_value(filling_factor(diameter, number_density))
    cross_section = math.pi * diameter**2
    return HAFF_COEFFICIENT / PROJECTION * cross_section * number_density * crowding


def kinetic_haff_time(
    initial_speed: float, restitution: float, diameter: float, number_density: float
) -> float:
    """Haff time [s] of a gas with a mean projected speed v0 [m/s]; infinite when elastic.

    Raises
    ------
    ConfigurationError
        When a value cannot be used.
    """
    check_positive(initial_speed=initial_speed)
    rate = kinetic_decay_rate(restitution, diameter, number_density)
    return 1.0 / (initial_speed * rate) if rate > 0.0 else math.inf


def kinetic_restitution(
    decay_rate: Estimate | float, diameter: Estimate | float, number_density: Estimate | float
) -> Estimate:
    """Restitution of a gas without walls whose mean projected speed decays at a rate.

    Errors are propagated to first order.

    Parameters
    ----------
    decay_rate : Estimate or float, [1/m], > 0
        1 / (v0 tau) with v0 the mean projected speed.
    diameter : Estimate or float, [m], > 0
    number_density : Estimate or float, [1/m^3], > 0

    Raises
    ------
    ConfigurationError
        When a value cannot be used.
    FitError
        When the decay is faster than at a restitution of zero.
    """
    return propagated(
        _restitution, decay_rate=decay_rate, diameter=diameter, number_density=number_density
    )


def _restitution(decay_rate: float, diameter: float, number_density: float) -> float:
    check_positive(decay_rate=decay_rate)
    loss = decay_rate / _decay_at_zero(diameter, number_density)
    if loss > 1.0:
        raise FitError(
            'kinetic_restitution',
            f'1 - restitution^2 would be {loss:.3g}',
            'this decay is faster than collisions of beads allow; walls take part: use the '
            'confined theory',
        )
    return math.sqrt(1.0 - loss)
