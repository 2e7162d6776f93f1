"""Motion of the walls of the tray: a damped sine that starts and ends.

Tested by ``test/simulation/engine/rules/test_collision_rules.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from nanorocks_ros.errors import SimulationError


@dataclass(frozen=True, slots=True, kw_only=True)
class WallMotion:
    """Motion of the tray with all its walls: amplitude exp(-damping t) sin(frequency t).

    Parameters
    ----------
    amplitude : tuple of 3 floats, [m]
    angular_frequency : float, [rad/s], > 0
    damping : float, [1/s], >= 0
    start, end : float, [s]
        The tray is at rest, with displacement 0, before and after.
    """

    amplitude: tuple[float, float, float]
    angular_frequency: float
    damping: float = 0.0
    start: float = 0.0
    end: float = math.inf

    @classmethod
    def sinusoidal(
        cls,
        amplitude: tuple[float, float, float],
        frequency: float,
        periods: int,
        start: float = 0.0,
    ) -> WallMotion:
        """Undamped shaking for some periods, at a frequency in Hz.

        Raises
        ------
        SimulationError
            For a frequency that is not above 0.
        """
        _check_frequency(frequency)
        return cls(
            amplitude=amplitude,
            angular_frequency=2.0 * math.pi * frequency,
            start=start,
            end=start + periods / frequency,
        )

    @classmethod
    def impulsive(
        cls,
        velocity: tuple[float, float, float],
        frequency: float,
        damping: float,
        start: float = 0.0,
    ) -> WallMotion:
        """A blow that gives the tray a velocity [m/s], and its damped oscillation.

        The oscillation ends after a whole number of periods, at a millionth of its amplitude.

        Raises
        ------
        SimulationError
            For a frequency that is not above 0.
        """
        _check_frequency(frequency)
        omega = 2.0 * math.pi * frequency
        periods = math.ceil(math.log(1e6) / damping * frequency) if damping > 0.0 else math.inf
        x, y, z = velocity
        return cls(
            amplitude=(x / omega, y / omega, z / omega),
            angular_frequency=omega,
            damping=damping,
            start=start,
            end=start + periods / frequency,
        )


def _check_frequency(frequency: float) -> None:
    if not (math.isfinite(frequency) and frequency > 0.0):
        raise SimulationError('motion', f'frequency {frequency!r}', 'give one above 0, in Hz')


def check_motion(motion: WallMotion) -> None:
    """Refuse a motion that cannot be simulated.

    Raises
    ------
    SimulationError
        For a value that is not finite or outside its range.
    """
    numbers = (*motion.amplitude, motion.damping, motion.start)
    usable = (
        len(motion.amplitude) == 3
        and all(math.isfinite(number) for number in numbers)
        and math.isfinite(motion.angular_frequency)
        and motion.angular_frequency > 0.0
        and motion.damping >= 0.0
        and motion.end >= motion.start
    )
    if not usable:
        raise SimulationError(
            'motion', f'{motion!r}', 'give finite amplitudes, a positive frequency, start <= end'
        )
