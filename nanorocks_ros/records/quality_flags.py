"""Enumerations of methods, states and quality flags, and helpers for all records.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import fields
from enum import IntEnum, IntFlag
from functools import cache
from typing import Any

import numpy as np

UNKNOWN = float('nan')


class SpeedMethod(IntEnum):
    """How a mean projected speed was measured (the constants of ``SpeedEstimate.msg``)."""

    STRUCTURE_FUNCTION = 1
    BINARISED_AREA = 2
    TRACKING = 3


class CorStatus(IntEnum):
    """State of the fit of a cycle (the constants of ``CorEstimate.msg``)."""

    COOLING = 1
    FINAL = 2
    NO_DECAY = 3
    UNDETERMINED = 4


class CorRelation(IntEnum):
    """Relation by which a decay gave a restitution (constants of ``CorEstimate.msg``)."""

    PAPER = 1
    LIBRARY = 2


class SizeStatus(IntEnum):
    """State of a cluster size from an autocorrelation (constants of ``ClusterEstimate.msg``)."""

    MEASURED = 1
    BEYOND = 2
    NOTHING = 3
    INSENSITIVE = 4
    UNCALIBRATED = 5
    CONTRADICTED = 6


class StickingStatus(IntEnum):
    """State of a sticking speed (constants of ``ClusterEstimate.msg``).

    The message gives each its name with ``STICKING_`` before it.
    """

    UNKNOWN = 0
    MEASURED = 1
    NO_MERGE = 2
    STUCK_FROM_THE_START = 3
    NO_UPPER_LIMIT = 4


class Quality(IntFlag):
    """Defects of the tray images since the last estimate, or of a speed from them.

    0 when nothing is; docs/reference/flags.md says what each flag means.
    """

    SATURATED = 1
    LOW_CONTRAST = 2
    FEW_BEADS = 4
    GLARE = 8
    STABILISATION_LOST = 16
    GRAY_CAMERA = 32
    FROZEN = 64
    HALF_FRAME = 128
    WRONG_SCALE = 256
    UNCERTAIN = 512
    UNCALIBRATED = 1024
    INCONSISTENT = 2048
    DOUBTFUL_SCALE = 4096
    ACCELERATED = 8192
    SPEED_DEPENDENT = 16384
    STICKING = 32768
    SKIPPED_FRAMES = 65536
    FRICTION_UNKNOWN = 131072

    def names(self) -> list[str]:
        """Names of the flags that are set, in lower case."""
        return [flag.name.lower() for flag in type(self) if flag in self and flag.name]


NOTHING_WRONG = Quality(0)


@cache
def field_names(kind: Any) -> tuple[str, ...]:
    """Names of the fields of a kind of records."""
    return tuple(field.name for field in fields(kind))


@cache
def _array_names(kind: Any) -> tuple[str, ...]:
    """Names of the fields of a kind of records that may hold arrays, by their annotations."""
    return tuple(field.name for field in fields(kind) if 'NDArray' in str(field.type))


def freeze_arrays(record: Any) -> None:
    """Make the arrays of a record read-only."""
    for name in _array_names(record.__class__):
        value = getattr(record, name)
        if isinstance(value, np.ndarray) and value.flags.writeable:
            view = value.view()
            view.flags.writeable = False
            object.__setattr__(record, name, view)
