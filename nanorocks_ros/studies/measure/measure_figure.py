"""The figure of a measured film: speeds over time, and speeds after and before contacts.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.studies.measure.measured_words import LengthUnit
    from nanorocks_ros.studies.measure.track_contacts import TrackContacts
    from nanorocks_ros.studies.measure.track_speeds import TrackSpeeds


def measure_figure(
    path: Path, speeds: TrackSpeeds, contacts: TrackContacts, unit: LengthUnit
) -> None:
    """Draw the speeds, and both kinds of contacts, into a file.

    Parameters
    ----------
    path : Path
        Picture to write.
    speeds : TrackSpeeds
    contacts : TrackContacts
    unit : LengthUnit

    Raises
    ------
    RecordingError
        When the picture cannot be written.
    """
    with atomic_file(path) as part:
        drawn_measure(speeds, contacts, unit).savefig(part, dpi=110)


def drawn_measure(speeds: TrackSpeeds, contacts: TrackContacts, unit: LengthUnit) -> Figure:
    """The figure of the speeds and both kinds of contacts."""
    figure = Figure(figsize=(12.0, 3.9), layout='constrained')
    time, pairs, walls = figure.subplots(1, 3)
    time.plot(speeds.time, unit.per_metre * speeds.mean, label='mean')
    time.plot(speeds.time, unit.per_metre * speeds.rms, lw=0.8, label='rms')
    time.set(xlabel='time [s]', ylabel=f'speed of the beads [{unit.name}/s]', ylim=(0.0, None))
    time.legend(frameon=False)
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
    axes.plot(before, after, '.', ms=4)
    if not math.isnan(restitution):
        ends = np.array([0.0, before.max()])
        axes.plot(ends, restitution * ends, 'k-', lw=1, label=f'restitution {restitution:.3f}')
        axes.legend(frameon=False, loc='upper left')
    axes.set(xlim=(0.0, None), ylim=(0.0, None))
