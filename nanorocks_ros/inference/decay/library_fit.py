"""Fit of a decay library: smooth functions through simulated decays.

Tested by ``test/inference/decay/test_decay_library.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.decay_library import (
    LOWEST_FLOOR_LID,
    LOWEST_WALL,
    NUISANCES,
    DecayLibrary,
    design_of,
    rough_design,
    term_count,
    tray_key,
)
from nanorocks_ros.inference.decay.friction_terms import (
    FRICTION,
    HIGHEST_FRICTION,
    friction_term_count,
    friction_terms,
    rubbing_rate,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

FIRST_DISTANCE, LAST_DISTANCE, N_DISTANCES = 0.003, 1.0, 60
# Grid of the covariance, and the fraction of the ranges it is averaged over.
_COVARIANCE_RESTITUTION = np.array([1.0, 0.94, 0.84, 0.65, 0.4, 0.0])
_COVARIANCE_WALL = np.array([0.60, 0.80, 0.90, 0.95, 0.99])
_REACH = 0.12
# Smallest error of a node, over the median: runs of a node may agree by chance.
_LEAST_ERROR = 1.0 / 3.0
_ZERO = 1e-9
# Nodes are even in this root of the loss of the walls.
_WALL_POWER = 2.0
# Beads that rub along elastic floors and lids come to rest while they bounce. Nobody sees speeds
# below a thousandth of the first, and those below 1/150 hardly count.
_UNSEEN, _FAINT, _FAINT_WEIGHT = -7.0, -5.0, 0.2
# Smallest error of a rough node in ln f.
_LEAST_ROUGH_ERROR = 0.01
# Floors and lids above this are left out of the misfit with friction.
_ELASTIC = 0.985


@dataclass(frozen=True, slots=True, kw_only=True)
class Decays:
    """Runs at many nodes in the space of restitutions and nuisances.

    Parameters
    ----------
    restitution, wall_restitution, floor_lid_restitution : ndarray (n,)
    nuisances : ndarray (n, 5)
    friction : ndarray (n, 3)
        See `FRICTION`.
    log_speed : ndarray (n, n_runs, n_x)
        ln f at `distances()`.
    """

    restitution: NDArray[np.float64]
    wall_restitution: NDArray[np.float64]
    floor_lid_restitution: NDArray[np.float64]
    nuisances: NDArray[np.float64]
    friction: NDArray[np.float64]
    log_speed: NDArray[np.float64]


def distances() -> NDArray[np.float64]:
    """The distances of a library, (60,), [m]."""
    return np.geomspace(FIRST_DISTANCE, LAST_DISTANCE, N_DISTANCES)


def fit_library(
    tray: Tray,
    decays: Decays,
    made_by: str,
    conditions: Mapping[str, Any] | None = None,
    rough: Decays | None = None,
) -> DecayLibrary:
    """Fit a library to decays.

    Parameters
    ----------
    tray : Tray
    decays : Decays
        Of smooth beads.
    made_by : str
        JSON, stored in the library.
    conditions : mapping, optional
        As of `tray_key`.
    rough : Decays, optional
        Of beads that rub.

    Returns
    -------
    DecayLibrary

    Raises
    ------
    FitError
        With fewer than two runs a node, or fewer nodes than `fewest_nodes`, or rough ones than
        `fewest_rough_nodes`.
    """
    nodes, runs, _ = decays.log_speed.shape
    design = design_of(
        decays.restitution,
        decays.wall_restitution,
        decays.floor_lid_restitution,
        decays.nuisances,
    )
    terms = design.plain.shape[1] + design.weighted.shape[1]
    if runs < 2 or nodes < fewest_nodes():
        raise FitError(
            'decay library',
            f'{nodes} nodes of {runs} runs',
            f'give {fewest_nodes()} nodes and 2 runs at least',
        )
    base = rough_rates(tray)
    rate = design.losses @ base
    mean = decays.log_speed.mean(axis=1)
    error = decays.log_speed.std(axis=1, ddof=1) / math.sqrt(runs)
    x = distances()
    coefficients = np.empty((terms, x.size))
    excess = 0.0
    for k in range(x.size):
        decay = rate * x[k]
        sd = np.maximum(error[:, k], _LEAST_ERROR * np.median(error[:, k]))
        target = mean[:, k] + np.log1p(decay)
        matrix = design.terms(decay)
        coefficients[:, k] = _fitted(tray, matrix / sd[:, np.newaxis], target / sd)
        residual = target - matrix @ coefficients[:, k]
        excess += float(np.mean(residual**2) - np.mean(error[:, k] ** 2) * (1.0 - terms / nodes))
    library = DecayLibrary(
        tray=tray_key(tray, conditions),
        made_by=made_by,
        misfit=math.sqrt(max(excess / x.size, 0.0)),
        base=base,
        distances=x,
        coefficients=coefficients,
        covariance_restitution=_COVARIANCE_RESTITUTION,
        covariance_wall=_COVARIANCE_WALL,
        covariance=_covariances(decays),
        lowest=np.array([LOWEST_WALL, LOWEST_FLOOR_LID]),
        rubbing=rubbing_rate(tray),
        friction_coefficients=np.empty((0, x.size)),
        friction_misfit=0.0,
    )
    return library if rough is None else _with_friction(tray, library, rough)


def _fitted(
    tray: Tray, matrix: NDArray[np.float64], target: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients by least squares.

    Raises
    ------
    FitError
        When decays are not finite: a bead or two need not collide in all runs.
    """
    try:
        if np.isfinite(matrix).all() and np.isfinite(target).all():
            return np.asarray(np.linalg.lstsq(matrix, target, rcond=_ZERO)[0], dtype=np.float64)
    except np.linalg.LinAlgError:
        pass
    raise FitError(
        f'decay library of tray {tray.number}',
        f'the decays of {tray.count} beads follow no smooth function',
        'use contacts alone, which need no library: nanorocks measure FILM',
    )


