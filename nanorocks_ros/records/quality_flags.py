"""Words that records use for methods, states and doubts; what all records share."""

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
    """Where the fit of a cycle stands (the constants of ``CorEstimate.msg``)."""

    COOLING = 1
    FINAL = 2
    NO_DECAY = 3
    UNDETERMINED = 4


class CorRelation(IntEnum):
    """Which relation turned a decay into a restitution (constants of ``CorEstimate.msg``)."""

    PAPER = 1
    LIBRARY = 2


class SizeStatus(IntEnum):
    """What an autocorrelation says of the cluster size (constants of ``ClusterEstimate.msg``)."""

    MEASURED = 1
    BEYOND = 2
    NOTHING = 3
    INSENSITIVE = 4
    UNCALIBRATED = 5


class StickingStatus(IntEnum):
    """What is known of a sticking speed (constants of ``ClusterEstimate.msg``).

    The message gives each its name with ``STICKING_`` before it.
    """

    UNKNOWN = 0
    MEASURED = 1
    NO_MERGE = 2
    STUCK_FROM_THE_START = 3
    NO_UPPER_LIMIT = 4


class Quality(IntFlag):
    """What is wrong with the picture of a tray since the last one, or with a speed from it.

    0 when nothing is; docs/method/speed.md says what each flag means.
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

    def names(self) -> list[str]:
        """The flags that are set, in small letters."""
        return [flag.name.lower() for flag in type(self) if flag in self and flag.name]


NOTHING_WRONG = Quality(0)


@cache
def field_names(kind: Any) -> tuple[str, ...]:
    """Names of the fields of a kind of records."""
    return tuple(field.name for field in fields(kind))


def freeze_arrays(record: Any) -> None:
    """Make the arrays of a record read-only."""
    for name in field_names(record.__class__):
        value = getattr(record, name)
        if isinstance(value, np.ndarray) and value.flags.writeable:
            view = value.view()
            view.flags.writeable = False
            object.__setattr__(record, name, view)
