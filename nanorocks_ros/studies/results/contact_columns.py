"""Contacts as one table: collisions of two beads and rebounds from walls, a row for each.

Tested by ``test/interface/test_measuring.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.records import NS, WALL_NAMES, PairCollision, Rebound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

CONTACT_COLUMNS = (
    Column(name='tray', kind='int64', unit='1', doc='number of the tray'),
    Column(name='cycle', kind='int64', unit='1', doc='shaking events so far'),
    Column(name='time', unit='s', doc='since epoch'),
    Column(name='kind', kind='string', doc='what the bead met', words=('collision', 'rebound')),
    Column(name='bead', kind='int64', unit='1', doc='number of its track'),
    Column(
        name='partner', kind='int64', unit='1', doc='track of the other bead; empty for a rebound'
    ),
    Column(
        name='wall', kind='string', doc='in the picture; empty for a collision', words=WALL_NAMES
    ),
    Column(
        name='speed_before',
        unit='m/s',
        doc='along the normal: to the wall, or along the line of centres in the picture',
    ),
    Column(name='speed_before_error', unit='m/s', doc='one standard error'),
    Column(name='speed_after', unit='m/s', doc='along the normal, after the contact'),
    Column(name='speed_after_error', unit='m/s', doc='one standard error'),
    Column(
        name='speed_ratio',
        unit='1',
        doc='speed_after over speed_before: of a rebound its restitution; of collisions it '
        'scatters, since beads meet at different heights',
    ),
    Column(name='x', unit='m', doc='of the contact, along columns from the corner of the floor'),
    Column(name='y', unit='m', doc='along rows'),
)
"""Columns of the table."""


def contact_arrays(
    contacts: Sequence[Rebound | PairCollision],
    epoch_ns: int,
    corner: tuple[float, float] = (0.0, 0.0),
) -> dict[str, NDArray[Any]]:
    """The columns of the table, rows in order of time.

    Parameters
    ----------
    contacts : sequence of Rebound or PairCollision
    epoch_ns : int, [ns]
    corner : tuple of 2 floats, [m]
        From which places count.

    Returns
    -------
    dict of str to ndarray (n,)
        `partner` and `wall` hold None where there is none.
    """
    ordered = sorted(contacts, key=lambda contact: contact.stamp_ns)
    rows = [
        _rebound_row(contact, epoch_ns)
        if isinstance(contact, Rebound)
        else _collision_row(contact, epoch_ns)
        for contact in ordered
    ]
    kinds = {'float64': np.float64, 'int64': np.int64}
    arrays = {
        column.name: np.array(
            [row[k] for row in rows],
            dtype=object if column.name == 'partner' else kinds.get(column.kind, object),
        )
        for k, column in enumerate(CONTACT_COLUMNS)
    }
    arrays['x'] += corner[0]
    arrays['y'] += corner[1]
    return arrays


def _rebound_row(rebound: Rebound, epoch_ns: int) -> tuple[Any, ...]:
    before, after = rebound.incoming, rebound.outgoing
    return (
        *(rebound.tray, rebound.cycle, (rebound.stamp_ns - epoch_ns) / NS, 'rebound'),
        *(rebound.track, None, WALL_NAMES[rebound.wall]),
        *(before.value, before.error, after.value, after.error, _ratio(after.value, before.value)),
        *rebound.place.tolist(),
    )


def _collision_row(pair: PairCollision, epoch_ns: int) -> tuple[Any, ...]:
    before, after = pair.normal_speeds
    before_error, after_error = (
        float(np.hypot(*errors)) for errors in (pair.before_errors, pair.after_errors)
    )
    first, second = pair.tracks.tolist()
    return (
        *(pair.tray, pair.cycle, (pair.stamp_ns - epoch_ns) / NS, 'collision'),
        *(first, second, None),
        *(before, before_error, after, after_error, _ratio(after, before)),
        *pair.place.tolist(),
    )


def _ratio(after: float, before: float) -> float:
    return after / before if before > 0.0 else float('nan')
