"""Simulated decays of one tray as smooth functions of the restitutions, to hold data against.

With constant restitution a gas that is k times as fast does the same things k times as fast, so
v(t) = v0 f(v0 t) with one function f of a distance, [m]. The library holds the mean of ln f over
many runs as a function of the restitution of the beads, of the side walls, and of floor and lid,
with its derivatives to what is not known exactly (height, diameter, count, how the gas starts),
and the covariance of ln f between distances, since a gas of a few beads does not follow the mean.

ln f is written as -ln(1 + rate x), which Haff's law would be, plus polynomials, some of them
times 1 / (1 + rate x), at each of a series of distances x; rate is a rough one, linear in the
energies lost, 1 - restitution^2. The polynomials are in the loss of a pair, the loss at a side
wall and the *root* of the loss at floor and lid: in a flat tray these empty the vertical motion
first, so that near zero loss the rate rises steeply.
"""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# What varies beside the restitutions, and the unit of each in the polynomials: height of the
# tray, [m]; diameter of the most frequent beads, relative; logarithm of the factor on the first
# vertical velocities; number of those beads, in steps of `count_step`; speeds even (-1) or
# Maxwellian (1) at the start.
NUISANCES = ('height', 'diameter', 'anisotropy', 'count', 'start')
UNITS = np.array([0.25e-3, 0.02, 0.7, 1.0, 1.0])
# Those that matter to second order, too: without it the mean over them would pass for the middle.
_CURVED = (0, 2)
# Restitutions of walls that a library covers.
LOWEST_WALL = 0.78
_DEGREE, _WEIGHTED_DEGREE, _NUISANCE_DEGREE = 4, 3, 2
_ARRAYS = (
    'base',
    'misfit',
    'distances',
    'coefficients',
    'covariance_restitution',
    'covariance_wall',
    'covariance',
)
_FORMAT = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class DecayLibrary:
    """Mean and covariance of ln f of one tray.

    Parameters
    ----------
    tray : str
        What decides how a tray cools, see `tray_key`.
    made_by : str
        JSON: version, seed, nodes, runs.
    misfit : float
        What the functions are off by in ln f, beyond the noise of the runs they were made from.
    base : ndarray (3,), [1/m]
        Rough rates of decay for a full loss in a pair, at a side wall, at floor and lid.
    distances : ndarray (n_x,), [m]
        Evenly spaced in their logarithm: v0 t, with v0 the mean projected speed at the start.
    coefficients : ndarray (n_terms, n_x)
    covariance_restitution, covariance_wall : ndarray (n_c,), (n_w,)
        Where the covariance is known; falling from 1, rising to 1.
    covariance : ndarray (n_c, n_w, n_x, n_x)
        Of ln f between runs.
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

    @cached_property
    def step(self) -> float:
        """Of the logarithm of the distances."""
        return float(np.log(self.distances[-1] / self.distances[0]) / (self.distances.size - 1))

    def log_speed(
        self,
        restitution: NDArray[np.float64],
        wall_restitution: NDArray[np.float64],
        floor_lid_restitution: NDArray[np.float64] | None = None,
        nuisances: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Mean of ln f at the distances.

        Parameters
        ----------
        restitution, wall_restitution : ndarray (n,), 0 to 1
        floor_lid_restitution : ndarray (n,), optional
            As the side walls where not given.
        nuisances : ndarray (n, 5), optional
            Deviations from the tray as it is listed, in SI units; see `NUISANCES`.

        Returns
        -------
        ndarray (n, n_x)
        """
        design = design_of(
            restitution,
            wall_restitution,
            wall_restitution if floor_lid_restitution is None else floor_lid_restitution,
            np.zeros((np.size(restitution), len(NUISANCES))) if nuisances is None else nuisances,
        )
        rate = design.losses @ self.base
        found = np.empty((rate.size, self.distances.size))
        for k, distance in enumerate(self.distances):
            found[:, k] = design.terms(rate * distance) @ self.coefficients[:, k]
            found[:, k] -= np.log1p(rate * distance)
        return found

    def save(self, write: Callable[[dict[str, NDArray[Any]]], None]) -> None:
        """Hand the arrays to something that writes them into an ``.npz`` file."""
        arrays: dict[str, NDArray[Any]] = {
            name: np.asarray(getattr(self, name)) for name in _ARRAYS
        }
        arrays['covariance'] = self.covariance.astype(np.float32)
        write(
            {
                **arrays,
                'format': np.array(_FORMAT),
                'tray': np.array(self.tray),
                'made_by': np.array(self.made_by),
            }
        )


