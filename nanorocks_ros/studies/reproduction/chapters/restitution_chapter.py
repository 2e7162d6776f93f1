"""Chapter on the restitution: Figures 7, 12 and 13, closed forms.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment import paper_values as reported
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.html_report import (
    NOT_KNOWN,
    Section,
    Table,
    with_interval,
)
from nanorocks_ros.studies.reproduction.chapters.chapter_context import (
    Chapter,
    Difference,
    mean_text,
)
from nanorocks_ros.studies.reproduction.chapters.restitution_errata import restitution_errata
from nanorocks_ros.studies.reproduction.chapters.restitution_pictures import (
    energy_part,
    impacts_part,
    search_parts,
)
from nanorocks_ros.studies.reproduction.marked_calibration import (
    calibrated_restitution,
    marked_fit,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context


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
        energy_part(context),
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
        *restitution_errata(),
        *search_parts(context),
        impacts_part(context),
    ]  # fmt: skip
    return Chapter(section=section, differences=differences, findings=[finding])


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
