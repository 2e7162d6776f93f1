"""Decay library: simulated decays of one tray as smooth functions of the restitutions.

With constant restitution a gas that is k times as fast does the same things k times as fast, so
v(t) = v0 f(v0 t) with one function f of a distance, [m]. The library holds the mean of ln f over
many runs as a function of the restitution of the beads, of the side walls, and of floor and lid,
with its derivatives by the nuisances (height, diameter, count, initial velocities), and the
covariance of ln f between distances, since a gas of a few beads deviates from the mean.

ln f is written as -ln(1 + rate x), which Haff's law would be, plus polynomials, some of them
times 1 / (1 + rate x), at each of a series of distances x; rate is a rough one, linear in the
energies lost, 1 - restitution^2. The polynomials are in the loss of a pair, the loss at a side
wall and the *root* of the loss at floor and lid: in a flat tray these empty the vertical motion
first, so that near zero loss the rate rises steeply. A library may hold what friction adds, see
`friction_terms`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.inference.decay.friction_terms import friction_terms

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Nuisance parameters, and the unit of each in the polynomials: height of the
# tray, [m]; diameter of the most frequent beads, relative; logarithm of the factor on the first
# vertical velocities; number of those beads, in steps of `count_step`; uniform (-1) or
# Maxwellian (1) speeds at the start.
NUISANCES = ('height', 'diameter', 'anisotropy', 'count', 'start')
UNITS = np.array([0.25e-3, 0.02, 0.7, 1.0, 1.0])
# Nuisances with a quadratic term as well, without which their mean effect would be missing.
_CURVED = (0, 2)
# Lowest restitution of the side walls, and of floor and lid, of nodes of a library.
LOWEST_WALL, LOWEST_FLOOR_LID = 0.5, 0.3
_DEGREE, _WEIGHTED_DEGREE, _NUISANCE_DEGREE = 4, 3, 2


@dataclass(frozen=True, kw_only=True, eq=False)
class DecayLibrary:
    """Mean and covariance of ln f of one tray.

    Parameters
    ----------
    tray : str
        Its `tray_key`.
    made_by : str
        JSON: version, seed, nodes, runs.
    misfit : float
        Error of the functions in ln f, beyond the noise of the runs they were fitted to.
    base : ndarray (3,), [1/m]
        Rough rates of decay for a full loss in a pair, at a side wall, at floor and lid.
    distances : ndarray (n_x,), [m]
        Evenly spaced in their logarithm: v0 t, with v0 the mean projected speed at the start.
    coefficients : ndarray (n_terms, n_x)
    covariance_restitution, covariance_wall : ndarray (n_c,), (n_w,)
        Grid of the covariance; falling from 1, rising to 1.
    covariance : ndarray (n_c, n_w, n_x, n_x)
        Of ln f between runs.
    lowest : ndarray (2,)
        Lowest restitutions that were simulated, of side walls, of floor and lid. Lower ones count
        as these.
    rubbing : float, [1/m]
        Rough rate of decay with a friction of 1.
    friction_coefficients : ndarray (n_friction_terms, n_x)
        Empty if only smooth beads were simulated.
    friction_misfit : float
        Error of the functions in ln f with friction, over the friction of the walls.
    """

    tray: str
    made_by: str
    misfit: float
    base: NDArray[np.float64]
    distances: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    covariance_restitution: NDArray[np.float64]
    covariance_wall: NDArray[np.float64]
    covariance: NDArray[np.float64]
    lowest: NDArray[np.float64]
    rubbing: float
    friction_coefficients: NDArray[np.float64]
    friction_misfit: float

    @cached_property
    def step(self) -> float:
        """Step of the logarithm of the distances."""
        return float(np.log(self.distances[-1] / self.distances[0]) / (self.distances.size - 1))

    @property
    def rough(self) -> bool:
        """Whether rough beads were simulated."""
        return len(self.friction_coefficients) > 0

    def log_speed(
        self,
        restitution: NDArray[np.float64],
        wall_restitution: NDArray[np.float64],
        floor_lid_restitution: NDArray[np.float64] | None = None,
        nuisances: NDArray[np.float64] | None = None,
        friction: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Mean of ln f at the distances.

        Parameters
        ----------
        restitution, wall_restitution : ndarray (n,), 0 to 1
        floor_lid_restitution : ndarray (n,), optional
            That of the side walls if not given.
        nuisances : ndarray (n, 5), optional
            Deviations from the listed tray, in SI units; see `NUISANCES`.
        friction : ndarray (n, 3), optional
            See `FRICTION`; smooth beads if not given. Of a library that is `rough`.

        Returns
        -------
        ndarray (n, n_x)
        """
        ends = wall_restitution if floor_lid_restitution is None else floor_lid_restitution
        design = design_of(
            restitution,
            np.maximum(wall_restitution, self.lowest[0]),
            np.maximum(ends, self.lowest[1]),
            np.zeros((np.size(restitution), len(NUISANCES))) if nuisances is None else nuisances,
        )
        rate = design.losses @ self.base
        # For all distances at once: only the weight of the second terms depends on the distance.
        decay = rate[:, np.newaxis] * self.distances
        plain, weighted = np.split(self.coefficients, [design.plain.shape[1]])
        log_speed = design.plain @ plain + design.weighted @ weighted / (1.0 + decay)
        log_speed -= np.log1p(decay)
        if friction is not None:
            terms = friction_terms(design.losses, design.nuisances, friction)
            rubbing = (self.rubbing * friction[:, :1]) * self.distances
            plain, weighted = np.split(self.friction_coefficients, 2)
            log_speed -= np.log1p(rubbing / (1.0 + decay))
            log_speed += terms @ plain + terms @ weighted / (1.0 + decay + rubbing)
        return log_speed


