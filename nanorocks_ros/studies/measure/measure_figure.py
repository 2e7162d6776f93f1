"""The figure of a measured film: speeds over time, and speeds after and before contacts.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, SKY, TWO_COLUMNS

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from nanorocks_ros.studies.measure.measured_words import LengthUnit
    from nanorocks_ros.studies.measure.track_contacts import TrackContacts
    from nanorocks_ros.studies.measure.track_speeds import TrackSpeeds


def measure_figure(
    path: Path | None, speeds: TrackSpeeds, contacts: TrackContacts, unit: LengthUnit
) -> Figure:
    """Draw the speeds, and both kinds of contacts.

    Parameters
    ----------
    path : Path or None
        Picture to write; None: none.
    speeds : TrackSpeeds
    contacts : TrackContacts
    unit : LengthUnit

    Raises
    ------
    RecordingError
        When the picture cannot be written.
    """
    with figure_file(path, TWO_COLUMNS, 62.0) as figure:
        time, pairs, walls = figure.subplots(1, 3)
        time.plot(
            speeds.time, unit.per_metre * speeds.rms, lw=0.8, color=SKY, label='root mean square'
        )
        time.plot(speeds.time, unit.per_metre * speeds.mean, color=MEASURED, label='mean')
        time.set(xlabel='time [s]', ylabel=f'speed of the beads [{unit.name}/s]', ylim=(0.0, None))
        time.legend()
        collided = np.array([pair.normal_speeds for pair in contacts.collisions]).reshape(-1, 2)
        rebounded = np.array(
            [(rebound.incoming.value, rebound.outgoing.value) for rebound in contacts.rebounds]
        ).reshape(-1, 2)
        alone = contacts.alone
        _scatter(pairs, collided, alone.beads.restitution.value, 'collisions of two beads', unit)
        _scatter(walls, rebounded, alone.walls.restitution.value, 'rebounds from walls', unit)
    return figure


def _scatter(
    axes: Axes, rows: NDArray[np.float64], restitution: float, title: str, unit: LengthUnit
) -> None:
    """Speeds after contacts over those before, and the line of the restitution."""
    axes.set(
        title=f'{len(rows)} {title}',
        xlabel=f'normal speed before [{unit.name}/s]',
        ylabel=f'after [{unit.name}/s]',
    )
    if not len(rows):
        axes.text(0.5, 0.5, 'none seen', transform=axes.transAxes, ha='center')
        return
    before, after = unit.per_metre * rows.T
    axes.plot(before, after, '.', ms=3, alpha=0.6, color=MEASURED)
    if not math.isnan(restitution):
        ends = np.array([0.0, before.max()])
        axes.plot(ends, restitution * ends, color=FITTED, label=f'restitution {restitution:.3f}')
        axes.legend(loc='upper left')
    axes.set(xlim=(0.0, None), ylim=(0.0, None))