def _with_friction(tray: Tray, library: DecayLibrary, decays: Decays) -> DecayLibrary:
    """A library of smooth beads with what friction adds."""
    nodes, runs, n_x = decays.log_speed.shape
    if runs < 2 or nodes < fewest_rough_nodes():
        raise FitError(
            'decay library',
            f'{nodes} rough nodes of {runs} runs',
            f'give {fewest_rough_nodes()} rough nodes and 2 runs at least, or none',
        )
    points = (
        decays.restitution,
        decays.wall_restitution,
        decays.floor_lid_restitution,
        decays.nuisances,
    )
    design = design_of(*points)
    terms = friction_terms(design.losses, design.nuisances, decays.friction)
    rate = design.losses @ library.base
    rubbing = library.rubbing * decays.friction[:, 0]
    seen = np.maximum(decays.log_speed, _UNSEEN)
    mean = seen.mean(axis=1)
    added = mean - library.log_speed(*points)
    error = seen.std(axis=1, ddof=1) / math.sqrt(runs)
    weight = np.where(mean < _FAINT, _FAINT_WEIGHT, 1.0) / np.hypot(error, _LEAST_ROUGH_ERROR)
    coefficients = np.empty((2 * terms.shape[1], n_x))
    excess = np.empty_like(mean)
    for k, distance in enumerate(library.distances):
        offset, matrix = rough_design(terms, rate * distance, rubbing * distance)
        target = added[:, k] - offset
        coefficients[:, k] = _fitted(
            tray, weight[:, k, np.newaxis] * matrix, weight[:, k] * target
        )
        freedom = 1.0 - len(coefficients) / nodes
        excess[:, k] = (target - matrix @ coefficients[:, k]) ** 2 - freedom * error[:, k] ** 2
    typical = (mean > _FAINT) & (decays.floor_lid_restitution < _ELASTIC)[:, np.newaxis]
    square = np.broadcast_to(decays.friction[:, :1] ** 2, mean.shape)
    return replace(
        library,
        friction_coefficients=coefficients,
        friction_misfit=math.sqrt(max(excess[typical].sum() / square[typical].sum(), 0.0)),
    )


def fewest_nodes() -> int:
    """Smallest number of nodes of a library: with fewer, the functions fit the noise."""
    return 2 * term_count()


def fewest_rough_nodes() -> int:
    """Smallest number of rough nodes of a library that has any."""
    return 2 * friction_term_count(len(NUISANCES))


