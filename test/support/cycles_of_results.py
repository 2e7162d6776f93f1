"""The results of the sample bag as several cycles."""

from __future__ import annotations

from dataclasses import replace

from nanorocks_ros.records import NS

PERIOD_NS = 60 * NS


def shifted(record, cycle):
    """The record, as if it were of a later cycle."""
    more = (cycle - 1) * PERIOD_NS
    changes = {'stamp_ns': record.stamp_ns + more, 'cycle': cycle}
    if getattr(record, 'cycle_start_ns', None) is not None:
        changes['cycle_start_ns'] = record.cycle_start_ns + more
    return replace(record, **changes)


def told(results, cycles):
    """All records of some cycles; the first cycle of the bag stands for each."""
    records = [record for record in results.all if record.cycle == 1]
    return [shifted(record, cycle) for cycle in cycles for record in records]
