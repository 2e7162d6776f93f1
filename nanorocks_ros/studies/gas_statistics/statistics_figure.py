"""Figure of the statistics of the gas in one tray.

Tested by ``test/studies/gas_statistics/test_tray_statistics.py``.
"""

from __future__ import annotations

import math
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import GREY, SERIES, TWO_COLUMNS, plain_numbers
from nanorocks_ros.studies.gas_statistics.velocity_distribution import EDGES, sonine_density

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.records import Measured
    from nanorocks_ros.studies.gas_statistics.tray_statistics import TrayStatistics

_MM, _NANOJOULE = 1e3, 1e9
_HEIGHT = 195.0
# Of the decades of an axis, above its data.
_LEGEND_ROOM = 0.5
_LEAST_DENSITY, _HIGHEST_DENSITY = 1e-3, 10.0
# Largest cumulant at which the first Sonine polynomial alone is drawn: beyond, it goes negative.
_MOST_SONINE = 0.5
# Limit of the axis of pair correlations: clusters have far higher first peaks.
_HIGHEST_PAIRS = 4.0


def statistics_figure(path: Path, statistics: TrayStatistics) -> None:
    """Draw energies, velocities, collisions, pairs, structure and clustering of a tray.

    Parameters
    ----------
    path : Path
        ``.png``; a file there is replaced.
    statistics : TrayStatistics

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    with figure_file(path, TWO_COLUMNS, _HEIGHT) as figure:
        panels = figure.subplots(3, 2)
        figure.suptitle(
            f'tray {statistics.tray.number}: {len(statistics.cycles)} '
            f'{"cycle" if len(statistics.cycles) == 1 else "cycles"}, {statistics.seconds:.0f} s',
            x=0.01,
            ha='left',
        )
        drawings = (_energies, _velocities, _collisions, _pairs, _structure, _clustering)
        for axes, draw in zip(panels.flat, drawings, strict=True):
            draw(axes, statistics)
            axes.grid(alpha=0.25)
            if axes.get_yscale() == 'log' and draw is not _velocities:
                plain_numbers(axes.yaxis)
            if axes.get_legend_handles_labels()[0]:
                axes.legend()


def _text(measured: Measured, digits: int = 2) -> str:
    if not math.isfinite(measured.error):
        return f'{measured.value:.{digits}f}'
    return f'{measured.value:.{digits}f} ± {measured.error:.{digits}f}'


def _energies(axes: Axes, statistics: TrayStatistics) -> None:
    for kind, part in enumerate(statistics.temperatures):
        name = statistics.tray.species[kind].material
        ratio = f', {_text(statistics.energy_ratios[kind])} of the first' if kind else ''
        axes.errorbar(
            part.time,
            _NANOJOULE * part.energy,
            yerr=_NANOJOULE * part.energy_error,
            fmt='o',
            ms=3.5,
            lw=0.8,
            color=SERIES[kind % len(SERIES)],
            label=name + ratio,
        )
    axes.set_yscale('log')
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel('energy of a bead in x and y [nJ]')


def _velocities(axes: Axes, statistics: TrayStatistics) -> None:
    middles, fine = 0.5 * (EDGES[:-1] + EDGES[1:]), np.linspace(EDGES[0], EDGES[-1], 301)
    axes.plot(fine, sonine_density(fine, 0.0), color=GREY, lw=3, alpha=0.6, label='Maxwell')
    for kind, shape in enumerate(statistics.velocities):
        if shape is None:
            continue
        name = statistics.tray.species[kind].material
        axes.errorbar(
            middles,
            np.where(shape.density > 0.0, shape.density, np.nan),
            yerr=shape.density_error,
            fmt='o',
            ms=3.0,
            lw=0.8,
            color=SERIES[kind % len(SERIES)],
            label=f'{name}: a2 {_text(shape.fourth_cumulant)}, '
            f'anisotropy {_text(shape.anisotropy)}',
        )
        if abs(shape.fourth_cumulant.value) <= _MOST_SONINE:
            density = sonine_density(fine, shape.fourth_cumulant.value)
            colour = SERIES[kind % len(SERIES)]
            axes.plot(fine, np.where(density > 0.0, density, np.nan), color=colour, lw=1)
    axes.set_yscale('log')
    axes.set_ylim(_LEAST_DENSITY, _HIGHEST_DENSITY)
    axes.set_xlabel('component of velocity / its root mean square')
    axes.set_ylabel('probability density')


def _collisions(axes: Axes, statistics: TrayStatistics) -> None:
    for kind, rate in enumerate(statistics.collisions):
        if rate is None:
            continue
        name = statistics.tray.species[kind].material
        part = statistics.temperatures[kind]
        axes.errorbar(
            part.time,
            rate.per_path.value * part.mean_projected_speed,
            yerr=rate.per_path.error * part.mean_projected_speed,
            fmt='o',
            ms=3.5,
            lw=0.8,
            color=SERIES[kind % len(SERIES)],
            label=f'{name}: mean free path {_MM * rate.mean_free_path.value:.2f} ± '
            f'{_MM * rate.mean_free_path.error:.2f} mm',
        )
        order = np.argsort(part.time)
        axes.plot(
            part.time[order],
            rate.theory_per_path * part.mean_projected_speed[order],
            color=SERIES[kind % len(SERIES)],
            lw=1,
            label=f'theory: {_MM * rate.theory_mean_free_path:.2f} mm',
        )
        _draw_wall_hits(axes, statistics, kind, order)
    axes.set_yscale('log')
    # Room for the legend.
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** _LEGEND_ROOM)
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel('collisions of a bead [1/s]')


def _draw_wall_hits(
    axes: Axes, statistics: TrayStatistics, kind: int, order: NDArray[np.int64]
) -> None:
    """Hits of the side walls and those of theory, in the colour of the species."""
    walls, part = statistics.wall_hits[kind], statistics.temperatures[kind]
    if walls is None:
        return
    colour = SERIES[kind % len(SERIES)]
    axes.errorbar(
        part.time,
        walls.per_path.value * part.mean_projected_speed,
        yerr=walls.per_path.error * part.mean_projected_speed,
        fmt='s',
        ms=3,
        lw=0.8,
        mfc='none',
        color=colour,
        label=f'side walls: {walls.per_path.value / _MM:.3f} ± '
        f'{walls.per_path.error / _MM:.3f} /mm of path',
    )
    axes.plot(
        part.time[order],
        walls.theory_per_path * part.mean_projected_speed[order],
        '--',
        color=colour,
        lw=1,
        label=f'theory: {walls.theory_per_path / _MM:.3f} /mm',
    )


def _pairs(axes: Axes, statistics: TrayStatistics) -> None:
    axes.axhline(1.0, color=GREY, lw=1)
    highest = 0.0
    for pair, colour in zip(statistics.pairs, cycle(SERIES), strict=False):
        names = ' and '.join(statistics.tray.species[kind].material for kind in pair.species)
        distance = _MM * pair.distance
        axes.fill_between(
            distance, pair.value - pair.error, pair.value + pair.error, color=colour, alpha=0.25
        )
        axes.plot(distance, pair.value, color=colour, lw=1.2, label=names)
        axes.plot(distance, pair.random, ':', color=colour, lw=1)
        highest = max(highest, 1.1 * float(np.nanmax(pair.value, initial=0.0)))
    axes.set_ylim(0.0, min(max(highest, 1.5), _HIGHEST_PAIRS))
    axes.set_xlabel('projected distance r [mm]')
    axes.set_ylabel('g(r); dotted: random places')


def _structure(axes: Axes, statistics: TrayStatistics) -> None:
    factor = statistics.structure
    axes.axhline(1.0, color=GREY, lw=1)
    axes.errorbar(
        factor.wave_number / _MM,
        factor.value,
        yerr=factor.error,
        fmt='o',
        ms=3.5,
        lw=0.8,
        color=SERIES[0],
        label='all beads',
    )
    axes.plot(factor.wave_number / _MM, factor.random, ':', color=SERIES[0], label='random')
    axes.set_ylim(0.0, None)
    axes.set_xlabel('wave number k [1/mm]')
    axes.set_ylabel('S(k)')


def _clustering(axes: Axes, statistics: TrayStatistics) -> None:
    reference = statistics.clustering[0]
    axes.axhspan(
        reference.random - reference.random_deviation,
        reference.random + reference.random_deviation,
        color=GREY,
        alpha=0.25,
        lw=0,
        label='random places',
    )
    onsets = [part.onset for part in statistics.clustering if math.isfinite(part.onset)]
    for part in statistics.clustering:
        axes.plot(part.time, part.value, 'o-', ms=3.0, lw=0.8, color=SERIES[0], alpha=0.7)
    for onset in onsets:
        axes.axvline(onset, color=SERIES[1], lw=1)
    title = f'clustering from {min(onsets):.1f} s on' if onsets else 'no clustering'
    axes.set_title(title)
    axes.set_ylim(0.0, None)
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel('S of the long waves')
