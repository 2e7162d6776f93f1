"""Collisions of beads with each other, from how fast they lose their velocity.

Single collisions cannot be counted without a threshold: slight deflections are lost in the noise
of positions, and two collisions within a few frames look like one. So they are not counted. A
bead that collides within a window moves less far than its velocity would take it; in a window t

    <(x(t) - x(0))^2> = <v^2> t^2 f(r t),   f(s) = 2 (exp(-s) - 1 + s) / s^2,

with r the rate at which collisions take the velocity. The ratio of the squares in whole and half
windows gives r, over all beads far enough from the side walls. Kinetic theory says how large r is
per collision (`ConfinedGas.velocity_relaxation`); it does not depend on the density. All rates are
proportional to the speed: what is measured is a number of collisions per length of path.

The number of collisions assumes that velocities are independent before a collision, and that the
motion along z, which is not seen, is what theory says. Both fail in few beads of low restitution:
see `_MODEL_ERROR`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import optimize

from nanorocks_ros.records import Measured
from nanorocks_ros.studies.gas_statistics.jackknife import jackknife
from nanorocks_ros.studies.gas_statistics.velocity_samples import N_BLOCKS, SPEED, XX, YY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.physics.confined_theory import ConfinedGas
    from nanorocks_ros.studies.gas_statistics.displacement_windows import CycleTracks
    from nanorocks_ros.studies.gas_statistics.velocity_samples import VelocitySamples

# Expected collisions in half of a window.
_COLLISIONS = 0.25
_MOST_FRAMES = 60
# A bead stays off the walls if it is farther than this many thermal speeds fly in half a window.
_MARGIN = 3.0
_LEAST_BEADS = 10
# Largest relaxation that is looked for, over the expected one.
_MOST_TIMES = 20.0
# Relative error of the form of f.
_FORM_ERROR = 0.02
# Relative error of theory's collisions per lost velocity, over 1 - restitution: at 0.7 runs of a
# tray scatter by more than their blocks do.
_MODEL_ERROR = 0.5


class TheoryRates(NamedTuple):
    """Of one species, per length of its mean projected path.

    Parameters
    ----------
    collisions : float, [1/m]
        With other beads.
    relaxation : float, [1/m]
        By which its projected velocity falls.
    wall_hits : float, [1/m]
        With the four side walls.
    speed_ratio : float
        Mean speed in space over the projected one.
    relative_error : float
        Of the collisions per lost velocity.
    """

    collisions: float
    relaxation: float
    wall_hits: float
    speed_ratio: float
    relative_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionRate:
    """Collisions of the beads of one species with other beads.

    Parameters
    ----------
    per_path : Measured, [1/m]
        Collisions over the mean projected path; times the mean projected speed it is the rate.
    theory_per_path : float, [1/m]
        The same by kinetic theory between walls; NaN where that does not hold.
    relaxation : Measured, [1/m]
        Rate at which the velocity is lost, per length of path: measured without any theory.
    mean_free_path : Measured, [m]
        Path in space between two collisions with beads.
    theory_mean_free_path : float, [m]
    """

    per_path: Measured
    theory_per_path: float
    relaxation: Measured
    mean_free_path: Measured
    theory_mean_free_path: float


def theory_rates(
    gas: ConfinedGas, restitution: float, wall_restitution: float
) -> tuple[TheoryRates, ...]:
    """Rates of each species in a gas that cools steadily.

    Parameters
    ----------
    gas : ConfinedGas
    restitution, wall_restitution : float, [0, 1]

    Raises
    ------
    ConfigurationError, FitError
        As `ConfinedGas.cooling`.
    """
    temperature = gas.cooling(restitution, wall_restitution).granular_temperature
    pairs, walls = gas.collision_rates(temperature)
    collisions, sides = pairs.sum(axis=1), walls[:, :2].sum(axis=1)
    relaxation = gas.velocity_relaxation(temperature, restitution)[:, :2]
    squares, counts, species = temperature[:, :2], gas.beads.counts, gas.beads.species
    speeds = gas.species_speeds(temperature)
    rates = []
    for index, speed in enumerate(speeds.tolist()):
        own = species == index
        weights = counts[own, np.newaxis] * squares[own]
        in_space = counts[own] @ _mean_speeds(temperature[own]) / counts[own].sum()
        rates.append(
            TheoryRates(
                collisions=float(counts[own] @ collisions[own] / counts[own].sum()) / speed,
                relaxation=float((weights * relaxation[own]).sum() / weights.sum()) / speed,
                wall_hits=float(counts[own] @ sides[own] / counts[own].sum()) / speed,
                speed_ratio=float(in_space) / speed,
                relative_error=_MODEL_ERROR * (1.0 - restitution),
            )
        )
    return tuple(rates)


def collision_rate(
    cycles: Sequence[CycleTracks],
    samples: VelocitySamples,
    tray: Tray,
    species: int,
    theory: TheoryRates,
) -> CollisionRate | None:
    """How often the beads of a species collide with others; None where it cannot be told.

    Parameters
    ----------
    cycles : sequence of CycleTracks
    samples : VelocitySamples
        Of the same cycles.
    tray : Tray
    species : int
    theory : TheoryRates
    """
    rows = [
        row
        for place, cycle in enumerate(cycles)
        for row in _window_squares(cycle, samples, tray, species, theory.collisions, place)
    ]
    if not rows:
        return None
    table = np.array(rows)
    n_blocks = int(table[:, 0].max()) + 1
    groups = [table[table[:, 0] == block, 1:] for block in range(n_blocks)]
    used = [group for group in groups if group.size]
    # The jackknife leaves out blocks by their number: rows of each are kept, not summed.
    present = np.eye(len(used))
    value, error = jackknife(
        present,
        lambda kept: _relaxation(
            np.concatenate([used[k] for k in np.flatnonzero(kept)]), theory.relaxation
        ),
    )
    relaxation = Measured(float(value), math.hypot(float(error), _FORM_ERROR * float(value)))
    factor = theory.collisions / theory.relaxation
    collisions = factor * relaxation.value
    model_error = theory.relative_error * collisions
    per_path = Measured(collisions, math.hypot(factor * relaxation.error, model_error))
    free = theory.speed_ratio / collisions if collisions > 0.0 else math.inf
    return CollisionRate(
        per_path=per_path,
        theory_per_path=theory.collisions,
        relaxation=relaxation,
        mean_free_path=Measured(free, free * free * per_path.error / theory.speed_ratio),
        theory_mean_free_path=theory.speed_ratio / theory.collisions,
    )


def _window_squares(
    cycle: CycleTracks,
    samples: VelocitySamples,
    tray: Tray,
    species: int,
    collisions: float,
    place: int,
) -> list[tuple[float, ...]]:
    """Of each second: block, path of half a window, scaled squares over half and whole windows."""
    rows: list[tuple[float, ...]] = []
    radius = 0.5 * tray.species[species].diameter
    room = np.array(tray.dimensions[:2])
    for chunk in cycle.chunks():
        times = cycle.times[chunk]
        inside = (samples.cycle == cycle.number) & np.isfinite(samples.moments[:, species, XX])
        inside &= (samples.time >= times[0]) & (samples.time <= times[-1])
        if not inside.any() or times.size < 2:
            continue
        moments = samples.moments[inside, species].mean(axis=0)
        interval = float(np.median(np.diff(times)))
        lag = round(_COLLISIONS / (collisions * moments[SPEED] * interval))
        lag = min(max(lag, 1), _MOST_FRAMES)
        variance = float(cycle.noise(chunk, len(tray.species))[species])
        square = moments[XX] + moments[YY]
        margin = radius + _MARGIN * math.sqrt(0.5 * square) * lag * interval
        sums = np.zeros(3)
        for frame in range(chunk.start, chunk.stop):
            window = cycle.window(frame, lag)
            if window is None:
                continue
            free = ((window.places > margin) & (window.places < room - margin)).all(axis=1)
            steps = window.steps[:, free & (window.species == species)]
            whole = steps.sum(axis=0)
            sums += steps.shape[1], 0.5 * (steps**2).sum(), (whole**2).sum()
        if sums[0] >= _LEAST_BEADS and square > 0.0 and math.isfinite(variance):
            # Faster beads collide more often: weighted by the path, collisions count alike.
            scale = square * (lag * interval) ** 2 / moments[SPEED]
            half, both = sums[1:] - 4.0 * variance * sums[0]
            block = place * N_BLOCKS + samples.block[inside][0] % N_BLOCKS
            rows.append(
                (block, moments[SPEED] * lag * interval, half / scale, 0.25 * both / scale)
            )
    return rows


def _relaxation(rows: NDArray[np.float64], expected: float) -> float:
    """The rate per path at which whole windows are as much shorter than half ones as measured."""
    paths, halves, wholes = rows.T

    def excess(rate: float) -> float:
        return float((wholes - halves * _form(2.0 * rate * paths) / _form(rate * paths)).sum())

    low, high = 1e-6 * expected, _MOST_TIMES * expected
    if excess(low) >= 0.0:
        return 0.0
    if excess(high) <= 0.0:
        return high
    return float(optimize.brentq(excess, low, high))


def _form(relaxed: NDArray[np.float64]) -> NDArray[np.float64]:
    form: NDArray[np.float64] = 2.0 * (np.expm1(-relaxed) + relaxed) / relaxed**2
    return form


def _mean_speeds(temperature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean speed in space of normal velocities with different variances, (n,), [m/s]."""
    nodes, weights = np.polynomial.legendre.leggauss(32)
    heights, angles = np.meshgrid(0.5 * (nodes + 1.0), 0.25 * math.pi * (nodes + 1.0))
    rings = np.sqrt(1.0 - heights**2)
    directions = np.stack((rings * np.cos(angles), rings * np.sin(angles), heights), axis=-1)
    # The mean of |v| over Gaussians is an integral over directions of the form 1/(n T^-1 n)^2.
    inverse = (directions**2) @ (1.0 / temperature.T)
    density = (np.outer(weights, weights)[..., np.newaxis] / inverse**2).sum(axis=(0, 1)) * 0.25
    volume = np.sqrt(temperature.prod(axis=1))
    means: NDArray[np.float64] = math.sqrt(8.0 / math.pi) * density / volume
    return means
