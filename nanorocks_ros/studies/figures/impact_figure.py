"""The figure of restitution against impact speed, from single contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment import paper_values as reported
from nanorocks_ros.inference.speed_dependence import speed_dependence
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import (
    FITTED,
    GREEN,
    MEASURED,
    PAPER,
    TWO_COLUMNS,
    plain_numbers,
)
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.records.headlines import walls_rub

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
    from nanorocks_ros.inference.contacts.impact_bins import SpeedBin
    from nanorocks_ros.inference.contacts.restitution_exponent import RestitutionExponent
    from nanorocks_ros.inference.flights.flight_losses import FlightLosses
    from nanorocks_ros.inference.likelihood_1d import Posterior1D
    from nanorocks_ros.settings import PriorSettings

_MM = 1e3
_ENDS, _BARS = np.array([0.025, 0.5, 0.975]), np.array([0.16, 0.5, 0.84])
_SPEEDS = 60
_LAW, _CONSTANT = FITTED, GREEN
# Room around the points, over their range, and factor on their outermost speeds.
_MARGIN, _BEYOND = 0.6, 1.5
_PAPER_TRAY = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactData:
    """Contacts of a tray.

    Parameters
    ----------
    tray : int
    cycles : int
    terms : ContactTerms
    losses : FlightLosses
    prior : PriorSettings
    """

    tray: int
    cycles: int
    terms: ContactTerms
    losses: FlightLosses
    prior: PriorSettings


class _Panel(NamedTuple):
    """One kind of contacts: ranges of speed, law and constant restitution."""

    title: str
    bins: tuple[SpeedBin, ...]
    law: RestitutionExponent | None
    constant: Posterior1D | None


def impact_figure(path: Path, data: ImpactData) -> dict[str, Any]:
    """Draw the restitution of beads and walls against the impact speed.

    Parameters
    ----------
    path : Path
    data : ImpactData

    Returns
    -------
    dict
        ``beads`` and ``walls``: ranges of speed with their restitution, constant restitution,
        law with its exponent and the chance of a constant one; None where contacts are too few.

    Raises
    ------
    FitError
        When no kind of contacts is seen often enough.
    RecordingError
        When the picture cannot be written.

    References
    ----------
    [B19] fig. 13, which has the restitution against the mean speed of the gas.
    """
    panels = _panels(data)
    drawn = [panel for panel in panels if panel.bins]
    if not drawn:
        raise FitError(
            f'tray {data.tray}',
            f'{data.terms.collisions} collisions and {data.terms.rebounds} rebounds are too few',
            'give more cycles',
        )
    with figure_file(path, TWO_COLUMNS, 12.0 + 85.0 * len(drawn)) as figure:
        for axes, panel in zip(
            figure.subplots(len(drawn), 1, squeeze=False)[:, 0], drawn, strict=True
        ):
            _draw(axes, panel)
            if panel is panels[0]:
                _draw_paper(axes, data.tray)
            axes.legend(loc='lower left', bbox_to_anchor=(0.0, 1.0))
        figure.suptitle(f'Tray {data.tray}, {counted(data.cycles, "cycle")}', x=0.01, ha='left')
    beads, walls = (_values(panel) for panel in panels)
    return {'tray': data.tray, 'cycles': data.cycles, 'beads': beads, 'walls': walls}


def _panels(data: ImpactData) -> tuple[_Panel, _Panel]:
    terms, prior = data.terms, data.prior
    rubbed = walls_rub(terms.wall_friction)
    slowing = data.losses.rubbed if rubbed else data.losses.slowing
    dependence = speed_dependence(terms, data.losses, prior)
    beads = terms.bead_likelihood(prior.collision_bias, slowing)
    walls = terms.wall_likelihood(prior.rebound_bias, slowing)
    lowest = prior.min_wall_restitution, prior.max_wall_restitution
    return (
        _Panel(
            f'beads, {counted(terms.collisions, "collision")}',
            terms.bead_bins(_BARS, slowing),
            dependence.beads,
            beads.posterior((0.0, 1.0)) if beads else None,
        ),
        _Panel(
            f'side walls, {counted(terms.rebounds, "rebound")}',
            terms.wall_bins(_BARS, slowing),
            dependence.walls,
            walls.posterior(lowest) if walls else None,
        ),
    )


def _draw(axes: Axes, panel: _Panel) -> None:
    bins = panel.bins
    # Slower and faster contacts are few: bands would fill the picture.
    ends = _MM * bins[0].speed / _BEYOND, _MM * min(bins[-1].highest, _BEYOND * bins[-1].speed)
    _draw_bands(axes, panel, np.geomspace(*ends, _SPEEDS))
    speed = np.array([each.speed for each in bins]) * _MM
    value = np.array([each.restitution.value for each in bins])
    lower = np.array([each.restitution.lower for each in bins])
    upper = np.array([each.restitution.upper for each in bins])
    sides = np.array([(each.lowest, each.highest) for each in bins]).T * _MM
    axes.errorbar(
        speed,
        value,
        yerr=(value - lower, upper - value),
        xerr=(speed - sides[0], sides[1] - speed),
        fmt='o',
        ms=4,
        lw=1.0,
        color=MEASURED,
        label=f'{panel.title} in ranges of speed, 68 %',
    )
    axes.set_xscale('log')
    plain_numbers(axes.xaxis)
    axes.set_xlim(*ends)
    room = _MARGIN * (upper.max() - lower.min())
    axes.set_ylim(max(lower.min() - room, 0.0), min(upper.max() + room, 1.0))
    axes.set_xlabel('impact speed along the normal [mm/s]')
    axes.set_ylabel('restitution')
    axes.grid(alpha=0.25)


def _draw_bands(axes: Axes, panel: _Panel, axis: NDArray[np.float64]) -> None:
    """Constant restitution and law, each with its 95 % band."""
    if panel.constant is not None:
        low, middle, high = panel.constant.quantiles(_ENDS)
        axes.axhspan(low, high, color=_CONSTANT, alpha=0.25, lw=0)
        axes.axhline(middle, color=_CONSTANT, lw=1.2, label=f'constant {middle:.3f}, 95 % band')
    if panel.law is not None:
        band = np.array([panel.law.law.at(speed / _MM).quantiles(_ENDS) for speed in axis]).T
        low, middle, high = panel.law.exponent.quantiles(_ENDS)
        label = (
            f'1 − restitution as speed to the power of {middle:.2f} [{low:.2f}, {high:.2f}], '
            f'95 % band; chance that it is constant: {panel.law.chance:.2g}'
        )
        axes.fill_between(axis, band[0], band[2], color=_LAW, alpha=0.2, lw=0)
        axes.plot(axis, band[1], color=_LAW, lw=1.4, label=label)


def _draw_paper(axes: Axes, tray: int) -> None:
    """What the paper says of the beads: figure 13 of tray 1, or the range of all trays."""
    left, right = axes.get_xlim()
    if tray != _PAPER_TRAY:
        low, high = reported.PAPER_RESTITUTION_RANGE
        axes.axhspan(low, high, color=PAPER, alpha=0.1, lw=0)
        axes.plot([], [], color=PAPER, alpha=0.3, lw=6, label=f'paper, all trays: {low} to {high}')
        return
    value, narrow = reported.PAPER_RESTITUTION, _MM * reported.PAPER_NARROW_SPEED
    label = f'paper, figure 13: {value:g} on average at all mean speeds of the gas'
    axes.plot([left, right], [value, value], ':', color=PAPER, lw=1.6, label=label)
    if narrow < right:
        axes.plot(
            [max(narrow, left), right],
            [value, value],
            color=PAPER,
            lw=2.2,
            label=f'the same: little scatter above {narrow:g} mm/s, values up to '
            f'{reported.PAPER_HIGHEST_RESTITUTION:g} below',
        )
    axes.set_xlim(left, right)


def _values(panel: _Panel) -> dict[str, Any] | None:
    if not panel.bins:
        return None
    values: dict[str, Any] = {
        'ranges': [
            {
                'speed': each.speed,
                'lowest_speed': each.lowest,
                'highest_speed': each.highest,
                'contacts': each.contacts,
                'restitution': each.restitution.value,
                'restitution_lower': each.restitution.lower,
                'restitution_upper': each.restitution.upper,
            }
            for each in panel.bins
        ],
        'constant': None,
        'law': None,
    }
    if panel.constant is not None:
        values['constant'] = _limits(panel.constant)
    if panel.law is not None:
        values['law'] = {
            'impact_speed': panel.law.speed,
            'impact_restitution': _limits(panel.law.law.at(panel.law.speed)),
            'exponent': _limits(panel.law.exponent),
            'energy_weighted': _limits(panel.law.law.energy_weighted),
            'chance_of_constant': panel.law.chance,
        }
    return values


def _limits(posterior: Posterior1D) -> dict[str, float]:
    lower, value, upper = posterior.quantiles(_ENDS).tolist()
    return {'value': value, 'lower': lower, 'upper': upper}