@dataclass(frozen=True, kw_only=True)
class Design:
    """Terms of the library at points in the space of restitutions and nuisances.

    Parameters
    ----------
    losses : ndarray (n, 3)
        1 - restitution^2 of pairs, side walls, floor and lid.
    nuisances : ndarray (n, 5)
        In `UNITS`.
    plain, weighted : ndarray (n, n_terms)
        Terms without and with the factor 1 / (1 + rate x).
    """

    losses: NDArray[np.float64]
    nuisances: NDArray[np.float64]
    plain: NDArray[np.float64]
    weighted: NDArray[np.float64]

    def terms(self, decay: NDArray[np.float64]) -> NDArray[np.float64]:
        """All terms at `decay` = rate x, (n, n_terms)."""
        weight = 1.0 / (1.0 + decay)
        return np.hstack((self.plain, weight[:, np.newaxis] * self.weighted))


def design_of(
    restitution: NDArray[np.float64],
    wall_restitution: NDArray[np.float64],
    floor_lid_restitution: NDArray[np.float64],
    nuisances: NDArray[np.float64],
) -> Design:
    """The terms of the library; parameters as for `DecayLibrary.log_speed`."""
    losses = np.column_stack(
        [
            1.0 - np.asarray(values, dtype=np.float64) ** 2
            for values in (restitution, wall_restitution, floor_lid_restitution)
        ]
    )
    pair, side = losses[:, 0], losses[:, 1]
    root = np.sqrt(np.maximum(losses[:, 2], 0.0))
    main, weighted = (
        [pair**i * side**j * root**k for i, j, k in _powers(degree)]
        for degree in (_DEGREE, _WEIGHTED_DEGREE)
    )
    factors = [pair**i * root**k for i, j, k in _powers(_NUISANCE_DEGREE) if j == 0]
    scaled = np.asarray(nuisances, dtype=np.float64) / UNITS
    products = [factor * values for values in scaled.T for factor in factors]
    simple = [pair**i * root**k for i, j, k in _powers(1) if j == 0]
    products += [factor * scaled[:, number] ** 2 for number in _CURVED for factor in simple]
    return Design(
        losses=losses,
        nuisances=scaled,
        plain=np.column_stack(main + products),
        weighted=np.column_stack(weighted + products),
    )


def rough_design(
    terms: NDArray[np.float64], decay: NDArray[np.float64], rubbing: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What friction adds to ln f at one distance: an offset, and the terms with coefficients.

    Parameters
    ----------
    terms : ndarray (n, n_terms)
        From `friction_terms`.
    decay, rubbing : ndarray (n,)
        Rates of decay by restitutions and by friction, times the distance.

    Returns
    -------
    offset : ndarray (n,)
    matrix : ndarray (n, 2 n_terms)
    """
    weight = 1.0 / (1.0 + decay + rubbing)
    return -np.log1p(rubbing / (1.0 + decay)), np.hstack((terms, weight[:, np.newaxis] * terms))


def _powers(degree: int) -> list[tuple[int, int, int]]:
    return [
        (i, j, k)
        for i in range(degree + 1)
        for j in range(degree + 1 - i)
        for k in range(degree + 1 - i - j)
    ]


def count_step(tray: Tray) -> int:
    """Step of the number of the most frequent beads: 5 %, or one."""
    return max(1, round(0.05 * max(species.count for species in tray.species)))


def tray_key(tray: Tray, conditions: Mapping[str, Any] | None = None) -> str:
    """Properties that determine the cooling of a tray, as a JSON object.

    Parameters
    ----------
    tray : Tray
    conditions : mapping, optional
        What else is not as assumed of measured decays: ``drag``, [1/s], of a gas; ``law``,
        settings of a restitution that is not constant.
    """
    species = [
        {'diameter_low': beads.diameter_low, 'diameter_high': beads.diameter_high}
        | {'density': beads.density, 'count': beads.count}
        for beads in tray.species
    ]
    return json.dumps({'dimensions': tray.dimensions, 'species': species, **(conditions or {})})


def term_count() -> int:
    """Number of terms of a library at each distance."""
    ones = np.ones(1)
    design = design_of(ones, ones, ones, np.zeros((1, len(NUISANCES))))
    return int(design.plain.shape[1] + design.weighted.shape[1])
