"""Pictures of the chapter on the restitution: Figures 7, 12 and 13, and single contacts.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError, FitError, RecordingError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.instantaneous_restitution import InstantaneousCor
from nanorocks_ros.outputs.html_report import Picture, with_interval
from nanorocks_ros.settings import PriorSettings
from nanorocks_ros.studies.analysis.results.contact_tables import contacts_of_results
from nanorocks_ros.studies.decays.cooling_curves import read_cycles, speed_table
from nanorocks_ros.studies.decays.cooling_windows import cooling_window
from nanorocks_ros.studies.figures.cor_figures import (
    DECAY,
    SPEED,
    WALLS,
    WIDTH,
    CorData,
    Reports,
    Search,
    cor_figures,
    prepare_folder,
)
from nanorocks_ros.studies.figures.impact_figure import ImpactData, impact_figure
from nanorocks_ros.studies.reproduction.figures.energy_figure import energy_figure

if TYPE_CHECKING:
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_TRAY = 1
_SPAN = (1.75, 20.0)
_BEADS = tuple(0.5 + 0.02 * k for k in range(26))
_WALLS = tuple(0.8 + 0.02 * k for k in range(11))
# Chance of a constant restitution below which contacts contradict it.
_LEAST_CHANCE = 0.05
_WIDTHS = (0.0, 0.04, 0.08, 0.12, 0.16)


def search_parts(context: Context) -> list[Picture | str]:
    """Our decay, the search and the restitution against speed, or why they could not be made."""
    folder = context.folder / 'cor'
    prepare_folder(folder)
    search = Search(beads=_BEADS, walls=_WALLS, widths=_WIDTHS, runs=context.runs)
    maps: dict[str, float] = {}

    def progress(name: str, done: int, total: int) -> None:
        maps[name] = done / total
        context.progress(0.5 * sum(maps.values()))

    reports = Reports(progress=progress, notice=context.notice)
    try:
        values = cor_figures(folder, _data(context), search, context.workers, reports)
    except (ConfigurationError, FitError, RecordingError) as error:
        # A single cycle may be too far from all simulated decays.
        context.notice(f'restitution: {error}')
        return [f'Could not be made: Figures 12 and 13 and our decay: {error}.']
    parts: list[Picture | str] = [
        Picture(
            path=folder / DECAY,
            caption='Figure 7 by our speeds, in the time that we use: after the tray has come to '
            'rest, whose walls drive the beads until then.',
        ),
        Picture(
            path=folder / WALLS,
            caption='Figure 12, right: chi square of the decay over the restitutions of beads and '
            'walls, from simulated beads that start with uniform speeds and do not stick. '
            'Its minimum is a valley; rebounds and collisions in the tracks select a point in it.',
        ),
        Picture(
            path=folder / WIDTH,
            caption='Figure 12, left: the same for a distribution of restitutions and its width, '
            'which the decay does not determine.',
        ),
    ]
    if isinstance(values['instantaneous'], InstantaneousCor):
        caption = 'Figure 13: restitution against speed, and the effect of noise alone.'
        return [*parts, Picture(path=folder / SPEED, caption=caption)]
    return [*parts, 'Figure 13 needs more speeds above their noise than these cycles have.']


def impacts_part(context: Context) -> Picture | str:
    """What Figure 13 asks, from single contacts, or why it cannot be drawn."""
    path = context.picture('impacts.png')
    prior = PriorSettings()
    try:
        folders = [cycle.results for cycle in context.bouncing]
        terms, losses, cycles = contacts_of_results(folders, _TRAY, prior)
        values = impact_figure(
            path,
            ImpactData(tray=_TRAY, cycles=cycles, terms=terms, losses=losses, prior=prior),
        )
    except (FitError, RecordingError) as error:
        return f'The restitution against the impact speed could not be drawn: {error}.'
    return Picture(
        path=path,
        caption='What Figure 13 asks, answered by single contacts: the speed along the normal of '
        'each, not the mean speed of the gas, and its restitution, not what is left of a mean '
        f'speed after a second. {_law_in_words(values["beads"])} The slowest range reads '
        'low: an error of the speed after a contact is in both axes.',
    )


def _law_in_words(beads: dict[str, Any] | None) -> str:
    if beads is None or beads['law'] is None:
        return 'Collisions are too few for a law.'
    exponent, chance = beads['law']['exponent'], beads['law']['chance_of_constant']
    seen = 'are compatible with' if chance >= _LEAST_CHANCE else 'contradict'
    return (
        f'Collisions {seen} a constant restitution of the beads, which is true here: the exponent '
        f'of 1 − restitution is {with_interval(exponent["value"], _ends(exponent))}.'
    )


def _ends(limits: dict[str, float]) -> tuple[float, float]:
    return limits['lower'], limits['upper']


def energy_part(context: Context) -> Picture | str:
    """Figure 7 by the recipe of the paper, or why it cannot be drawn."""
    path = context.picture('energy.png')
    try:
        energy_figure(path, context.bouncing[0], load_trays()[_TRAY])
    except FitError as error:
        return f'Figure 7 by the recipe of the paper could not be drawn: {error}.'
    return Picture(
        path=path,
        caption='Figure 7: energy of the beads of tray 1 by the calibrated area from the shaking '
        'event on, and the fit of the paper. As in the paper it is taken at twice the mean speed, '
        'its estimate of the relative speed. What it fitted in flight decays faster than beads '
        'of its restitution do.',
    )


def _data(context: Context) -> CorData:
    cycles, spans, starts = [], [], []
    for cycle in context.bouncing:
        table, _ = speed_table(cycle.results, _TRAY)
        cycles += list(read_cycles(table))
        window = cooling_window(table)
        spans.append((window.first, window.last) if window else _SPAN)
        starts.append(window.start if window else 0.0)
    return CorData(
        tray=load_trays()[_TRAY],
        cycles=tuple(cycles),
        species=(),
        span=(max(first for first, _ in spans), min(last for _, last in spans)),
        start=max(starts),
        wall_restitution=context.plan.wall_restitution,
    )
