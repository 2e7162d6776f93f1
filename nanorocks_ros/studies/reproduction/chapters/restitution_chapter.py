"""The coefficient of restitution: figures 7, 11, 12 and 13, and the closed forms."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from nanorocks_ros.experiment import paper_values as reported
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.instantaneous_restitution import InstantaneousCor
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.html_report import Erratum, Picture, Section, Table, number
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.paper_formulas import (
    paper_restitution,
    paper_restitution_of_decay,
    paper_wall_ellipse,
)
from nanorocks_ros.settings import SimulationSettings
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
from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter, Difference
from nanorocks_ros.studies.synthetic.simulated_figure import simulated_figure
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
from nanorocks_ros.studies.synthetic.simulated_runs import simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_TRAY = 1
_SPAN = (1.75, 20.0)
_DURATION, _SAMPLES = 30.0, 301
_BEADS = tuple(0.5 + 0.02 * k for k in range(26))
_WALLS = tuple(0.8 + 0.02 * k for k in range(11))
# A restitution at which what the paper's form makes of a decay is said.
_LOW = 0.8
_WIDTHS = (0.0, 0.04, 0.08, 0.12, 0.16)


def restitution_chapter(context: Context) -> Chapter:
    """Figures 7, 12 and 13, and what every tray gives."""
    section = Section(title='The coefficient of restitution (Figures 7, 12 and 13)')
    folder = context.folder / 'cor'
    prepare_folder(folder)
    data = _data(context)
    search = Search(beads=_BEADS, walls=_WALLS, widths=_WIDTHS, runs=context.runs)
    maps: dict[str, float] = {}

    def progress(name: str, done: int, total: int) -> None:
        maps[name] = done / total
        context.progress(0.5 * sum(maps.values()))

    reports = Reports(progress=progress, notice=context.notice)
    found = cor_figures(folder, data, search, context.workers, reports)
    rows, differences = _by_tray(context)
    section.parts += [
        Picture(
            path=folder / DECAY,
            caption='Figure 7: energy of the beads of tray 1 as they cool, after the tray has '
            'come to rest.',
        ),
        Table(
            head=('tray', 'its closed form, its speeds', 'its closed form, our speeds',
                  'ours, beads [95 %]', 'ours, walls [95 %]', 'cycles known'),
            rows=rows,
            caption='Restitution by tray, mean over the cycles without sticking. Truth: beads '
            f'{context.plan.restitution:g}, walls {context.plan.wall_restitution:g}. The paper: '
            f'{reported.PAPER_RESTITUTION:g} for tray 1, {reported.PAPER_RESTITUTION_RANGE[0]:g} '
            f'to {reported.PAPER_RESTITUTION_RANGE[1]:g} over all trays. A dash: nothing that '
            'could be relied upon, as of speeds of grains by their pictures alone.',
        ),
        *_errata(),
        Picture(
            path=folder / WALLS,
            caption='Figure 12: which restitutions of beads and walls agree with the decay. They '
            'form a valley; rebounds and collisions seen in the tracks choose the place in it.',
        ),
        Picture(path=folder / WIDTH, caption='Figure 12: the same for a distribution of '
                'restitutions and its width, which the decay does not tell.'),
    ]  # fmt: skip
    if isinstance(found['instantaneous'], InstantaneousCor):
        section.parts.append(
            Picture(
                path=folder / SPEED,
                caption='Figure 13: restitution against speed, and what noise alone makes of it.',
            )
        )
    else:
        section.parts.append(
            'Figure 13 needs more speeds above their noise than these cycles have.'
        )
    return Chapter(section=section, differences=differences)


def simulation_chapter(context: Context) -> Chapter:
    """Figure 11."""
    settings = SimulationSettings(
        tray=_TRAY,
        restitution=reported.PAPER_RESTITUTION,
        wall_restitution=reported.PAPER_WALL_RESTITUTION,
        seed=context.plan.seed,
    )
    plan = SimulationPlan(
        settings=settings,
        tray=load_trays()[_TRAY],
        duration=_DURATION,
        samples=_SAMPLES,
        runs=reported.PAPER_RUNS,
        picture=True,
    )
    runs = simulate(plan, context.workers, context.progress)
    path = context.picture('simulated.png')
    simulated_figure(path, runs)
    section = Section(
        title='The simulation (Figure 11)',
        parts=[
            f'{reported.PAPER_RUNS} simulated runs of tray 1 with the restitutions that the paper '
            'arrives at, 0.89 and 0.99. The paper simulated with soft spheres; here collisions '
            'are events, so that energy is lost at collisions and nowhere else.',
            Picture(path=path, caption='Figure 11: runs, and their mean.'),
        ],
    )
    return Chapter(section=section)


def _data(context: Context) -> CorData:
    cycles, spans, starts = [], [], []
    for one in context.bouncing:
        table, _ = speed_table(one.results, _TRAY)
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
    for tray in load_trays():
        ours = [_first_cycle(one, tray, 'default') for one in context.bouncing]
        paper = [_first_cycle(one, tray, 'paper') for one in context.bouncing]
        own = number(mean_of([one.get('restitution') for one in paper])[0])
        of_ours = number(mean_of([one.get('paper_restitution') for one in ours])[0])
        known = [one for one in ours if one.get('restitution') is not None]
        beads = _with_interval(known, 'restitution')
        walls = _with_interval(known, 'wall_restitution')
        rows.append((str(tray), own, of_ours, beads, walls, f'{len(known)} of {len(ours)}'))
        if tray in (1, 3, 5):
            said = f'{reported.PAPER_RESTITUTION:g}' if tray == 1 else ''
            differences.append(
                Difference(
                    f'restitution of the beads, tray {tray}',
                    said,
                    own,
                    beads,
                    f'{context.plan.restitution:g}',
                )
            )
    return rows, differences


def _first_cycle(one: CycleFiles, tray: int, how: str) -> dict[str, Any]:
    cycles = one.tray(tray, how)['cycles']
    return dict(cycles[0]) if cycles else {}


def _with_interval(cycles: Sequence[dict[str, Any]], name: str) -> str:
    """Mean value, and mean ends of the intervals."""
    if not cycles:
        return '–'
    value, lower, upper = (
        mean_of([cycle.get(name + end) for cycle in cycles])[0] for end in ('', '_lower', '_upper')
    )
    if math.isnan(value):
        return '–'
    return f'{value:.3f} [{lower:.3f}, {upper:.3f}]'


def _rate(tray: Tray) -> float:
    """Decay rate 1/(v0 tau) of the mean projected speed in figure 7, [1/m]."""
    relative = math.sqrt(2.0 * reported.PAPER_ENERGY / tray.species[0].bead_mass)
    return 1.0 / (0.5 * relative * reported.PAPER_HAFF_TIME)


def _errata() -> list[Erratum]:
    tray = load_trays()[_TRAY]
    decay = (
        reported.PAPER_ENERGY,
        reported.PAPER_HAFF_TIME,
        tray.species[0].bead_mass,
        tray.diameter,
        tray.number_density,
    )
    gas, walls = confined_gas(tray), reported.PAPER_WALL_RESTITUTION
    rate = _rate(tray)
    expected = gas.decay_rate(reported.PAPER_RESTITUTION, walls)
    made = paper_restitution_of_decay(
        gas.decay_rate(_LOW, walls), tray.diameter, tray.number_density
    )
    ellipse = paper_wall_ellipse(*decay, max(tray.dimensions))
    printed = reported.PAPER_ELLIPSE
    return [
        Erratum(
            text='Its closed form loses a factor of 2 between the loss of energy and the decay '
            'time, takes beads for a dilute gas in a large box, and leaves out the walls, which '
            'in tray 1 take more energy than the beads. Of the decay that kinetic theory between '
            f'walls gives for a restitution of {_LOW:g} it makes {made:.2f}. Its worked example '
            f'gives {paper_restitution(*decay):.3f} here as printed, from a decay rate of '
            f'{rate:.0f} /m, {rate / expected:.1f} times that of a gas with such beads and walls: '
            'beads that stick cool so fast, and so do beads that rub on floor and lid '
            '(docs/method/rotation.md).'
        ),
        Erratum(
            text=f'The axes of its wall ellipse are printed as a = {printed[0]:g}, b = '
            f'{printed[1]:g}; its own formula gives a = {ellipse.wall_axis:.3f}, b = '
            f'{ellipse.bead_axis:.3f}.'
        ),
    ]
