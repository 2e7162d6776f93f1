"""The closed form of [B19], kept under its own name because people compare with it.

It is precise and wrong: on simulated gases it returns 0.94 to 0.99 whatever the truth between
0.6 and 0.95 (``docs/physics.md``). Its interval therefore covers statistics only.
"""

from __future__ import annotations

import math

from nanorocks_ros.errors import ConfigurationError, FitError

# The paper takes the speed in Haff's law to be the most probable relative speed of two
# beads, twice their mean speed ([B19] section 3.1.2).
RELATIVE_TO_MEAN_SPEED = 2.0


def paper_restitution(
    initial_energy: float,
    haff_time: float,
    mass: float,
    diameter: float,
    number_density: float,
) -> float:
    """Coefficient of restitution from the fit of Haff's law to the kinetic energy.

    Parameters
    ----------
    initial_energy : float, [J]
        T0 of the fit, the energy at the mean *relative* speed.
    haff_time : float, [s]
    mass : float, [kg]
        Mean mass of a bead.
    diameter : float, [m]
    number_density : float, [1/m^3]

    Returns
    -------
    float

    Raises
    ------
    ConfigurationError
        When a value is not positive and finite.
    FitError
        When the decay is faster than this form allows for a restitution of zero.

    References
    ----------
    [B19] section 3.1.2: sqrt(1 - sqrt(m/2) / (sigma n tau0 sqrt(T0))), sigma = pi d^2.
    """
    values = {
        'initial_energy': initial_energy,
        'haff_time': haff_time,
        'mass': mass,
        'diameter': diameter,
        'number_density': number_density,
    }
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ConfigurationError(name, f'{value!r}', 'give a positive finite number')
    cross_section = math.pi * diameter**2
    loss = math.sqrt(mass / 2.0) / (
        cross_section * number_density * haff_time * math.sqrt(initial_energy)
    )
    if loss > 1.0:
        raise FitError(
            'paper_restitution',
            f'1 - restitution^2 would be {loss:.3g}',
            'this decay is faster than the closed form allows; check v0, tau and the tray',
        )
    return math.sqrt(1.0 - loss)


def paper_restitution_of_decay(decay_rate: float, diameter: float, number_density: float) -> float:
    """The same closed form for the decay rate of the mean speed itself.

    Parameters
    ----------
    decay_rate : float, [1/m], > 0
        1 / (v0 tau) with v0 the mean projected speed of one bead.
    diameter : float, [m]
    number_density : float, [1/m^3]

    Returns
    -------
    float
        0 where the decay is faster than the form allows (a bound, not a measurement).

    References
    ----------
    [B19] eq. 5 with <v0> = 2 v0.
    """
    cross_section = math.pi * diameter**2
    loss = decay_rate / (RELATIVE_TO_MEAN_SPEED * cross_section * number_density)
    return math.sqrt(max(0.0, 1.0 - loss))
