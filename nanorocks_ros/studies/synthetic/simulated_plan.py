"""What is to be simulated of a tray, and what is kept of it."""

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

MOST_VALUES = 100_000_000
"""Numbers that may be asked for: 0.8 GB of them, and as much again while they are written."""
MOST_EVENTS = MOST_VALUES // 6
LONGEST = 86400.0

# Numbers kept at one time of a run, and of each of its beads: positions, velocities, body; spins.
_CURVES, _BEAD, _SPIN = 3, 7, 3
# Parts of the duration; most happens early.
_SHOWN = 0.0, 0.05, 0.25, 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationPlan:
    """What is simulated, and what is kept of it.

    Parameters
    ----------
    settings : SimulationSettings
    tray : Tray
    duration : float, [s], > 0
        Since the shaking event.
    samples : int, >= 2
        Times, evenly spaced from 0 to the duration, at which the gas is looked at.
    runs : int, >= 1
    trajectory : bool
        Whether to keep all beads of all runs at all times.
    picture : bool
        Whether to keep the beads of the first run at `shown_times`.
    events : bool
        Whether to keep every collision.

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

    def __post_init__(self) -> None:
        check_settings(self.settings)
        check_duration(self.duration)
        if self.samples < 2:
            raise ConfigurationError('--times', f'{self.samples}', 'give 2 or more')
        if self.runs < 1:
            raise ConfigurationError('--runs', f'{self.runs}', 'give 1 or more')

    @property
    def times(self) -> NDArray[np.float64]:
        """When the gas is looked at, (samples,), [s]."""
        return np.linspace(0.0, self.duration, self.samples)

    def bead_times(self, run: int) -> NDArray[np.int64]:
        """At which of the times the beads of a run are kept."""
        if self.trajectory:
            return np.arange(self.samples)
        shown = shown_times(self.samples) if self.picture and run == 0 else ()
        return np.array(shown, dtype=np.int64)

    def check_size(self) -> None:
        """Refuse what memory may not hold.

        Raises
        ------
        ConfigurationError
            For more than `MOST_VALUES` numbers.
        """
        moments = self.samples * self.runs
        rough = rules_of(self.settings, self.tray).compiled().rough
        bead = self.tray.count * (_BEAD + (_SPIN if rough else 0))
        kept = moments if self.trajectory else self.bead_times(0).size
        values = moments * _CURVES + kept * bead
        if values > MOST_VALUES:
            raise ConfigurationError(
                f'{self.samples} times of {self.runs} runs with {self.tray.count} beads',
                f'{values:.2g} numbers, more than the {MOST_VALUES:.2g} that are kept at once',
                'give fewer --times or --runs' + (', or no --trajectory' * self.trajectory),
            )

    def check_events(self, events: int) -> None:
        """Refuse more collisions than memory may hold, where they are kept.

        Raises
        ------
        SimulationError
            For more than `MOST_EVENTS`.
        """
        if self.events and events > MOST_EVENTS:
            raise SimulationError(
                f'tray {self.tray.number}, {self.runs} runs',
                f'more than the {MOST_EVENTS:.2g} events that are kept at once',
                'give fewer --runs, a shorter --duration, or no --events',
            )

    def provenance(self) -> dict[str, Any]:
        """What makes the runs, and nothing that changes when they are made again."""
        return {
            'nanorocks_ros': __version__,
            'units': 'SI',
            'settings': asdict(self.settings),
            'tray': tray_values(self.tray),
            'runs': self.runs,
            'duration': self.duration,
        }


def shown_times(samples: int) -> tuple[int, ...]:
    """Which of the times of a run a picture shows the beads at: early ones, and the last."""
    return tuple(sorted({round(part * (samples - 1)) for part in _SHOWN}))


def check_duration(duration: float) -> None:
    """Refuse a duration that cannot be simulated.

    Raises
    ------
    ConfigurationError
        Unless it is above 0 and at most a day.
    """
    if not (math.isfinite(duration) and 0.0 < duration <= LONGEST):
        raise ConfigurationError('--duration', f'{duration}', f'give up to {LONGEST:g} s')


def default_samples(settings: SimulationSettings, duration: float, most: int = 301) -> int:
    """A time for every frame of the camera, but no more than so many."""
    check_duration(duration)
    return max(2, min(most, math.floor(duration * settings.frame_rate) + 1))
