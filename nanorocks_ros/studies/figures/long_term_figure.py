"""The figure of the cycles of a campaign, after figure 9 of the paper.

Tested by ``test/cli/figures/test_figure_long_term.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import MARKS, SERIES, SKY, TWO_COLUMNS
from nanorocks_ros.outputs.json_values import finite_or_none, json_values

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.studies.analysis.long_term import Campaign

_MM = 1e3
_QUIET = SKY
_MANY_CYCLES = 40


def long_term_figure(path: Path, campaign: Campaign) -> None:
    """Draw cluster sizes, peak speeds and restitutions by cycle, with trends and quiet periods.

    Parameters
    ----------
    path : Path
    campaign : Campaign

    Raises
    ------
    RecordingError
        When the picture cannot be written.

    References
    ----------
    [B19] fig. 9 for the cluster sizes.
    """
    with figure_file(path, TWO_COLUMNS, 160.0) as figure:
        sizes, peaks, cors = figure.subplots(3, 1, sharex=True)
        in_mm = campaign.measure.unit == 'm'
        for axes, quantity, scale, text in (
            (
                sizes,
                'cluster_size',
                _MM if in_mm else 1.0,
                f'{campaign.measure.text}{" [mm]" if in_mm else ""}',
            ),
            (peaks, 'peak_speed', _MM, 'peak of the mean speed [mm/s]'),
            (cors, 'restitution', 1.0, 'coefficient of restitution'),
        ):
            for k, number in enumerate(campaign.trays):
                _draw(axes, campaign, number, (quantity, scale, k))
            for period in campaign.periods:
                axes.axvspan(period.first + 0.5, period.last + 1.5, color=_QUIET, alpha=0.2, lw=0)
            axes.set_ylabel(text)
            axes.grid(alpha=0.25)
            if not axes.has_data():
                axes.text(
                    0.5, 0.5, 'not known', transform=axes.transAxes, ha='center', va='center'
                )
        quiet_periods = len(campaign.periods)
        sizes.set_title(
            f'{campaign.places} cycle{"s" * (campaign.places != 1)}; '
            + (
                f'{quiet_periods} quiet period{"s" * (quiet_periods > 1)}, shaded'
                if quiet_periods
                else 'no quiet period'
            ),
        )
        sizes.legend(ncols=len(campaign.trays), loc='upper left')
        low, high = sizes.get_ylim()
        sizes.set_ylim(low, high + 0.2 * (high - low))
        cors.set_xlabel('cycle')
        cors.set_xlim(0.5, campaign.places + 0.5)
        cors.xaxis.set_major_locator(MaxNLocator(integer=True))


def _draw(axes: Axes, campaign: Campaign, tray: int, column: tuple[str, float, int]) -> None:
    """Draw a quantity of one tray; `column` is its name, its scale and the index of the tray."""
    quantity, scale, k = column
    values = scale * campaign.values(tray, quantity)
    known = np.isfinite(values)
    if not known.any():
        return
    x = np.arange(campaign.places, dtype=np.float64)
    # Trays side by side.
    offset = 0.12 * (k - 0.5 * (len(campaign.trays) - 1))
    colour = SERIES[k % len(SERIES)]
    axes.errorbar(
        x[known] + 1.0 + offset,
        values[known],
        yerr=scale * _errors(campaign, tray, quantity)[:, known],
        fmt=MARKS[k % len(MARKS)],
        ms=4 if campaign.places <= _MANY_CYCLES else 2.5,
        lw=0.7,
        color=colour,
        label=f'tray {tray}',
    )
    trend = campaign.trends[tray, quantity]
    if math.isfinite(trend.slope):
        axes.plot(x + 1.0, scale * trend.at(x), color=colour, lw=1.0, alpha=0.7)


def _errors(campaign: Campaign, tray: int, quantity: str) -> NDArray[np.float64]:
    """Error bars below and above, (2, places); 0 where unknown."""
    if quantity == 'restitution':
        middle = campaign.values(tray, quantity)
        ends = [campaign.values(tray, f'restitution_{end}') for end in ('lower', 'upper')]
        bars = np.abs(np.stack(ends) - middle)
    else:
        bars = np.tile(campaign.values(tray, f'{quantity}_error'), (2, 1))
    return np.asarray(np.nan_to_num(bars))


def campaign_values(campaign: Campaign) -> dict[str, Any]:
    """The values of a campaign for JSON, in SI; None where unknown."""
    fields = (
        'peak_speed',
        'peak_speed_error',
        'restitution',
        'restitution_lower',
        'restitution_upper',
        'cluster_size',
        'cluster_size_error',
    )
    return {
        'cycles': campaign.places,
        'cluster_size': campaign.measure.column,
        'cluster_size_unit': campaign.measure.unit,
        'quiet_periods': [
            {
                'first': period.first + 1,
                'last': period.last + 1,
                'excess': period.excess,
                'chance': period.chance,
            }
            for period in campaign.periods
        ],
        'trays': {
            str(number): {
                'trends': {
                    name: {
                        'slope': finite_or_none(trend.slope),
                        'slope_error': finite_or_none(trend.slope_error),
                        'cycles': trend.samples,
                    }
                    for (tray, name), trend in campaign.trends.items()
                    if tray == number
                },
                **{name: json_values(campaign.values(number, name)) for name in fields},
            }
            for number in campaign.trays
        },
    }
