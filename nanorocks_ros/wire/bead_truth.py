"""Conversion of the truth of all beads to an array and back, by the layout in ``msg_defs``."""

from __future__ import annotations

import math
import re
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.records import NS, BeadsTruth
from nanorocks_ros.wire.layout_fields import (
    LayoutField,
    array_elements,
    exact_values,
    rounded_elements,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_FIELD = re.compile(r'^(float32|float64|int32)(\[\])?\s+([a-z]\w*)\s*#\s*\[([^\]]+)\]\s*(.*)$')


class BeadsLayout(NamedTuple):
    """The elements of an array of beads.

    Parameters
    ----------
    doc : str
    head : tuple of LayoutField
        Once, at the beginning; then the remainder of the time.
    bead : tuple of LayoutField
        Then for each bead.
    """

    doc: str
    head: tuple[LayoutField, ...]
    bead: tuple[LayoutField, ...]

    def dimensions(self, beads: int) -> tuple[tuple[str, int, int], ...]:
        """Label, size and stride of each ``layout.dim`` of an array with so many beads."""
        elements, row = array_elements(self.head), len(self.bead)
        head, bead = (','.join(field.name for field in fields) for fields in (elements, self.bead))
        return (
            (head, len(elements), len(elements)),
            ('bead', beads, beads * row),
            (bead, row, row),
        )


@cache
def beads_layout() -> BeadsLayout:
    """The layout of `BeadsTruth`, from its message definition."""
    text = resources.files(__package__).joinpath('msg', 'BeadsTruth.msg').read_text('utf-8')
    lines = [line.strip() for line in text.splitlines()]
    fields = [match.groups() for line in lines if (match := _FIELD.match(line))]
    return BeadsLayout(
        lines[0].removeprefix('# '),
        tuple(LayoutField(kind, *field) for kind, many, *field in fields if not many),
        tuple(LayoutField(kind, *field) for kind, many, *field in fields if many),
    )


def beads_to_array(truth: BeadsTruth, epoch_ns: int) -> NDArray[np.float32]:
    """The elements of the truth in the order of its layout.

    Parameters
    ----------
    truth : BeadsTruth
    epoch_ns : int, [ns]
        What `time` counts from.

    Returns
    -------
    ndarray of float32, (7 + 9 n,)
    """
    head = [
        (truth.stamp_ns - epoch_ns) / NS,
        float(truth.cycle),
        *truth.displacement,
        *truth.tray_velocity,
    ]
    columns = (truth.radii, truth.species, truth.bodies)
    rows = np.column_stack([truth.positions, truth.velocities, *columns])
    return np.append(rounded_elements(beads_layout().head, head), rows.ravel().astype(np.float32))


def beads_from_array(
    values: Sequence[float] | NDArray[np.float32], *, tray: int, epoch_ns: int, where: str
) -> BeadsTruth:
    """The truth in an array.

    Parameters
    ----------
    values : sequence of float
    tray : int
        From the topic name.
    epoch_ns : int, [ns]
    where : str
        The topic, for the error.

    Raises
    ------
    FrameError
        When the elements are no whole beads, or a number that must be known is not finite.
    """
    layout = beads_layout()
    first, row = len(array_elements(layout.head)), len(layout.bead)
    elements = np.asarray(values, dtype=np.float64)
    if elements.ndim != 1 or elements.size < first or (elements.size - first) % row:
        raise FrameError(
            where,
            f'{elements.size} elements are not {first} and {row} for each bead',
            'use the same release of nanorocks_ros on both sides',
        )
    if not np.isfinite(elements).all():
        at = int(np.flatnonzero(~np.isfinite(elements))[0])
        raise FrameError(where, f'element {at} is {elements[at]}', 'publish finite numbers')
    head = exact_values(layout.head, elements[:first])
    beads = elements[first:].reshape(-1, row)
    return BeadsTruth(
        stamp_ns=epoch_ns + math.floor(head[0] * NS + 0.5),
        tray=tray,
        cycle=int(head[1]),
        displacement=head[2:4].copy(),
        tray_velocity=head[4:6].copy(),
        positions=beads[:, :3].copy(),
        velocities=beads[:, 3:6].copy(),
        radii=beads[:, 6].copy(),
        species=beads[:, 7].astype(np.int32),
        bodies=beads[:, 8].astype(np.int32),
    )
