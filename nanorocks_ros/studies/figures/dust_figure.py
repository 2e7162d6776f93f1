"""The figure of sticking thresholds and published collision models, after figure 14.

Tested by ``test/cli/figures/test_figure_dust.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import (
    BLACK,
    GREEN,
    GREY,
    MEASURED,
    PAPER,
    TWO_COLUMNS,
    plain_numbers,
)
from nanorocks_ros.physics.dust_models import (
    ALWAYS_BOUNCING,
    BOUNCING_SLOPE,
    BOUNCING_SLOPE_SOURCE,
    CURVES,
    MILLIMETRE_STICKS_BELOW,
    PAPER_STICKING_SPEEDS,
    STICKING_SEEN,
    UNVERIFIED,
    MeasuredThreshold,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

_MM, _MG = 1e3, 1e6
_CURVE, _SLOPE, _SEEN = GREY, BLACK, GREEN
PAPER_SOURCE = 'the paper, twice the mean speed at its onset'
_MASSES = 1e-10, 1e-3
# Factor of mass, up and down, over which the slope is drawn.
_SLOPE_SPAN = 12.0
# Width of the name of a tray in decades of mass, and how far below the points it stands, a factor.
_NAME_DECADES = 0.65
_NAMES_BELOW = 2.5


def threshold_of_tray(
    tray: Tray,
    speed: float,
    interval: tuple[float, float] | None = None,
    source: str = 'measured',
) -> MeasuredThreshold:
    """A threshold and its interval [m/s], at the masses of the beads of a tray.

    Raises
    ------
    ConfigurationError
        For numbers that are not positive, or an interval that does not contain the threshold.
    """
    masses = [species.bead_mass for species in tray.species]
    lower, upper = (speed, speed) if interval is None else interval
    return MeasuredThreshold(
        tray=tray.number,
        mass=tray.mean_mass,
        lightest=min(masses),
        heaviest=max(masses),
        speed=speed,
        lower=lower,
        upper=upper,
        source=source,
    )


def paper_thresholds(trays: Mapping[int, Tray]) -> tuple[MeasuredThreshold, ...]:
    """The thresholds of the paper for the given trays."""
    return tuple(
        threshold_of_tray(trays[number], speed, source=PAPER_SOURCE)
        for number, speed in PAPER_STICKING_SPEEDS.items()
        if number in trays
    )


def dust_figure(path: Path, points: Sequence[MeasuredThreshold]) -> dict[str, Any]:
    """Draw thresholds against mass, with all published curves; unverified ones are marked.

    Parameters
    ----------
    path : Path
    points : sequence of MeasuredThreshold
        One or more.

    Returns
    -------
    dict
        The points, and the published curves at their masses, in SI.

    Raises
    ------
    ConfigurationError
        For an empty sequence of points.
    RecordingError
        When the picture cannot be written.

    References
    ----------
    [B19] fig. 14.
    """
    if not points:
        raise ConfigurationError('thresholds', 'there are none', 'give one with --measured')
    with figure_file(path, TWO_COLUMNS, 130.0) as figure:
        axes = figure.subplots()
        _draw_published(axes, points)
        _draw_points(axes, points)
        axes.set_xscale('log')
        axes.set_yscale('log')
        axes.set_xlim(*(_MG * mass for mass in _MASSES))
        axes.set_ylim(0.02, 2000.0)
        for axis in (axes.xaxis, axes.yaxis):
            plain_numbers(axis)
        axes.set_xlabel('mass of a particle [mg]')
        axes.set_ylabel('relative speed [mm/s]')
        axes.set_title('Sticking thresholds and published collision models')
        axes.legend(loc='upper right')
        axes.grid(alpha=0.25)
    return {'points': [_as_dict(point) for point in points], 'curves': _curves_as_dict()}


def _as_dict(point: MeasuredThreshold) -> dict[str, Any]:
    return {
        'tray': point.tray,
        'source': point.source,
        'mass': point.mass,
        'lightest': point.lightest,
        'heaviest': point.heaviest,
        'sticking_speed': point.speed,
        'sticking_speed_lower': point.lower,
        'sticking_speed_upper': point.upper,
        'all_bounce_above': float(ALWAYS_BOUNCING.threshold(point.mass)),
        'all_bounce_above_verified': ALWAYS_BOUNCING.verified,
    }


def _curves_as_dict() -> list[dict[str, Any]]:
    return [
        {
            'name': curve.name,
            'mass': curve.mass,
            'speed': curve.speed,
            'exponent': curve.exponent,
            'source': curve.source,
            'verified': curve.verified,
        }
        for curve in CURVES
    ]


def _draw_published(axes: Axes, points: Sequence[MeasuredThreshold]) -> None:
    masses = np.geomspace(*_MASSES, 50)
    for curve, style in zip(CURVES, ('--', ':'), strict=True):
        axes.plot(
            _MG * masses,
            _MM * curve.threshold(masses),
            style,
            color=_CURVE,
            lw=1.6,
            label=curve.label,
        )
        if not curve.verified:
            # Written on the curve as well, since a legend can be cut off.
            place = 1.5e-10
            axes.annotate(
                f'{curve.name} ({UNVERIFIED})',
                (_MG * place, _MM * float(curve.threshold(place))),
                xytext=(0, 7),
                textcoords='offset points',
                fontsize=7.0,
                color=_CURVE,
                va='bottom',
            )
    axes.axhspan(
        _MM * STICKING_SEEN.lower,
        _MM * STICKING_SEEN.upper,
        color=_SEEN,
        alpha=0.12,
        lw=0,
        label=f'{STICKING_SEEN.name}: {STICKING_SEEN.source}',
    )
    axes.axhline(
        _MM * MILLIMETRE_STICKS_BELOW,
        color=_SEEN,
        lw=1.2,
        label=f'millimetre aggregates always stick below: {STICKING_SEEN.source}',
    )
    middle = np.exp(np.mean(np.log([(point.mass, point.speed) for point in points]), axis=0))
    ends = middle[0] * np.array([1.0 / _SLOPE_SPAN, _SLOPE_SPAN])
    axes.plot(
        _MG * ends,
        _MM * middle[1] * (ends / middle[0]) ** BOUNCING_SLOPE,
        '-.',
        color=_SLOPE,
        lw=1.3,
        label=f'slope {BOUNCING_SLOPE:g}, at an arbitrary height: {BOUNCING_SLOPE_SOURCE}',
    )


def _draw_points(axes: Axes, points: Sequence[MeasuredThreshold]) -> None:
    labelled: set[str] = set()
    for point in points:
        of_paper = point.source == PAPER_SOURCE
        colour = PAPER if of_paper else MEASURED
        axes.errorbar(
            _MG * point.mass,
            _MM * point.speed,
            xerr=_MG * np.array([[point.mass - point.lightest], [point.heaviest - point.mass]]),
            yerr=_MM * np.array([[point.speed - point.lower], [point.upper - point.speed]]),
            fmt='D' if of_paper else 'o',
            ms=7,
            mec='black',
            mew=0.6,
            color=colour,
            ecolor='black',
            elinewidth=0.8,
            capsize=2,
            zorder=5,
            label=None
            if point.source in labelled
            else f'{point.source} (bar: masses in the tray)',
        )
        labelled.add(point.source)
    name_trays(axes, points)


def name_trays(axes: Axes, points: Sequence[MeasuredThreshold]) -> None:
    """Names of the trays in a row below all points, each with a line to its lowest point.

    Trays differ by a factor of three in mass on an axis of seven decades: names beside the points
    would cover each other.
    """
    trays: dict[float, list[MeasuredThreshold]] = {}
    for point in sorted(points, key=lambda point: (point.mass, point.tray)):
        trays.setdefault(point.mass, []).append(point)
    masses = _apart(np.array(list(trays)))
    height = min(point.lower for point in points) / _NAMES_BELOW
    for mass, alike in zip(masses, trays.values(), strict=True):
        numbers = sorted({point.tray for point in alike})
        axes.annotate(
            f'tray{"s" if numbers[1:] else ""} {", ".join(map(str, numbers))}',
            (_MG * alike[0].mass, _MM * min(point.lower for point in alike)),
            xytext=(_MG * float(mass), _MM * height),
            ha='center',
            va='top',
            arrowprops={'arrowstyle': '-', 'lw': 0.6, 'shrinkA': 0.0, 'shrinkB': 2.0},
            bbox={'facecolor': 'white', 'alpha': 0.7, 'lw': 0, 'pad': 0.5},
            zorder=4,
        )


def _apart(masses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ascending masses, moved apart by as little as their names need, about the same middle."""
    logs = np.log10(masses)
    steps = _NAME_DECADES * np.arange(logs.size)
    spread = np.maximum.accumulate(logs - steps) + steps
    return np.asarray(10.0 ** (spread - (spread - logs).mean()))
