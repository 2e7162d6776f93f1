"""Intervals of both restitutions where floor, lid, walls and beads rub: which source holds.

True tracks with the errors of tracking (`benchmarks.contacts`) and mean speeds with errors of
2 %, 20 s from 10 mm/s, tangential restitution 0.4; friction 0 is smooth beads. "Holds" is the
share of 95 % intervals with the truth. ``docs/method/restitution.md`` has the conclusions.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from benchmarks import rough_gas as gas
from benchmarks.contacts import contacts_of, true_tracks
from benchmarks.coverage import coverage
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.decay.friction_weights import friction_weights
from nanorocks_ros.inference.flights.flight_losses import flight_losses, flight_table
from nanorocks_ros.inference.restitution_sources import intervals_of, restitution_sources
from nanorocks_ros.records import NS, FreeFlight, Headline, Measured
from nanorocks_ros.settings import PriorSettings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.restitution_sources import RestitutionSources
    from nanorocks_ros.settings import SimulationSettings

_FRICTIONS = (0.0, 0.01, 0.03, 0.1)
# Tray, restitutions of beads and walls.
_TRUTHS = ((1, 0.89, 0.97), (1, 0.7, 0.92), (3, 0.89, 0.97))
_CYCLES = 40
_FRAMES, _FIRST, _EVERY, _ERROR = 600, 1.75, 3, 0.02
_ENDS = np.array([0.025, 0.5, 0.975])
_PRIOR = PriorSettings()


def sources_of_cycle(tray: Tray, settings: SimulationSettings, run: int) -> RestitutionSources:
    """What decay and contacts say about one simulated cycle."""
    library = library_of(tray)
    tables = tables_of(library, tray, _PRIOR)
    times: list[float] = []
    speeds: list[float] = []

    def watched() -> Iterator:
        for tracks in true_tracks(tray, settings, run, _FRAMES):
            times.append(tracks.stamp_ns / NS)
            speeds.append(float(np.hypot(*tracks.velocities.T).mean()))
            yield tracks

    contacts = contacts_of(tray, watched())
    time = np.array(times)
    used = np.flatnonzero(time >= _FIRST)[::_EVERY]
    noise = np.random.default_rng([settings.seed, run, 2]).standard_normal(used.size)
    speed = np.array(speeds)[used] * np.exp(_ERROR * noise)
    camera = math.hypot(_PRIOR.scale_error, library.misfit), _PRIOR.speed_bias
    cooling = [contact for contact in contacts if contact.stamp_ns >= _FIRST * NS]
    flights = flight_table(contact for contact in cooling if isinstance(contact, FreeFlight))
    losses = flight_losses(flights, Measured(_PRIOR.drag, _PRIOR.drag_error))
    likelihood = decay_likelihood(tables, time[used], speed, _ERROR * speed, camera, losses.drag)
    terms = ContactTerms.of(contact for contact in cooling if not isinstance(contact, FreeFlight))
    integrated = likelihood.integrated(friction_weights(_PRIOR, terms))
    return restitution_sources(tables, integrated, terms, _PRIOR, losses=losses)


def report() -> None:
    """Print the table."""
    print(
        '\n| tray, truth | friction | found ± sd of a cycle | from contacts | source | beads: '
        'holds | half-width | median error | walls: holds | half-width | median error |\n'
        + '| --- ' * 11
        + '|'
    )
    for number, beads, walls in _TRUTHS:
        tray = load_trays()[number]
        for friction in _FRICTIONS:
            rough = gas.Roughness(tangential=0.4, friction=friction) if friction else gas.SMOOTH
            settings = gas.settings_of(
                tray, rough, restitution=beads, wall_restitution=walls, seed=2026
            )
            cycles = [sources_of_cycle(tray, settings, run) for run in range(_CYCLES)]
            _rows(f'{number}, {beads:g} / {walls:g}', friction, (beads, walls), cycles)


def _rows(
    name: str, friction: float, truth: tuple[float, float], cycles: list[RestitutionSources]
) -> None:
    found = np.array([cycle.wall_friction.value for cycle in cycles])
    share = np.mean([cycle.headline is Headline.CONTACTS for cycle in cycles])
    first = f'{np.nanmean(found):.4f} ± {np.nanstd(found):.4f} | {share:.2f}'
    for source in ('headline', 'joint', 'decay', 'contacts'):
        intervals = [_intervals(cycle, source) for cycle in cycles]
        cells = []
        for true, column in zip(truth, zip(*intervals, strict=True), strict=True):
            seen = coverage(column, true)
            cells += [f'{seen.holds:.2f}', f'{seen.half_width:.4f}', f'{seen.median_error:+.4f}']
        print(f'| {name} | {friction:g} | {first} | {source} | {" | ".join(cells)} |', flush=True)
        name, first = '', ' | '


def _intervals(cycle, source):
    if source == 'headline':
        return cycle.intervals(_ENDS)
    if source == 'contacts':
        return cycle.contact_intervals(_ENDS)
    return intervals_of(cycle.joint if source == 'joint' else cycle.decay, _ENDS)
