"""The conclusion of a batch, and cells of its tables, in words.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.html_report import NOT_KNOWN, number, with_error, with_interval
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.studies.batch.means_json import means_as_json

if TYPE_CHECKING:
    from nanorocks_ros.studies.batch.campaign_means import Combined, TrayMeans

_SOURCES = {
    'joint': ', by decays and contacts together',
    'contacts': ', by contacts alone',
    'decay': ', by decays alone',
}


def known_trays(together: Combined) -> list[TrayMeans]:
    """The trays with a cycle, by number."""
    return [tray for _, tray in sorted(together.trays.items()) if tray.cycles]


def conclusions(together: Combined) -> list[str]:
    """The restitution of each tray, by all of its cycles, in a sentence each."""
    if not known_trays(together):
        return ['No cycle after a shaking event was found: there is no restitution.']
    lines = []
    for tray in known_trays(together):
        values = means_as_json(tray)
        beads, walls = (interval_cell(values, f'{kind}restitution') for kind in ('', 'wall_'))
        source = _SOURCES.get(values['headline'] or '', '')
        lines.append(
            f'Tray {tray.tray}: restitution of the beads {beads}, of the walls {walls}, from '
            f'{counted(tray.cycles, "cycle")}{source}.'
            if beads != NOT_KNOWN
            else f'Tray {tray.tray}: no restitution from {counted(tray.cycles, "cycle")}.'
        )
    return [*lines, 'Brackets are intervals of 95 %.']


def interval_cell(values: dict[str, Any], name: str, factor: float = 1.0) -> str:
    """A value with its interval, or what is known of it."""
    middle, low, high = (values.get(f'{name}{end}') for end in ('', '_lower', '_upper'))
    if low is None or high is None:
        return NOT_KNOWN if low is None and high is None else _one_sided(low, high, factor)
    if middle is None:
        return f'{number(low, 3, factor)} to {number(high, 3, factor)}'
    return with_interval(middle, (low, high), factor)


def _one_sided(low: float | None, high: float | None, factor: float) -> str:
    return (
        f'above {number(low, 3, factor)}' if high is None else f'below {number(high, 3, factor)}'
    )


def mean_cell(tray: TrayMeans, name: str, factor: float = 1.0) -> str:
    """A mean over cycles ± the scatter of one, with the number of cycles in brackets."""
    mean = tray.means[name]
    if not mean.cycles:
        return NOT_KNOWN
    if mean.cycles == 1:
        return f'{number(mean.mean, 3, factor)} (1)'
    return f'{with_error(mean.mean, mean.scatter, factor)} ({mean.cycles})'


def measured_cell(values: dict[str, Any], name: str, factor: float = 1.0) -> str:
    """A value of one cycle with its standard error."""
    value, error = values[name], values.get(f'{name}_error')
    if value is None:
        return NOT_KNOWN
    return with_error(value, math.nan if error is None else error, factor)
