"""What each assumption does to the restitutions where it does not hold, and what is noticed.

True tracks with the errors of tracking (`benchmarks.contacts`) and mean speeds with errors of 2 %,
20 s from 10 mm/s, restitutions 0.89 and 0.97. The truth differs from what the stages are told in
one thing at a time. A shift is that of the headline against the ideal cycles of the same seeds;
the ideal row itself has errors against the truth. ``NANOROCKS_DEVIATION`` selects the rows whose
names contain it, beside the ideal ones.

Tested by ``test/validation/test_sensitivity.py``.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from benchmarks import rough_gas as gas
from benchmarks.accelerated_tray import AcceleratedTray
from benchmarks.contacts import contacts_of, tracks_of
from benchmarks.coverage import coverage
from benchmarks.cycle_estimates import estimate_of_tracks
from benchmarks.late_stamps import LateTray
from benchmarks.rolling_shutter import RolledTray
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.records import Headline, PairCollision, Quality
from nanorocks_ros.settings import PipelineSettings, PriorSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.stages.scale.scale_check import ScaleCheck

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from benchmarks.contacts import Contacts
    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.records import CorEstimate, Measured, Tracks
    from nanorocks_ros.simulation.shaken_tray import Moment

    _Beads: TypeAlias = ShakenTray | AcceleratedTray | RolledTray | LateTray

_TRAYS = (1, 3)
_CYCLES = 20
_SEED = 2028
_FRAMES = 600
_TRUTH = {'restitution': gas.PAIRS, 'wall_restitution': gas.WALLS}
_ALL_CORES = Workers()
# Standard errors by which a measured drag or friction is noticed.
_NOTICED = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """In what the truth differs from what the stages are told.

    Parameters
    ----------
    name : str
    height : float, [m]
        Of the tray, added.
    count : int
        Beads of the first species, added; tracked as the others.
    untracked : int
        Beads of the first species, added; not tracked.
    diameter : float
        Factor on all diameters.
    size_spread : float
        Standard deviation of the diameters of each species, relative, beside what is told.
    simulation : dict
        Settings of the simulation.
    acceleration : tuple of 3 floats, [m/s^2]
        Of all beads.
    scale : float
        Factor on all lengths in the picture.
    tilt : float, [rad]
        Of the axis of the camera, towards the length of the tray.
    camera_height, aside : float, [m]
        Of the camera above half the height of the tray, where the scale is as told, and from its
        middle along its length.
    readout : float, [s]
        From the first row of the tray that the camera reads to the last.
    late : float, [s]
        Standard deviation of the time between a picture and its stamp.
    prior : dict
        Settings of the prior that are told.
    """

    name: str
    height: float = 0.0
    count: int = 0
    untracked: int = 0
    diameter: float = 1.0
    size_spread: float = 0.0
    simulation: dict[str, Any] = field(default_factory=dict)
    acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0
    tilt: float = 0.0
    camera_height: float = math.inf
    aside: float = 0.0
    readout: float = 0.0
    late: float = 0.0
    prior: dict[str, float] = field(default_factory=dict)


def _rubbing(friction: float) -> dict[str, float]:
    return gas.Roughness(tangential=0.4, friction=friction).settings


IDEAL = Deviation(name='nothing: errors')
DEVIATIONS = (
    IDEAL,
    Deviation(name='height +0.2 mm', height=2e-4),
    Deviation(name='height -0.2 mm', height=-2e-4),
    Deviation(name='a bead missing', count=-1),
    Deviation(name='a bead too many, tracked', count=1),
    Deviation(name='a bead too many, not tracked', untracked=1),
    Deviation(name='diameters +2 %', diameter=1.02),
    Deviation(name='diameters spread by 5 %', size_spread=0.05),
    Deviation(
        name='floor and lid lose twice as much',
        simulation={'floor_lid_difference': gas.WALLS - 1.0},
    ),
    Deviation(name='drag 0.02 /s', simulation={'drag': 0.02}),
    Deviation(name='friction 0.01', simulation=_rubbing(0.01)),
    Deviation(name='friction 0.03', simulation=_rubbing(0.03)),
    Deviation(name='acceleration 0.1 mm/s² in the picture', acceleration=(1e-4, 0.0, 0.0)),
    Deviation(name='acceleration 1 mm/s² in the picture', acceleration=(1e-3, 0.0, 0.0)),
    Deviation(name='acceleration 1 mm/s² along the view', acceleration=(0.0, 0.0, 1e-3)),
    Deviation(name='camera tilted by 2°', tilt=math.radians(2.0)),
    Deviation(name='image scale +1 %', scale=1.01),
    Deviation(name='camera at 0.2 m', camera_height=0.2),
    Deviation(name='camera at 0.2 m, 40 mm aside', camera_height=0.2, aside=0.04),
    Deviation(name='camera at 0.12 m, 40 mm aside', camera_height=0.12, aside=0.04),
    Deviation(name='rows of the tray read within 30 ms', readout=0.03),
    Deviation(name='the same, not looked for', readout=0.03, prior={'readout': 0.0}),
    Deviation(name='time stamps off by 3 ms', late=3e-3),
)


def true_tray(told: Tray, deviation: Deviation) -> Tray:
    """The tray that is simulated; untracked beads are its last species."""
    species = [_true_species(kind, deviation) for kind in told.species]
    first = species[0]
    species[0] = replace(first, count=first.count + deviation.count)
    if deviation.untracked:
        species.append(replace(first, count=deviation.untracked))
    length, width, height = told.dimensions
    return replace(
        told, species=tuple(species), dimensions=(length, width, height + deviation.height)
    )


def _true_species(told: Species, deviation: Deviation) -> Species:
    """Diameters are uniform: half of their range is sqrt(3) standard deviations."""
    half = 0.5 * deviation.diameter * (told.diameter_high - told.diameter_low)
    spread = math.sqrt(3.0) * deviation.size_spread * deviation.diameter * told.diameter
    wider = math.hypot(half, spread) - half
    return replace(
        told,
        diameter_low=deviation.diameter * told.diameter_low - wider,
        diameter_high=deviation.diameter * told.diameter_high + wider,
    )


class SeenTray:
    """A tray as a camera sees it whose scale, direction or distance is not as told.

    Parameters
    ----------
    beads : ShakenTray, AcceleratedTray, RolledTray or LateTray
    tray : Tray
    deviation : Deviation
    """

    def __init__(
        self,
        beads: _Beads,
        tray: Tray,
        deviation: Deviation,
    ) -> None:
        self._beads = beads
        self._middle = 0.5 * np.array(tray.dimensions)
        cosine, sine = math.cos(deviation.tilt), math.sin(deviation.tilt)
        self._scale = deviation.scale
        self._axis = self._middle[:2] + np.array([deviation.aside, 0.0])
        self._camera_height = deviation.camera_height
        # To columns and rows of the picture, and depth.
        self._view = deviation.scale * np.array(
            [[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]]
        )

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead in the picture, (n,), [m]."""
        return self._scale * self._beads.radii

    def moments(self, frames: int) -> Iterator[Moment]:
        """Iterate over the frames; to be called once."""
        yield from map(self.seen, self._beads.moments(frames))

    def seen(self, moment: Moment) -> Moment:
        """A moment as the camera sees it."""
        positions = self._middle + (moment.positions - self._middle) @ self._view
        places, motion = self._projected(positions, moment.velocities @ self._view)
        return replace(moment, positions=places, velocities=motion)

    def _projected(
        self, positions: NDArray[np.float64], velocities: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places at half the height of the tray that look the same, and their velocities."""
        aside = positions[:, :2] - self._axis
        nearer = positions[:, 2:] - self._middle[2]
        larger = 1.0 / (1.0 - nearer / self._camera_height)
        places, motion = positions.copy(), velocities.copy()
        places[:, :2] = self._axis + larger * aside
        rise = larger * velocities[:, 2:] / self._camera_height
        motion[:, :2] = larger * (velocities[:, :2] + rise * aside)
        return places, motion


def tracks_of_cycle(told: Tray, deviation: Deviation, run: int) -> list[Tracks]:
    """Tracks of a cycle by a tracker that never loses a bead, but those that are not tracked."""
    tray = true_tray(told, deviation)
    settings = _settings(told, deviation)
    beads: _Beads
    if any(deviation.acceleration):
        beads = AcceleratedTray(settings, tray, run, deviation.acceleration)
    else:
        beads = shaken = ShakenTray(settings, tray, run)
        if deviation.readout:
            beads = RolledTray(shaken, tray, deviation.readout, settings.frame_rate)
        elif deviation.late:
            own = np.random.default_rng([_SEED, run, 3])
            beads = LateTray(shaken, deviation.late, settings.frame_rate, own)
    rng = np.random.default_rng([_SEED, run])
    seen = SeenTray(beads, tray, deviation)
    return [_as_told(tracks, told) for tracks in tracks_of(seen, tray, rng, _FRAMES)]


def _settings(told: Tray, deviation: Deviation):
    return gas.settings_of(told, gas.SMOOTH, seed=_SEED, **deviation.simulation)


def _as_told(tracks: Tracks, told: Tray) -> Tracks:
    """Tracks of the species of the tray as it was told, with its number of beads."""
    tracked = tracks.species < len(told.species)
    names = (
        'ids', 'species', 'positions', 'position_errors', 'velocities', 'velocity_errors',
        'radii', 'radius_errors', 'seen',
    )  # fmt: skip
    return replace(
        tracks,
        **{name: getattr(tracks, name)[tracked] for name in names},
        expected=np.array([species.count for species in told.species], dtype=np.int32),
    )


def cycle_of(told: Tray, deviation: Deviation, run: int) -> tuple[CorEstimate, Quality]:
    """The final estimate of a cycle, and what the check of the image scale says of it."""
    tracks = tracks_of_cycle(told, deviation, run)
    contacts = contacts_of(told, iter(tracks))
    prior = replace(PriorSettings(), **deviation.prior)
    estimate = estimate_of_tracks(told, tracks, contacts, [_SEED, run, 2], prior)
    return estimate, _scale_flag(told, tracks, contacts)


def _scale_flag(told: Tray, tracks: list[Tracks], contacts: Contacts) -> Quality:
    check = ScaleCheck(PipelineSettings(), told)
    for record in tracks:
        check.push(record)
    for contact in contacts:
        if isinstance(contact, PairCollision):
            check.push(contact)
    check.flush()
    return check.flag


def _cycle_of(task: tuple[int, Deviation, int]) -> tuple[CorEstimate, Quality]:
    number, deviation, run = task
    return cycle_of(load_trays()[number], deviation, run)


def report(cycles: int = _CYCLES, workers: Workers = _ALL_CORES) -> None:
    """Print the table.

    Parameters
    ----------
    cycles : int
        In each row.
    workers : Workers, optional
    """
    selected = os.environ.get('NANOROCKS_DEVIATION', '')
    rows = [row for row in DEVIATIONS if row == IDEAL or selected in row.name]
    cases = [(number, row) for number in _TRAYS for row in rows]
    tasks = {
        f'{number}, {row.name}, {run}': (number, row, run)
        for number, row in cases
        for run in range(cycles)
    }
    with Progress('true tracks') as progress:
        every = iter(run_tasks(_cycle_of, tasks, workers, progress.count))
    print(
        '\n| tray | not as told | beads: shift | 95 % holds | half-width | walls: shift | 95 % '
        'holds | half-width | collisions | contacts alone | inconsistent | accelerated | drag | '
        'friction | scale |\n' + '| --- ' * 15 + '|'
    )
    for number, deviation in cases:
        estimates, flags = zip(*islice(every, cycles), strict=True)
        if deviation == IDEAL:
            # The ideal row has errors: what it is compared with is the truth.
            unshifted = [_TRUTH] * cycles
        collisions = np.mean([estimate.collisions for estimate in estimates])
        cells = [
            *_shifts(estimates, unshifted),
            f'{collisions:.0f}',
            *_noticed(estimates, flags),
        ]
        print(f'| {number} | {deviation.name} | {" | ".join(cells)} |')
        if deviation == IDEAL:
            unshifted = [
                {name: getattr(estimate, name).value for name in _TRUTH} for estimate in estimates
            ]


def _shifts(
    estimates: tuple[CorEstimate, ...], unshifted: Sequence[dict[str, float]]
) -> list[str]:
    """Mean shift and its standard error, share of the intervals that hold, half-width.

    Where some cycles have no result, the number of those that have one is added.
    """
    cells = []
    for name, truth in _TRUTH.items():
        pairs = [
            (getattr(estimate, name), values[name])
            for estimate, values in zip(estimates, unshifted, strict=True)
        ]
        known = [pair for pair in pairs if math.isfinite(pair[0].value - pair[1])]
        shifts = [interval.value - value for interval, value in known]
        error = np.std(shifts, ddof=1) / math.sqrt(len(shifts))
        seen = coverage((interval for interval, _ in known), truth)
        shift = f'{np.mean(shifts):+.4f} ± {error:.4f}'
        if len(known) < len(pairs):
            shift += f' ({len(known)} of {len(pairs)})'
        cells += [shift, f'{seen.holds:.2f}', f'{seen.half_width:.4f}']
    return cells


def _noticed(estimates: tuple[CorEstimate, ...], flags: tuple[Quality, ...]) -> list[str]:
    """Shares of the cycles in which something is noticed."""
    columns = (
        [estimate.headline is Headline.CONTACTS for estimate in estimates],
        [Quality.INCONSISTENT in estimate.quality for estimate in estimates],
        [Quality.ACCELERATED in estimate.quality for estimate in estimates],
        [_above_zero(estimate.drag) for estimate in estimates],
        [_above_zero(estimate.wall_friction) for estimate in estimates],
        [bool(flag) for flag in flags],
    )
    return [f'{np.mean(column):.2f}' for column in columns]


def _above_zero(measured: Measured) -> bool:
    return measured.value > _NOTICED * measured.error