@dataclass(frozen=True, kw_only=True)
class Design:
    """Where in the space of restitutions and nuisances the terms are to be taken.

    Parameters
    ----------
    losses : ndarray (n, 3)
        1 - restitution^2 of pairs, side walls, floor and lid.
    plain, weighted : ndarray (n, n_terms)
        Terms as they are, and those that go with 1 / (1 + rate x).
    """

    losses: NDArray[np.float64]
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
            1.0 - np.asarray(one, dtype=np.float64) ** 2
            for one in (restitution, wall_restitution, floor_lid_restitution)
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
    products = [factor * one for one in scaled.T for factor in factors]
    simple = [pair**i * root**k for i, j, k in _powers(1) if j == 0]
    products += [factor * scaled[:, number] ** 2 for number in _CURVED for factor in simple]
    return Design(
        losses=losses,
        plain=np.column_stack(main + products),
        weighted=np.column_stack(weighted + products),
    )


def _powers(degree: int) -> list[tuple[int, int, int]]:
    return [
        (i, j, k)
        for i in range(degree + 1)
        for j in range(degree + 1 - i)
        for k in range(degree + 1 - i - j)
    ]


def count_step(tray: Tray) -> int:
    """Beads by which the number of the most frequent ones is varied: 5 %, or one."""
    return max(1, round(0.05 * max(one.count for one in tray.species)))


def tray_key(tray: Tray) -> str:
    """What decides how a tray cools, as a JSON object: its inside and its beads."""
    species = [
        {'diameter_low': beads.diameter_low, 'diameter_high': beads.diameter_high}
        | {'density': beads.density, 'count': beads.count}
        for beads in tray.species
    ]
    return json.dumps({'dimensions': tray.dimensions, 'species': species})


def build_command(tray: Tray) -> str:
    """What to type to get the library of a tray."""
    return f'nanorocks library --tray {tray.number} -o tray_{tray.number}.npz'


def library_of(tray: Tray, path: str | Path = '') -> DecayLibrary:
    """The library of a tray: from a file, or the one that comes with the package.

    Parameters
    ----------
    tray : Tray
    path : str or Path
        Empty: of the package.

    Raises
    ------
    ConfigurationError
        When it cannot be read, or was made for another tray.
    """
    library = load_library(str(path) or f'tray_{tray.number}.npz', packaged=not path)
    if library.tray != tray_key(tray):
        where = str(path) or f'tray {tray.number}'
        raise ConfigurationError(
            where,
            f'the decay library is of a tray with other beads or sides than tray {tray.number}',
            f'make one: {build_command(tray)}, and pass it as cooling.decay_library; or choose '
            'cooling.relation paper',
        )
    return library


@lru_cache(maxsize=16)
def load_library(name: str, *, packaged: bool) -> DecayLibrary:
    """A library from a file.

    Parameters
    ----------
    name : str
        Path, or name in the package.
    packaged : bool

    Raises
    ------
    ConfigurationError
        When it cannot be read.
    """
    remedy = 'make it again with `nanorocks library`'
    try:
        if packaged:
            source = resources.files(__package__).joinpath('libraries', name)
            with source.open('rb') as stream:
                arrays = _arrays(stream)
        else:
            with Path(name).open('rb') as stream:
                arrays = _arrays(stream)
    except FileNotFoundError as error:
        raise ConfigurationError(name, 'there is no such decay library', remedy) from error
    except OSError as error:
        raise ConfigurationError(name, f'cannot be read ({error.strerror})', remedy) from error
    except (ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile) as error:
        raise ConfigurationError(name, 'is damaged, or no decay library', remedy) from error
    return DecayLibrary(
        tray=str(arrays['tray']),
        made_by=str(arrays['made_by']),
        misfit=float(arrays['misfit']),
        **{one: arrays[one].astype(np.float64) for one in _ARRAYS if one != 'misfit'},
    )


def _arrays(stream: Any) -> dict[str, NDArray[Any]]:
    with np.load(stream, allow_pickle=False) as found:
        arrays = {name: found[name] for name in (*_ARRAYS, 'format', 'tray', 'made_by')}
    if int(arrays['format']) != _FORMAT or len(arrays['coefficients']) != term_count():
        raise ValueError('of another release')
    return arrays


def term_count() -> int:
    """How many terms the functions of a library have at each distance."""
    one = np.ones(1)
    design = design_of(one, one, one, np.zeros((1, len(NUISANCES))))
    return int(design.plain.shape[1] + design.weighted.shape[1])