def rough_rates(tray: Tray) -> NDArray[np.float64]:
    """Approximate decay rates for a full loss, (3,), [1/m].

    Kinetic theory of a dilute isotropic gas, for pairs, side walls, floor and lid; the polynomials
    of the library correct the rest.
    """
    free = [max(side - tray.diameter, 0.1 * tray.diameter) for side in tray.dimensions]
    pair = math.sqrt(2.0) / 6.0 * tray.count * math.pi * tray.diameter**2 / math.prod(free)
    wall = 2.0 / (3.0 * math.pi)
    return np.array([pair, wall * (1.0 / free[0] + 1.0 / free[1]), wall / free[2]])


def _covariances(decays: Decays) -> NDArray[np.float64]:
    """Covariance between runs, averaged over the nodes around each point of the grid."""
    _, runs, n_x = decays.log_speed.shape
    deviation = decays.log_speed - decays.log_speed.mean(axis=1, keepdims=True)
    of_node = np.einsum('nrx,nry->nxy', deviation, deviation) / (runs - 1)
    across = _even(decays.restitution)
    up = _even_walls(decays.wall_restitution)
    covariance = np.empty((_COVARIANCE_RESTITUTION.size, _COVARIANCE_WALL.size, n_x, n_x))
    for i, restitution in enumerate(_even(_COVARIANCE_RESTITUTION)):
        for j, wall in enumerate(_even_walls(_COVARIANCE_WALL)):
            square = ((across - restitution) ** 2 + (up - wall) ** 2) / _REACH**2
            weight = np.exp(-0.5 * square)
            covariance[i, j] = np.tensordot(weight / weight.sum(), of_node, axes=1)
    return covariance


def _even(restitution: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinate in which covariances are averaged, 0 for a restitution of 1."""
    return np.asarray((1.0 - restitution) ** (1.0 / 1.5))


def _even_walls(restitution: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same for walls."""
    return np.asarray(((1.0 - restitution) / (1.0 - LOWEST_WALL)) ** (1.0 / _WALL_POWER))


def node_of(number: int, *, rough: bool = False) -> dict[str, float]:
    """Restitutions and nuisances of a node of the library, evenly spread for any number of nodes.

    An additive recurrence with the powers of the generalised golden ratio (Roberts 2018, "The
    unreasonable effectiveness of quasirandom sequences"): more nodes keep the earlier ones.

    Parameters
    ----------
    number : int, from 0
    rough : bool
        Whether beads and walls rub.

    Returns
    -------
    dict of str to float
        ``restitution``, ``wall_restitution``, ``floor_lid_restitution``, the nuisances, ``count``
        in units of -1, 0, 1, and `FRICTION`.
    """
    dimensions = 2 + 1 + len(NUISANCES) + (len(FRICTION) if rough else 0)
    golden = 1.5
    for _ in range(64):
        golden = (1.0 + golden) ** (1.0 / (dimensions + 1))
    u = [(0.5 + (number + 1) * golden**-k) % 1.0 for k in range(1, dimensions + 1)]
    wall = 1.0 - (1.0 - LOWEST_WALL) * u[1] ** _WALL_POWER
    floor_lid = 1.0 - (1.0 - wall) * math.exp(1.6 * (u[2] - 0.5))
    return {
        'restitution': 1.0 - u[0] ** 2,
        'wall_restitution': wall,
        'floor_lid_restitution': max(floor_lid, LOWEST_FLOOR_LID),
        'height': 0.5e-3 * (u[3] - 0.5),
        'diameter': 0.04 * (u[4] - 0.5),
        'anisotropy': 1.4 * (u[5] - 0.5),
        'count': math.floor(3.0 * u[6]) - 1.0,
        'start': 1.0 if u[7] < 0.5 else -1.0,
        # Dense towards 0, where most of the trays are likely to be.
        'wall_friction': HIGHEST_FRICTION * u[8] ** 2 if rough else 0.0,
        'bead_friction': 2.2 * (u[9] - 0.5) if rough else 0.0,
        'tangential': 0.8 * (u[10] - 0.5) if rough else 0.0,
    }
