"""Rebounds as they are read from films: by cameras that read row by row, off walls that swing.

*Rolling shutter.* A row at the place y is read at the time t + k y, so that a bead with the
velocity v along the readout seems to move with v / (1 - k v): too fast with it, too slow against
it. A rebound from one wall seems to lose less, one from the opposite wall more, the more the
faster the bead. Rebounds from opposite walls tell k.

*Walls that swing.* What registers the walls makes small motions too small or too large, since
codecs keep what hardly changes: by up to a tenth (`SWING_ERROR`). Beads that meet a wall move less
against it then, and leave it faster. Most walls come towards the bead that they hit, so that this
is no scatter: it goes by the velocity of the wall, which tells it.

Where rebounds do not tell these, nothing is known of them, and contacts count as they are seen.

Tested by ``test/inference/contacts/test_rebound_reading.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Measured, Rebound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

SWING_ERROR = 0.08
"""Relative error of the velocity of a wall: small displacements were registered up to a tenth too
small or too large."""

# Student's distribution of what rebounds are off by: some are something else.
_FREEDOM, _TURNS = 4.0, 12
_MEDIAN_ABSOLUTE = 0.6745
# Fewer rebounds say nothing; nor do those that leave this part of a prior and more.
_FEWEST, _UNTOLD = 5, 0.5
_NONE = Measured(0.0, 0.0)
# Walls, and how differently they may throw beads back where they need not be alike.
_WALLS, _SPREAD_OF_WALLS = 4, 0.1
# Standard deviation of logarithms, and the least error of one.
_SPREAD_OF_LOGS, _LEAST_ERROR = 3.0, 1e-5
# Time in which a camera reads that reads all at once, [s].
_AT_ONCE = 1e-9
# Walls along rows have numbers from here on. Speeds grow at most by the inverse of this.
_FIRST_ALONG_ROWS, _LEAST = 2, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class ReboundReading:
    """How late rows, and columns, of a picture are read, and how far walls move.

    Parameters
    ----------
    along_columns, along_rows : Measured, [s/m]
        Delay of what lies farther along each side of the tray.
    swing : Measured
        Part by which walls move faster than they are registered.
    error : float
        Standard deviation of the restitution of the walls by what is not known of that.
    """

    along_columns: Measured = _NONE
    along_rows: Measured = _NONE
    swing: Measured = _NONE
    error: float = 0.0

    def read(self, rebound: Rebound) -> Rebound:
        """The rebound that a camera sees which reads all at once, and knows how walls move."""
        faster = self.swing.value * rebound.wall_velocity.value
        if faster:
            incoming, outgoing = rebound.incoming, rebound.outgoing
            rebound = replace(
                rebound,
                incoming=Measured(incoming.value - faster, incoming.error),
                outgoing=Measured(outgoing.value + faster, outgoing.error),
            )
        delay = self.along_columns if rebound.wall < _FIRST_ALONG_ROWS else self.along_rows
        if delay == _NONE:
            return rebound
        outward = delay.value if rebound.wall % 2 else -delay.value
        incoming, outgoing = rebound.incoming, rebound.outgoing
        before = 1.0 / max(1.0 + outward * incoming.value, _LEAST)
        after = 1.0 / max(1.0 - outward * outgoing.value, _LEAST)
        unknown = outgoing.value * delay.error * (incoming.value + outgoing.value)
        return replace(
            rebound,
            incoming=Measured(before * incoming.value, before * incoming.error),
            outgoing=Measured(after * outgoing.value, math.hypot(after * outgoing.error, unknown)),
        )


AS_SEEN = ReboundReading()
"""Of a camera that reads all at once, and walls that rest or are registered as they move."""


def rebound_reading(
    rebounds: Sequence[Rebound],
    sides: tuple[float, float],
    readout: float,
    *,
    walls_alike: bool = True,
) -> ReboundReading:
    """What rebounds of free beads tell of how they are read.

    Logarithms of the ratio of both speeds are compared, by least squares with weights that make
    far ones count less; they may depend on speed, alike at opposite walls.

    Parameters
    ----------
    rebounds : sequence of Rebound
    sides : tuple of 2 floats, [m]
        Of the tray, along columns and rows.
    readout : float, [s]
        Standard deviation of the time in which a side is read, before rebounds tell; 0: at once.
    walls_alike : bool
        Whether all walls have one restitution; else only slow and fast rebounds are compared.
    """
    free = [each for each in rebounds if each.beads == 1 and each.incoming.value > 0.0]
    if len(free) < _FEWEST:
        return AS_SEEN
    prior = np.array([*(max(readout, _AT_ONCE) / np.array(sides)), SWING_ERROR])
    ratios, errors, shape = _ratios(free)
    of_walls = [_SPREAD_OF_WALLS**-2.0] * _WALLS
    if walls_alike:
        shape, of_walls = shape[:, :-_WALLS], []
    # Wide enough to say nothing, also where all rebounds are equally fast.
    of_law = [_SPREAD_OF_LOGS**-2.0, float(np.median(shape[:, 4])) ** 2 / _SPREAD_OF_LOGS**2]
    precision = np.diag([*prior**-2.0, *of_law, *of_walls])
    weights = errors**-2.0
    for _ in range(_TURNS):
        normal = shape.T @ (weights[:, np.newaxis] * shape) + precision
        solution = np.linalg.solve(normal, shape.T @ (weights * ratios))
        off = np.abs(ratios - shape @ solution) / errors
        scale = max(float(np.median(off)) / _MEDIAN_ABSOLUTE, 1.0)
        weights = (_FREEDOM + 1.0) / (_FREEDOM + (off / scale) ** 2) / (scale * errors) ** 2
    spread = np.sqrt(np.diag(np.linalg.inv(normal)))[: len(prior)]
    along_columns, along_rows, swing = (
        Measured(value, error) if error < _UNTOLD * before else _NONE
        for value, error, before in zip(
            solution[: len(prior)].tolist(), spread.tolist(), prior.tolist(), strict=True
        )
    )
    # How far all restitutions together follow the swing.
    mean_ratio, follows = (weights / weights.sum()) @ np.column_stack([ratios, shape[:, 2]])
    return ReboundReading(
        along_columns=along_columns,
        along_rows=along_rows,
        swing=swing,
        error=float(math.exp(mean_ratio) * abs(follows) * spread[2]),
    )


def _ratios(
    rebounds: Sequence[Rebound],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Logarithm of speed after over before, (n,), its error, and what it is a sum of, (n, 9)."""
    incoming = np.array([(each.incoming.value, each.incoming.error) for each in rebounds])
    outgoing = np.array([(each.outgoing.value, each.outgoing.error) for each in rebounds])
    walls = np.array([each.wall for each in rebounds])
    wall = np.array([(each.wall_velocity.value, each.wall_velocity.error) for each in rebounds])
    before, after = incoming[:, 0], np.maximum(outgoing[:, 0], 1e-3 * incoming[:, 0])
    inverse = 1.0 / before + 1.0 / after
    # Without what all have in common.
    own = np.maximum(wall[:, 1] ** 2 - (SWING_ERROR * wall[:, 0]) ** 2, 0.0)
    errors = np.sqrt(
        (incoming[:, 1] / before) ** 2 + (outgoing[:, 1] / after) ** 2 + own * inverse**2
    )
    both, along_columns = before + after, walls < _FIRST_ALONG_ROWS
    delayed = np.where(walls % 2, -both, both)
    # A restitution that depends on speed does so alike at opposite walls.
    shape = np.column_stack(
        [
            along_columns * delayed,
            ~along_columns * delayed,
            -wall[:, 0] * inverse,
            np.ones(len(walls)),
            both,
            walls[:, np.newaxis] == np.arange(_WALLS),
        ]
    )
    return np.log(after / before), np.maximum(errors, _LEAST_ERROR), shape
