"""Published restitutions of beads whose restitution depends on the impact speed.

True tracks with the errors of tracking (`benchmarks.contacts`), cycles of 40 s from 10 mm/s, beads
of 0.75 at 5 mm/s with a power law, walls 0.97, mean speeds from 1.75 s on with errors of 2 %. The
truth is the restitution that loses as much energy in the collisions that were seen, by the event
log of the simulation; "all" is that in all collisions of the cycle. "Holds" is the share of 95 %
intervals with a truth. ``docs/validation/restitution_accuracy.md`` has the conclusions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from benchmarks import rough_gas as gas
from benchmarks.contacts import contacts_of, true_tracks
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.flights.flight_losses import flight_losses, flight_table
from nanorocks_ros.inference.speed_dependence import speed_dependence
from nanorocks_ros.records import NS, FreeFlight, Measured, PairCollision
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking
from nanorocks_ros.stages.restitution.decay_library_method import DecayLibraryMethod
from nanorocks_ros.stages.restitution.restitution_method import Decay

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.contacts import Contacts
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Interval
    from nanorocks_ros.settings import SimulationSettings
    from nanorocks_ros.stages.restitution.cycle_restitution import CycleRestitution

_EXPONENTS, _TRAYS, _CYCLES, _TOGETHER = (0.0, 0.2, 0.6), (1, 3), 40, 18
_VALUE, _SPEED, _ERROR = 0.75, 5e-3, 0.02
_FIRST, _LAST, _RATE = 1.75, 38.0, 30.0
# Between a contact of the tracks and that of the simulation.
_APART = 0.2
_ENDS = np.array([0.025, 0.5, 0.975])
_SETTINGS = PipelineSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class _SeenContacts:
    """Contacts of a cycle, as the stage of restitutions sums them."""

    contacts: Contacts
    body_rebounds = 0

    @property
    def flights(self) -> NDArray[np.float64]:
        """Table of the flights."""
        return flight_table(
            contact for contact in self.contacts if isinstance(contact, FreeFlight)
        )

    def terms(self, drag: float) -> ContactTerms:
        """Likelihoods of the contacts."""
        return ContactTerms.of(
            dragged(contact, drag)
            for contact in self.contacts
            if not isinstance(contact, FreeFlight)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cycle:
    """What one cycle gives, and the truths of the collisions seen and of all of them."""

    seen: _SeenContacts
    result: CycleRestitution
    truth: float
    truth_of_all: float


def report(cycles: int = _CYCLES) -> None:
    """Print the tables.

    Parameters
    ----------
    cycles : int
        Of each tray and exponent.
    """
    print(
        '| tray | exponent | truth | all | published | half width | holds the truth | holds all | '
        'depends | constant, contacts alone | holds the truth |\n' + '| --- ' * 11 + '|'
    )
    together = []
    for number in _TRAYS:
        for exponent in _EXPONENTS:
            rows = [_cycle(number, exponent, run) for run in range(cycles)]
            print(f'| {number} | {exponent:g} | {_cells(rows)} |', flush=True)
            together += _exponents_together(number, exponent, rows)
    print(
        f'\n| tray | exponent | groups of {_TOGETHER} | their exponents | stated sd | '
        'restitution at the impact speed, error | stated half width |\n' + '| --- ' * 7 + '|'
    )
    print('\n'.join(together))


def _cells(rows: list[_Cycle]) -> str:
    published = [row.result.restitution for row in rows]
    constant = [row.result.contact_restitution for row in rows]
    truth = [row.truth for row in rows]
    of_all = [row.truth_of_all for row in rows]
    half = np.mean([0.5 * (interval.upper - interval.lower) for interval in published])
    depends = np.mean([row.result.speed_dependent for row in rows])
    return (
        f'{np.mean(truth):.3f} | {np.mean(of_all):.3f} | {_mean(published):.3f} | {half:.3f} | '
        f'{_held(published, truth):.2f} | {_held(published, of_all):.2f} | {depends:.2f} | '
        f'{_mean(constant):.3f} | {_held(constant, truth):.2f}'
    )


def _mean(intervals: list[Interval]) -> float:
    return float(np.mean([interval.value for interval in intervals]))


def _held(intervals: list[Interval], truths: list[float]) -> float:
    return float(
        np.mean(
            [
                interval.lower <= truth <= interval.upper
                for interval, truth in zip(intervals, truths, strict=True)
            ]
        )
    )


def _cycle(number: int, exponent: float, run: int) -> _Cycle:
    tray = load_trays()[number]
    settings = gas.settings_of(
        tray,
        gas.SMOOTH,
        seed=2031,
        restitution=_VALUE,
        restitution_law='power',
        restitution_speed=_SPEED,
        restitution_exponent=exponent,
    )
    frames = round((_LAST + 2.0) * _RATE)
    contacts = contacts_of(tray, true_tracks(tray, settings, run, frames))
    seen = _SeenContacts(
        contacts=tuple(contact for contact in contacts if _FIRST < contact.stamp_ns / NS < _LAST)
    )
    truth, truth_of_all = _truths(tray, settings, run, seen.contacts)
    decay = _decay(tray, settings, run)
    result = DecayLibraryMethod(_SETTINGS, tray).estimate(decay, seen, final=True)
    return _Cycle(seen=seen, result=result, truth=truth, truth_of_all=truth_of_all)


def _decay(tray: Tray, settings: SimulationSettings, run: int) -> Decay:
    """The speeds of the same gas, with errors."""
    times = np.arange(_FIRST, _LAST, 0.25)
    (speed,) = cooling_runs(settings, tray, times, [run]).mean_projected_speed
    speed = speed * (1.0 + _ERROR * np.random.default_rng(run).normal(size=speed.size))
    return Decay(time=times, speed=speed, error=_ERROR * speed)


def _truths(
    tray: Tray, settings: SimulationSettings, run: int, contacts: Contacts
) -> tuple[float, float]:
    """Energy-weighted restitutions of the collisions seen, and of all."""
    rules = rules_of(settings, tray, run)
    beads = after_shaking(settings, rules, resting_beads(settings, tray, run), run, 0)
    events = HardSphereGas(beads, rules).follow(_LAST, log=True).events
    pairs = events[(events['kind'] == 'pair') & (events['time'] > _FIRST)]
    speed = pairs['normal_speed']
    loss = (1.0 - _VALUE) * (speed / _SPEED) ** settings.restitution_exponent
    restitution = np.maximum(1.0 - loss, 0.0)
    masses = beads.masses[pairs['bead']], beads.masses[pairs['partner']]
    energy = masses[0] * masses[1] / (masses[0] + masses[1]) * speed**2
    seen = np.array(_places(pairs, contacts), dtype=np.int64)
    return tuple(
        float(np.sqrt(np.average(restitution[part] ** 2, weights=energy[part])))
        for part in (seen, slice(None))
    )


def _places(pairs: NDArray[np.void], contacts: Contacts) -> list[int]:
    """Which collisions of the simulation were seen."""
    places = []
    for contact in contacts:
        if not isinstance(contact, PairCollision):
            continue
        bead, partner = sorted(contact.tracks.tolist())
        own = np.flatnonzero((pairs['bead'] == bead) & (pairs['partner'] == partner))
        apart = np.abs(pairs['time'][own] - contact.stamp_ns / NS)
        if own.size and apart.min() < _APART:
            places.append(int(own[apart.argmin()]))
    return places


def _exponents_together(number: int, exponent: float, rows: list[_Cycle]) -> list[str]:
    """A row of the second table: groups of cycles, whose contacts are added."""
    groups = [
        rows[first : first + _TOGETHER] for first in range(0, len(rows) - _TOGETHER + 1, _TOGETHER)
    ]
    laws = []
    for group in groups:
        flights = np.concatenate([row.seen.flights for row in group])
        prior = _SETTINGS.prior
        losses = flight_losses(flights, Measured(prior.drag, prior.drag_error))
        terms = reduce(add, (row.seen.terms(losses.drag.value) for row in group))
        law = speed_dependence(terms, losses, prior).beads
        if law is not None:
            laws.append(law)
    if not laws:
        return []
    errors, halves = [], []
    for law in laws:
        truth = 1.0 - (1.0 - _VALUE) * (law.speed / _SPEED) ** exponent
        lower, value, upper = law.law.at(law.speed).quantiles(_ENDS)
        errors.append(value - truth)
        halves.append(0.5 * (upper - lower))
    means = ', '.join(f'{law.exponent.mean:+.3f}' for law in laws)
    stated = np.mean([law.exponent.deviation for law in laws])
    return [
        f'| {number} | {exponent:g} | {len(laws)} | {means} | {stated:.3f} | '
        f'{np.mean(errors):+.3f} | {np.mean(halves):.3f} |'
    ]
