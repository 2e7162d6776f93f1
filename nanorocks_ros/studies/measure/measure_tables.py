"""Tables of a measured film: speeds, contacts and restitutions of a tray.

Lengths are in m, or in px of the film where no length is told.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.pipeline.contact_words import restitutions
from nanorocks_ros.studies.measure.track_speeds import SPEED_COLUMNS
from nanorocks_ros.studies.results.contact_columns import CONTACT_COLUMNS, contact_arrays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.measure.measured_tray import MeasuredTray

MEAN_SPEEDS, CONTACTS, RESTITUTIONS = 'mean_speeds', 'contacts', 'restitutions'
"""Names of the tables: ``tray_K_NAME.csv``."""

RESTITUTION_COLUMNS = (
    Column(name='tray', kind='int64', unit='1', doc='number of the tray'),
    Column(name='partner', kind='string', doc='beads, walls (all of them), or one wall'),
    Column(name='contacts', kind='int64', unit='1', doc='number of contacts'),
    Column(name='restitution', unit='1', doc='by these contacts alone'),
    Column(name='restitution_error', unit='1', doc='one standard error'),
    Column(name='restitution_lower', unit='1', doc='lower end of the interval'),
    Column(name='restitution_upper', unit='1', doc='upper end of the interval'),
    Column(name='restitution_lower_68', unit='1', doc='lower end of an interval of 68 %'),
    Column(name='restitution_upper_68', unit='1', doc='upper end of that interval'),
    Column(name='speed', unit='m/s', doc='median along the normal, before the contacts'),
)

# Metres at the start of a unit, with a power.
_METRES = re.compile(r'^m(?:\^(\d))?(?=$|/)')


class Table(NamedTuple):
    """Columns, and their values by name."""

    columns: tuple[Column, ...]
    values: dict[str, NDArray[Any]]


def tray_tables(tray: MeasuredTray, tracked: TrackedBag) -> dict[str, Table]:
    """The tables of a tray by name.

    Parameters
    ----------
    tray : MeasuredTray
    tracked : TrackedBag
        Tracks of the film; places of contacts count from the same corner.
    """
    tables = {
        MEAN_SPEEDS: _speeds(tray),
        CONTACTS: _contacts(tray, tracked),
        RESTITUTIONS: _cor(tray),
    }
    if tray.unit.name != 'px':
        return tables
    return {name: in_px(table, tray.unit.per_metre) for name, table in tables.items()}


def in_px(table: Table, per_metre: float) -> Table:
    """The table with lengths in px of the film, in columns that are called ``X_px``."""
    columns, values = [], dict(table.values)
    for column in table.columns:
        power = _METRES.match(column.unit)
        if power is None:
            columns.append(column)
            continue
        name = f'{column.name}_px'
        columns.append(replace(column, name=name, unit=f'px{column.unit[1:]}'))
        values[name] = values.pop(column.name) * per_metre ** int(power[1] or 1)
    return Table(tuple(columns), values)


def _speeds(tray: MeasuredTray) -> Table:
    numbers = np.full(tray.speeds.time.size, tray.number)
    values = dict(zip(('time', 'mean_speed', 'rms_speed', 'beads'), tray.speeds, strict=True))
    return Table(SPEED_COLUMNS, {'tray': numbers, **values})


def _contacts(tray: MeasuredTray, tracked: TrackedBag) -> Table:
    x, y = tray.contacts.corner
    region = tracked.regions.get(tray.number)
    if tray.unit.name == 'px' and region is not None:
        # As of the tracks: places in the film.
        x, y = x + region.x / tray.unit.per_metre, y + region.y / tray.unit.per_metre
    arrays = contact_arrays(tray.contacts.contacts, tracked.epoch_ns, (x, y))
    return Table(CONTACT_COLUMNS, arrays)


def _cor(tray: MeasuredTray) -> Table:
    own = restitutions(tray.contacts)
    intervals = [value.restitution for value in own.values()]
    values: dict[str, list[Any]] = {
        'tray': [tray.number for _ in own],
        'partner': [*own],
        'contacts': [value.contacts for value in own.values()],
        'restitution': [interval.value for interval in intervals],
        'restitution_error': [interval.error for interval in intervals],
        'restitution_lower': [interval.lower for interval in intervals],
        'restitution_upper': [interval.upper for interval in intervals],
        'restitution_lower_68': [value.lower_68 for value in own.values()],
        'restitution_upper_68': [value.upper_68 for value in own.values()],
        'speed': [value.speed for value in own.values()],
    }
    return Table(RESTITUTION_COLUMNS, {name: np.array(column) for name, column in values.items()})
