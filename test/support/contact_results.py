"""Results of an analysis, with contacts that were drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from contact_draws import drawn_impact, drawn_rebound

from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.records import (
    NS,
    CorEstimate,
    CorRelation,
    CorStatus,
    Interval,
)
from nanorocks_ros.wire.array_layouts import field_value, layout

SHAKEN, FIRST, LAST = 10.0, 1.75, 21.75


def write_table(path, records):
    """A table as `nanorocks analyse` writes it."""
    fields = layout(type(records[0])).fields
    names, units = zip(*((field.name, field.unit) for field in fields), strict=True)
    rows = [[field_value(record, field, 0) for field in fields] for record in records]
    write_csv(path, float_columns(names, units), rows)


def contact_results(folder, law, *, contacts=150, seed=1, tray=1, late=0):
    """One cycle with rebounds and collisions by a law, and some later than its window."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    stamps = SHAKEN + rng.uniform(FIRST, LAST, contacts + late)
    stamps[contacts:] = SHAKEN + LAST + 1.0
    speeds = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2), contacts + late))
    rebounds, collisions = [], []
    for stamp, speed in zip(stamps, speeds, strict=True):
        named = {'stamp_ns': round(stamp * NS), 'tray': tray, 'cycle': 1}
        noise = rng.normal(0.0, 0.02 * speed, 2)
        rebound = drawn_rebound(speed + noise[0], law(speed) * speed + noise[1], 0.02 * speed)
        rebounds.append(replace(rebound, **named))
        collisions.append(replace(drawn_impact(rng, law, spread=speed / 4.0)[0], **named))
    final = CorEstimate(
        stamp_ns=round((SHAKEN + LAST) * NS),
        tray=tray,
        cycle=1,
        status=CorStatus.FINAL,
        relation=CorRelation.LIBRARY,
        restitution=Interval(0.8, 0.7, 0.9),
        window_start=FIRST,
        window_end=LAST,
    )
    for name, records in (('rebound', rebounds), ('collision', collisions), ('cor', [final])):
        write_table(folder / f'tray_{tray}_{name}.csv', records)
    return folder
