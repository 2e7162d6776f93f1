"""Restitutions that depend on the impact speed: false alarms, power, and intervals of exponents.

True tracks with the errors of tracking (`benchmarks.contacts`), cycles of 40 s from 10 mm/s, walls
0.97; then films by other code (`benchmarks.foreign_world`). "Holds" is the share of 95 % intervals
with the local exponent of the true law at the geometric mean of the impact speeds.
``docs/validation/restitution_accuracy.md`` has the conclusions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import rough_gas as gas
from benchmarks.contacts import contacts_of, true_tracks
from benchmarks.film_measurement import measure
from benchmarks.film_truth import read_truth
from benchmarks.foreign_world import films_by_other_code
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.flights.flight_losses import flight_losses, flight_table
from nanorocks_ros.inference.speed_dependence import SpeedDependence, speed_dependence
from nanorocks_ros.records import NS, FreeFlight, Measured, Quality
from nanorocks_ros.settings import PriorSettings
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    ViscoelasticRestitution,
    compiled_law,
    restitution_at,
)

if TYPE_CHECKING:
    from benchmarks.contacts import Contacts
    from nanorocks_ros.inference.contacts.restitution_exponent import RestitutionExponent
    from nanorocks_ros.records import CorEstimate, Interval

_CYCLES = {1: 40, 3: 20}
_FRAMES = 1200
_DELAY = 1.75
_TOGETHER = 5
_ENDS = np.array([0.025, 0.5, 0.975])
_PRIOR = PriorSettings()
_SPEED = 5e-3
_STEP = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class _Gas:
    """A row: what is simulated, and the true exponents as functions of the impact speed."""

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    roughness: gas.Roughness = gas.SMOOTH
    beads: float | ViscoelasticRestitution = 0.0
    walls: float = 0.0


_FALLING = ViscoelasticRestitution(value=0.75, at_speed=_SPEED)
_POWER = {'restitution_law': 'power', 'restitution_speed': _SPEED, 'restitution_exponent': 0.6}
_WALL_POWER = {
    'wall_restitution_law': 'power',
    'restitution_speed': _SPEED,
    'restitution_exponent': 0.3,
}
_GASES = (
    *(_Gas(name=f'constant {value:g}', settings={'restitution': value}) for value in (0.7, 0.89)),
    _Gas(name='constant 0.95', settings={'restitution': 0.95}),
    _Gas(name='constant 0.89, drag 0.02 /s', settings={'drag': 0.02}),
    _Gas(
        name='constant 0.89, friction 0.03',
        roughness=gas.Roughness(tangential=0.4, friction=0.03),
    ),
    _Gas(
        name='viscoelastic, 0.75 at 5 mm/s',
        settings={
            'restitution': _FALLING.value,
            'restitution_law': 'viscoelastic',
            'restitution_speed': _SPEED,
        },
        beads=_FALLING,
    ),
    _Gas(
        name='power 0.6, 0.75 at 5 mm/s',
        settings={'restitution': 0.75, **_POWER},
        beads=0.6,
    ),
    _Gas(
        name='walls: power 0.3, 0.95 at 5 mm/s',
        settings={'wall_restitution': 0.95, **_WALL_POWER},
        walls=0.3,
    ),
)


def report(cycles: dict[int, int] | None = None) -> None:
    """Print the tables of simulated gases and of films.

    Parameters
    ----------
    cycles : dict of int to int, optional
        Number of cycles of each tray.
    """
    print(
        f'| tray | restitution | seen in a cycle | in {_TOGETHER} together | beads: exponent, '
        'sd | stated sd | true | holds | walls: exponent, sd | stated sd | true | holds |\n'
        + '| --- ' * 12
        + '|'
    )
    for number, runs in (cycles or _CYCLES).items():
        for row in _GASES:
            print(f'| {number} | {row.name} | {_cells(number, row, runs)} |', flush=True)
    _report_films()


def _cells(number: int, row: _Gas, runs: int) -> str:
    tray = load_trays()[number]
    settings = gas.settings_of(tray, row.roughness, seed=2031, **row.settings)
    cycles = [contacts_of(tray, true_tracks(tray, settings, run, _FRAMES)) for run in range(runs)]
    single = [dependence_of([cycle]) for cycle in cycles]
    together = [
        dependence_of(cycles[first : first + _TOGETHER]) for first in range(0, runs, _TOGETHER)
    ]
    cells = [
        f'{np.mean([dependence.is_seen for dependence in group]):.2f}'
        for group in (single, together)
    ]
    for kind, law in (('beads', row.beads), ('walls', row.walls)):
        known = [exponent for each in single if (exponent := getattr(each, kind))]
        cells.append(_exponent_cells(known, law) if known else ' | | |')
    return ' | '.join(cells)


def dependence_of(cycles: list[Contacts]) -> SpeedDependence:
    """What contacts of some cycles together tell, as the stage of restitutions takes them."""
    used = [contact for cycle in cycles for contact in cycle if contact.stamp_ns > _DELAY * NS]
    flights = flight_table(contact for contact in used if isinstance(contact, FreeFlight))
    losses = flight_losses(flights, Measured(_PRIOR.drag, _PRIOR.drag_error))
    terms = reduce(
        add,
        (
            ContactTerms.of(
                dragged(contact, losses.drag.value)
                for contact in cycle
                if contact.stamp_ns > _DELAY * NS and not isinstance(contact, FreeFlight)
            )
            for cycle in cycles
        ),
    )
    return speed_dependence(terms, losses, _PRIOR)


def _exponent_cells(
    exponents: list[RestitutionExponent], law: float | ViscoelasticRestitution
) -> str:
    truth = np.array([_local(law, exponent.speed) for exponent in exponents])
    means = np.array([exponent.exponent.mean for exponent in exponents])
    stated = np.median([exponent.exponent.deviation for exponent in exponents])
    intervals = [exponent.interval(_ENDS) for exponent in exponents]
    holds = np.mean(
        [
            interval.lower <= true <= interval.upper
            for interval, true in zip(intervals, truth, strict=True)
        ]
    )
    return (
        f'{means.mean():+.2f}, {means.std(ddof=1):.2f} | {stated:.2f} | {truth.mean():.2f} | '
        f'{holds:.2f}'
    )


def _local(law: float | ViscoelasticRestitution, speed: float) -> float:
    """Exponent of 1 - restitution at a speed."""
    if isinstance(law, float):
        return law
    compiled = compiled_law('restitution', law)
    losses = [1.0 - restitution_at(*compiled, speed * math.exp(step)) for step in (-_STEP, _STEP)]
    return math.log(losses[1] / losses[0]) / (2.0 * _STEP)


def _report_films() -> None:
    print(
        '\n| film | true beads, walls | said | beads: exponent | at [mm/s] | walls: exponent | at '
        '[mm/s] | COR of beads | flags |\n' + '| --- ' * 9 + '|'
    )
    for video in films_by_other_code():
        truth = read_truth(video)
        true = f'{truth.beads:.3g}, {truth.walls:.3g}'
        final = measure(truth).final
        print(f'| {video.stem} | {true} | {_film_cells(final)} |', flush=True)


def _film_cells(final: CorEstimate | None) -> str:
    if final is None:
        return 'no single final cycle | | | | | |'
    seen = 'depends' if Quality.SPEED_DEPENDENT in final.quality else 'need not depend'
    return ' | '.join(
        (
            seen,
            _interval(final.restitution_exponent, 2),
            _speed(final.impact_speed),
            _interval(final.wall_restitution_exponent, 2),
            _speed(final.wall_impact_speed),
            _interval(final.restitution, 3),
            ', '.join(final.quality.names()),
        )
    )


def _speed(speed: float) -> str:
    return f'{1e3 * speed:.2f}' if math.isfinite(speed) else ''


def _interval(interval: Interval, digits: int) -> str:
    if not math.isfinite(interval.value):
        return 'unknown'
    value, lower, upper = (
        f'{number:.{digits}f}' for number in (interval.value, interval.lower, interval.upper)
    )
    return f'{value} [{lower}, {upper}]'
