"""Reduction of the valley of the two restitutions by rebounds and collisions.

Trays 1 and 3, beads 0.89, walls 0.97: decays of the true mean projected speed (errors of 2 %) and
contacts in true positions with the errors of tracking, 1.75 to 20 s after a start at 10 mm/s. All
uncertainties have their defaults. "Half" is half the 68 % interval.
"""

from __future__ import annotations

import math
from functools import partial, reduce
from operator import add

import numpy as np

from benchmarks.contacts import contacts_of, true_tracks
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.decay.grid_likelihood import DecayLikelihood
from nanorocks_ros.inference.posterior import Posterior, posterior_of
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.settings import PriorSettings, SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

_TRAYS = (1, 3)
_CYCLES = 18
_PAIRS, _WALLS = 0.89, 0.97
_RATE, _FIRST, _LAST = 30.0, 1.75, 20.0
_ERROR = 0.02
_LEVELS = np.array([0.16, 0.84])
_NS = 1e9

_Cycle = tuple[DecayLikelihood, ContactTerms]


def report() -> None:
    """Print the table."""
    head = '| tray | from | beads: error of 1 cycle | half | of 18 | half '
    print(head + '| walls: error of 1 cycle | half | of 18 | half |')
    print('| --- ' * 10 + '|')
    for tray in _TRAYS:
        tasks = {str(run): (tray, run) for run in range(_CYCLES)}
        cycles = run_tasks(_cycle, tasks, Workers())
        for name, beads, walls in (
            ('decays', False, False),
            ('decays, rebounds', False, True),
            ('decays, collisions', True, False),
            ('all', True, True),
        ):
            judge = partial(_posterior, tray, beads=beads, walls=walls)
            posteriors = [judge([cycle]) for cycle in cycles]
            print(f'| {tray} | {name} ' + _row(posteriors, judge(cycles)), flush=True)


def _cycle(task: tuple[int, int]) -> _Cycle:
    """Likelihoods of one cycle: of its decay and of its contacts."""
    number, run = task
    tray = load_trays()[number]
    settings = SimulationSettings(
        restitution=_PAIRS,
        wall_restitution=_WALLS,
        seed=99,
        mean_speed=0.01,
        first_shake=0.0,
        frame_rate=_RATE,
    )
    times = np.arange(_FIRST, _LAST, 0.1)
    (speed,) = cooling_runs(settings, tray, times, [run]).mean_projected_speed
    noise = np.random.default_rng([number, run]).standard_normal(speed.size)
    speed = speed * np.exp(_ERROR * noise)
    prior = PriorSettings(min_wall_restitution=0.8)
    library = library_of(tray)
    camera = (math.hypot(prior.scale_error, library.misfit), prior.speed_bias)
    tables = tables_of(library, tray, prior)
    decay = decay_likelihood(tables, times, speed, _ERROR * speed, camera)
    contacts = [
        contact
        for contact in contacts_of(tray, true_tracks(tray, settings, run, round(_LAST * _RATE)))
        if contact.stamp_ns > _FIRST * _NS
    ]
    return decay, ContactTerms.of(contacts)


def _posterior(tray: int, cycles: list[_Cycle], *, beads: bool, walls: bool) -> Posterior:
    prior = PriorSettings(min_wall_restitution=0.8)
    flown = load_trays()[tray]
    tables = tables_of(library_of(flown), flown, prior)
    decay, contacts = (reduce(add, terms) for terms in zip(*cycles, strict=True))
    return posterior_of(
        tables,
        decay.integrated(),
        (prior.min_wall_restitution, prior.max_wall_restitution),
        bead_likelihood=contacts.bead_likelihood(prior.collision_bias) if beads else None,
        wall_likelihood=contacts.wall_likelihood(prior.rebound_bias) if walls else None,
    )


def _row(posteriors: list[Posterior], combined: Posterior) -> str:
    row = ''
    for index, truth in ((0, _PAIRS), (1, _WALLS)):
        errors = [posterior.mean[index] - truth for posterior in posteriors]
        row += f'| {np.sqrt(np.mean(np.square(errors))):.3f} '
        row += f'| {np.mean([_half(posterior, index) for posterior in posteriors]):.3f} '
        row += f'| {combined.mean[index] - truth:+.4f} | {_half(combined, index):.4f} '
    return row + '|'


def _half(posterior: Posterior, index: int) -> float:
    find = posterior.wall_quantiles if index else posterior.quantiles
    low, high = find(_LEVELS)
    return 0.5 * float(high - low)
