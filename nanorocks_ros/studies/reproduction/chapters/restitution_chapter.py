"""Chapter on the restitution: Figures 7, 12 and 13, closed forms.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError, FitError, RecordingError
from nanorocks_ros.experiment import paper_values as reported
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.instantaneous_restitution import InstantaneousCor
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.html_report import (
    NOT_KNOWN,
    Erratum,
    Picture,
    Section,
    Table,
    with_interval,
)
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.paper_formulas import (
    paper_restitution,
    paper_restitution_of_decay,
    paper_wall_ellipse,
)
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
from nanorocks_ros.studies.reproduction.chapters.chapter_context import (
    Chapter,
    Difference,
    mean_text,
)
from nanorocks_ros.studies.reproduction.figures.energy_figure import energy_figure
from nanorocks_ros.studies.reproduction.marked_calibration import (
    calibrated_restitution,
    marked_fit,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_TRAY = 1
_SPAN = (1.75, 20.0)
_BEADS = tuple(0.5 + 0.02 * k for k in range(26))
_WALLS = tuple(0.8 + 0.02 * k for k in range(11))
# Restitution of the decay to which the closed form of the paper is applied in the errata.
_EXAMPLE = 0.8
# Chance of a constant restitution below which contacts contradict it.
_LEAST_CHANCE = 0.05
_WIDTHS = (0.0, 0.04, 0.08, 0.12, 0.16)


def restitution_chapter(context: Context) -> Chapter:
    """Figures 7, 12 and 13, and the restitutions of each tray."""
    section = Section(title='The coefficient of restitution (Figures 7, 12 and 13)')
    rows, differences = _by_tray(context)
    first = differences[0]
    finding = (
        f'From films of beads of {first.truth} the closed form of the paper gives '
        f'{first.its_method} in tray 1, our estimate is '
        f'{"not known" if first.ours == NOT_KNOWN else first.ours}.'
    )
    section.parts += [
        _energy_part(context),
        Table(
            head=('tray', 'its closed form, calibrated area', 'its closed form, our speeds',
                  'ours, beads [95 %]', 'ours, walls [95 %]', 'cycles known', 'flags'),
            rows=rows,
            caption='Restitution by tray, mean over the cycles without sticking; ± standard error '
            'of that mean (none for a single cycle), and in brackets the mean ends of the '
            'intervals of single cycles. Truth: beads '
            f'{context.plan.restitution:g}, walls {context.plan.wall_restitution:g}. The paper: '
            f'{reported.PAPER_RESTITUTION:g} for tray 1, {reported.PAPER_RESTITUTION_RANGE[0]:g} '
            f'to {reported.PAPER_RESTITUTION_RANGE[1]:g} over all trays; the other values are in '
            'the inset of its figure alone. A dash: no reliable '
            'value, as for grains, which are not tracked, or an area that does not follow the '
            'marked beads. Flags, with the number of cycles that have each, warn of a value: with '
            'few_beads and uncertain its interval may not hold the truth.',
        ),
        *_errata(),
        *_search_parts(context),
        _impacts_part(context),
    ]  # fmt: skip
    return Chapter(section=section, differences=differences, findings=[finding])


def _search_parts(context: Context) -> list[Picture | str]:
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


def _impacts_part(context: Context) -> Picture | str:
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


def _energy_part(context: Context) -> Picture | str:
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


def _by_tray(context: Context) -> tuple[list[Sequence[str]], list[Difference]]:
    rows: list[Sequence[str]] = []
    differences = []
    for tray, properties in load_trays().items():
        ours = [cycle.first_cycle(tray, 'default') for cycle in context.bouncing]
        paper_method = mean_text(_by_calibrated_area(context, properties))
        paper_formula = mean_text([cycle.get('paper_restitution') for cycle in ours])
        known = [cycle for cycle in ours if cycle.get('restitution') is not None]
        beads = _with_interval(known, 'restitution')
        walls = _with_interval(known, 'wall_restitution')
        rows.append(
            (
                str(tray),
                paper_method,
                paper_formula,
                beads,
                walls,
                f'{len(known)} of {len(ours)}',
                _flags(known),
            )
        )
        if tray in (1, 3, 5):
            reported_value = f'{reported.PAPER_RESTITUTION:g}' if tray == 1 else ''
            differences.append(
                Difference(
                    f'restitution of the beads, tray {tray}',
                    reported_value,
                    paper_method,
                    beads,
                    f'{context.plan.restitution:g}',
                )
            )
    return rows, differences


def _flags(cycles: Sequence[dict[str, Any]]) -> str:
    """The flags of some cycles, and of how many each."""
    words = Counter(word for cycle in cycles for word in cycle.get('quality', ()))
    return ', '.join(f'{word} {times}' for word, times in sorted(words.items()) if word != 'good')


def _by_calibrated_area(context: Context, tray: Tray) -> list[float]:
    """Restitution of each cycle by the closed form; none where the area cannot be calibrated."""
    try:
        fit = marked_fit(context.bouncing[0], tray)
    except FitError:
        return []
    return [calibrated_restitution(cycle, tray, fit) for cycle in context.bouncing]


def _with_interval(cycles: Sequence[dict[str, Any]], name: str) -> str:
    """Mean value and mean ends of the intervals, as text."""
    if not cycles:
        return NOT_KNOWN
    value, lower, upper = (
        mean_of([cycle.get(name + suffix) for cycle in cycles])[0]
        for suffix in ('', '_lower', '_upper')
    )
    return with_interval(value, (lower, upper))


def _rate() -> float:
    """Decay rate 1/(v0 tau) of the mean projected speed in figure 7, [1/m]."""
    relative = math.sqrt(2.0 * reported.PAPER_ENERGY / reported.PAPER_MASS)
    return 1.0 / (0.5 * relative * reported.PAPER_HAFF_TIME)


def _errata() -> list[Erratum]:
    tray = load_trays()[_TRAY]
    decay = (
        reported.PAPER_ENERGY,
        reported.PAPER_HAFF_TIME,
        reported.PAPER_MASS,
        tray.diameter,
        tray.number_density,
    )
    gas, walls = confined_gas(tray), reported.PAPER_WALL_RESTITUTION
    rate = _rate()
    expected = gas.decay_rate(reported.PAPER_RESTITUTION, walls)
    by_closed_form = paper_restitution_of_decay(
        gas.decay_rate(_EXAMPLE, walls), tray.diameter, tray.number_density
    )
    ellipse = paper_wall_ellipse(*decay, max(tray.dimensions))
    printed = reported.PAPER_ELLIPSE
    return [
        Erratum(
            text='Its closed form loses a factor of 2 between the loss of energy and the decay '
            'time, assumes a dilute gas in a large box, and in its first form neglects the walls, '
            'which take more energy than the beads in tray 1. Applied to the decay of the kinetic '
            f'theory between walls for a restitution of {_EXAMPLE:g}, it gives '
            f'{by_closed_form:.2f}. Its worked example gives {paper_restitution(*decay):.3f} as '
            f'printed, from a decay rate of {rate:.0f} /m, {rate / expected:.1f} times that of a '
            'gas with such beads and walls. Beads that stick cool as fast, and so do beads that '
            'rub on floor and lid.'
        ),
        Erratum(
            text=f'The axes of its wall ellipse are printed as a = {printed[0]:g}, b = '
            f'{printed[1]:g}; its own formula gives a = {ellipse.wall_axis:.3f}, b = '
            f'{ellipse.bead_axis:.3f}. It takes the walls 15 mm apart, the sides of the cell, '
            'where floor and lid leave the centres of the beads 1 mm.'
        ),
    ]
