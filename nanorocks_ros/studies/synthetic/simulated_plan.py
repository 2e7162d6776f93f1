"""Plan of simulated runs of a tray: settings, times, what is kept.

Tested by ``test/studies/synthetic/test_simulated_runs.py``.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError, SimulationError
from nanorocks_ros.experiment.trays import tray_values
from nanorocks_ros.simulation.initial_state import rules_of
from nanorocks_ros.simulation.shaken_tray import check_settings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SimulationSettings

MAX_VALUES = 100_000_000
"""Largest number of values kept: 0.8 GB, and as much again while they are written."""
MAX_EVENTS = MAX_VALUES // 6
MAX_DURATION = 86400.0

# Values kept for each time of a run, and for each bead: positions, velocities, body; spins.
_CURVES, _BEAD, _SPIN = 3, 7, 3
# Fractions of the duration; the speed changes most at the beginning.
_SHOWN = 0.0, 0.05, 0.25, 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationPlan:
    """Parameters of simulated runs.

    Parameters
    ----------
    settings : SimulationSettings
    tray : Tray
    duration : float, [s], > 0
        Since the shaking event.
    samples : int, >= 2
        Number of times, evenly spaced from 0 to the duration, at which the gas is sampled.
    runs : int, >= 1
    trajectory : bool
        Whether to keep all beads of all runs at all times.
    picture : bool
        Whether to keep the beads of the first run at `shown_times`.
    events : bool
        Whether to keep every collision.
    trays_file : str
        File that describes the tray; empty: it was flown.

    Raises
    ------
    ConfigurationError
        For a number outside its range.
    """

    settings: SimulationSettings
    tray: Tray
    duration: float
    samples: int
    runs: int = 1
    trajectory: bool = False
    picture: bool = False
    events: bool = False
    trays_file: str = ''

    def __post_init__(self) -> None:
        check_settings(self.settings)
        check_duration(self.duration)
        if self.samples < 2:
            raise ConfigurationError('--times', f'{self.samples}', 'give 2 or more')
        if self.runs < 1:
            raise ConfigurationError('--runs', f'{self.runs}', 'give 1 or more')

    @property
    def times(self) -> NDArray[np.float64]:
        """Times at which the gas is sampled, (samples,), [s]."""
        return np.linspace(0.0, self.duration, self.samples)

    def bead_times(self, run: int) -> NDArray[np.int64]:
        """Indices of the times at which the beads of a run are kept."""
        if self.trajectory:
            return np.arange(self.samples)
        shown = shown_times(self.samples) if self.picture and run == 0 else ()
        return np.array(shown, dtype=np.int64)

    def check_size(self) -> None:
        """Raise for more values than memory may hold.

        Raises
        ------
        ConfigurationError
            For more than `MAX_VALUES` numbers.
        """
        moments = self.samples * self.runs
        rules = rules_of(self.settings, self.tray).compiled()
        bead = self.tray.count * (_BEAD + (_SPIN if rules.rough or rules.rotating else 0))
        kept = moments if self.trajectory else self.bead_times(0).size
        values = moments * _CURVES + kept * bead
        if values > MAX_VALUES:
            raise ConfigurationError(
                f'{self.samples} times of {self.runs} runs with {self.tray.count} beads',
                f'{values:.2g} numbers, more than the {MAX_VALUES:.2g} that are kept at once',
                'give fewer --times or --runs' + (', or no --trajectory' * self.trajectory),
            )

    def check_events(self, events: int) -> None:
        """Raise for more kept collisions than memory may hold.

        Raises
        ------
        SimulationError
            For more than `MAX_EVENTS`.
        """
        if self.events and events > MAX_EVENTS:
            raise SimulationError(
                f'tray {self.tray.number}, {self.runs} runs',
                f'more than the {MAX_EVENTS:.2g} events that are kept at once',
                'give fewer --runs, a shorter --duration, or no --events',
            )

    def provenance(self) -> dict[str, Any]:
        """Everything that the runs depend on."""
        return {
            'nanorocks_ros': __version__,
            'units': 'SI',
            'settings': asdict(self.settings),
            'tray': tray_values(self.tray),
            'runs': self.runs,
            'duration': self.duration,
        }


def shown_times(samples: int) -> tuple[int, ...]:
    """Indices of the times at which a figure shows the beads: early ones, and the last."""
    return tuple(sorted({round(part * (samples - 1)) for part in _SHOWN}))


def check_duration(duration: float) -> None:
    """Raise for a duration out of range.

    Raises
    ------
    ConfigurationError
        Unless it is above 0 and at most a day.
    """
    if not (math.isfinite(duration) and 0.0 < duration <= MAX_DURATION):
        raise ConfigurationError(
            '--duration', f'{duration:g}', f'give seconds above 0, up to {MAX_DURATION:g}'
        )


def default_samples(settings: SimulationSettings, duration: float, limit: int = 301) -> int:
    """Number of times: one for each frame of the camera, at most `limit`."""
    check_duration(duration)
    return max(2, min(limit, math.floor(duration * settings.frame_rate) + 1))
