"""Contacts of beads as one DataFrame: collisions of two beads and rebounds from walls.

Tested by ``test/interface/test_measuring.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from nanorocks_ros.records import NS, PairCollision, Rebound
from nanorocks_ros.studies.measure.track_contacts import WALL_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

_UNITS = {
    'tray': '1',
    'cycle': '1',
    'time': 's',
    'kind': '1',
    'bead': '1',
    'partner': '1',
    'wall': '1',
    'speed_before': 'm/s',
    'speed_before_error': 'm/s',
    'speed_after': 'm/s',
    'speed_after_error': 'm/s',
    'speed_ratio': '1',
    'x': 'm',
    'y': 'm',
}
"""Columns of the frame and their units.

Speeds are along the normal: of a rebound to and from the wall, of a collision along the line of
centres in the picture, at which beads at different heights meet at an angle. `speed_ratio` is
after over before; of a rebound it is the restitution of this contact, of collisions it scatters.
"""


def contact_frame(contacts: Sequence[Rebound | PairCollision], epoch_ns: int) -> pd.DataFrame:
    """A row for each contact, in order of time.

    Parameters
    ----------
    contacts : sequence of Rebound or PairCollision
    epoch_ns : int, [ns]

    Returns
    -------
    DataFrame
        `bead` and `partner` are numbers of tracks, `partner` is missing where a bead meets a
        `wall` and the other way round.
    """
    ordered = sorted(contacts, key=lambda contact: contact.stamp_ns)
    rows = [
        _rebound_row(contact, epoch_ns)
        if isinstance(contact, Rebound)
        else _collision_row(contact, epoch_ns)
        for contact in ordered
    ]
    frame = pd.DataFrame(rows, columns=list(_UNITS))
    frame['partner'] = frame['partner'].astype('Int64')
    frame.attrs['units'] = dict(_UNITS)
    return frame


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
