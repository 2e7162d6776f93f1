"""How often beads hit the side walls, from where their paths turn back.

Unlike rebounds whose restitution is measured, which need a long flight before and after, every hit
counts: a bead that turns back nearer to a wall than it moves between two frames. Beads that others
turn back so near to a wall count as well, and hits with a collision at once do not: hits in
simulated gases are read 3 % low.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.records import Measured
from nanorocks_ros.studies.gas_statistics.jackknife import jackknife
from nanorocks_ros.studies.gas_statistics.velocity_samples import SPEED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.gas_statistics.displacement_windows import CycleTracks
    from nanorocks_ros.studies.gas_statistics.velocity_samples import VelocitySamples

# A bead has turned when it came back by this share of its radius: more than noise.
_BACK = 0.06
# Errors of places, in radii.
_PLACE = 0.05
# Relative error: turns near a wall without a hit, hits while a bead was hidden.
_COUNT_ERROR = 0.04
_LEAST_HITS = 10


class WallRate(NamedTuple):
    """Hits of the side walls over the mean projected path of a bead, [1/m], and those of theory.

    Times the mean projected speed it is the rate of one bead.
    """

    per_path: Measured
    theory_per_path: float


def wall_rate(
    cycles: Sequence[CycleTracks],
    samples: VelocitySamples,
    tray: Tray,
    species: int,
    theory: float,
) -> WallRate | None:
    """How often the beads of a species hit the side walls; None where too few hits are seen.

    Parameters
    ----------
    cycles : sequence of CycleTracks
    samples : VelocitySamples
        Of the same cycles.
    tray : Tray
    species : int
    theory : float, [1/m]
    """
    rows = [row for cycle in cycles for row in _seconds(cycle, samples, tray, species)]
    table = np.array(rows).reshape(-1, 3)
    if table[:, 2].sum() < _LEAST_HITS:
        return None
    blocks = np.unique(table[:, 0])
    sums = np.array([table[table[:, 0] == block, 1:].sum(axis=0) for block in blocks])
    value, error = jackknife(sums, lambda total: total[1] / total[0])
    rate = float(value)
    return WallRate(Measured(rate, math.hypot(float(error), _COUNT_ERROR * rate)), theory)


def _seconds(
    cycle: CycleTracks, samples: VelocitySamples, tray: Tray, species: int
) -> list[tuple[float, float, float]]:
    """Of each second: block, path of all beads that are seen, [m], hits of side walls."""
    places = _paths(cycle, species)
    kind = tray.species[species]
    radius = 0.5 * kind.diameter
    hits = np.zeros(len(cycle.records))
    nearest = 0.5 * kind.diameter_high + _PLACE * radius
    _count_hits(places, np.array(tray.dimensions[:2]), (nearest, _BACK * radius), hits)
    seen = np.isfinite(places[:, :, 0]).sum(axis=1)
    rows = []
    for chunk in cycle.chunks():
        times = cycle.times[chunk]
        inside = (samples.cycle == cycle.number) & np.isfinite(samples.moments[:, species, SPEED])
        inside &= (samples.time >= times[0]) & (samples.time <= times[-1])
        if not inside.any() or times.size < 2:
            continue
        speed = float(samples.moments[inside, species, SPEED].mean())
        interval = float(np.median(np.diff(times)))
        path = speed * interval * float(seen[chunk].sum())
        rows.append((float(samples.block[inside][0]), path, float(hits[chunk].sum())))
    return rows


def _paths(cycle: CycleTracks, species: int) -> NDArray[np.float64]:
    """Places of the beads in each frame, (n_frames, n_beads, 2), [m]; NaN where not seen."""
    numbers = np.unique(
        np.concatenate([beads.ids[beads.species == species] for beads in cycle.beads])
    )
    places = np.full((len(cycle.beads), numbers.size, 2), np.nan)
    for frame, beads in enumerate(cycle.beads):
        own = beads.species == species
        places[frame, np.searchsorted(numbers, beads.ids[own])] = beads.places[own]
    return places


@compiled
def _count_hits(
    places: NDArray[np.float64],
    sides: NDArray[np.float64],
    limits: tuple[float, float],
    hits: NDArray[np.float64],
) -> None:
    """Add the hits of side walls to those of the frame in which a bead turned back.

    `limits`: farthest centre from a wall in a hit seen at once, and way back after a turn, [m].
    """
    nearest, back = limits
    frames, beads = places.shape[0], places.shape[1]
    for bead in range(beads):
        for axis in range(2):
            direction, outermost, reach = 0.0, 0.0, 0.0
            last, turned = math.nan, 0
            for frame in range(frames):
                place = places[frame, bead, axis]
                if math.isnan(place) or math.isnan(last):
                    # A bead that was hidden may have turned meanwhile.
                    direction, last = 0.0, place
                    continue
                step = place - last
                last = place
                if direction == 0.0:
                    direction = 1.0 if step > 0.0 else -1.0
                    outermost, reach, turned = place, abs(step), frame
                elif direction * (place - outermost) > 0.0:
                    outermost, reach, turned = place, abs(step), frame
                elif direction * (outermost - place) > back:
                    gap = sides[axis] - outermost if direction > 0.0 else outermost
                    if gap < max(reach, abs(step)) + nearest:
                        hits[turned] += 1.0
                    direction = -direction
                    outermost, reach, turned = place, abs(step), frame
