"""Files of decay libraries: reading them, and the arrays they consist of.

Tested by ``test/inference/decay/test_decay_library.py``.
"""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.calibration_archives import load_archive
from nanorocks_ros.inference.decay.decay_library import (
    NUISANCES,
    DecayLibrary,
    term_count,
    tray_key,
)
from nanorocks_ros.inference.decay.friction_terms import friction_term_count

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

_ARRAYS = (
    'base',
    'distances',
    'coefficients',
    'covariance_restitution',
    'covariance_wall',
    'lowest',
    'friction_coefficients',
)
_NUMBERS = ('misfit', 'rubbing', 'friction_misfit')
_COVARIANCE = 'covariance'
_FORMAT = 2


def build_command(tray: Tray) -> str:
    """Command that makes the library of a tray."""
    return f'nanorocks library --tray {tray.number} -o tray_{tray.number}.npz'


def library_of(tray: Tray, path: str | Path = '') -> DecayLibrary:
    """The library of a tray, from a file or from the package.

    Parameters
    ----------
    tray : Tray
    path : str or Path
        Empty: the file in the package.

    Raises
    ------
    ConfigurationError
        When it cannot be read, or was made for another tray, with drag or with a restitution that
        is not constant.
    """
    library = load_library(str(path) or f'libraries/tray_{tray.number}.npz', packaged=not path)
    where = str(path) or f'tray {tray.number}'
    made_for = json.loads(library.tray)
    if law := made_for.get('law'):
        raise ConfigurationError(
            where,
            'the decay library is of other than constant restitutions, with the laws '
            f'{law["restitution_law"]} (beads) and {law["wall_restitution_law"]} (walls)',
            f'make one without a law: {build_command(tray)}',
        )
    if drag := made_for.get('drag'):
        raise ConfigurationError(
            where,
            f'the decay library is of a gas with a drag of {drag:g} 1/s; decays are compared with '
            'those in a vacuum',
            f'make one without drag: {build_command(tray)}',
        )
    if library.tray != tray_key(tray):
        raise ConfigurationError(
            where,
            f'the decay library is of a tray with other beads or sides than tray {tray.number}',
            f'make one: {build_command(tray)}, and pass it as cooling.decay_library; or choose '
            'cooling.relation paper, or measure contacts alone: nanorocks measure FILM',
        )
    return library


@lru_cache(maxsize=16)
def load_library(name: str, *, packaged: bool) -> DecayLibrary:
    """A library from a file.

    Parameters
    ----------
    name : str
        Path, or name of a file in the package.
    packaged : bool

    Raises
    ------
    ConfigurationError
        When it cannot be read.
    """
    return load_archive(
        name,
        __package__ if packaged else None,
        _library,
        kind='decay library',
        command='nanorocks library',
    )


def _library(arrays: Mapping[str, NDArray[Any]]) -> DecayLibrary:
    if int(arrays['format']) != _FORMAT or not _has_these_terms(arrays):
        raise ValueError('of another release')
    half = arrays[_COVARIANCE]
    n_x = arrays['distances'].size
    # Before anything is made of the number of distances, which may be any.
    if half.shape[-1:] != (n_x * (n_x + 1) // 2,) or not _has_numbers(arrays):
        raise ValueError('of another form')
    upper = np.triu_indices(n_x)
    covariance = np.empty((*half.shape[:-1], n_x, n_x))
    covariance[..., upper[0], upper[1]] = half
    covariance[..., upper[1], upper[0]] = half
    return DecayLibrary(
        tray=str(arrays['tray']),
        made_by=str(arrays['made_by']),
        misfit=float(arrays['misfit']),
        rubbing=float(arrays['rubbing']),
        friction_misfit=float(arrays['friction_misfit']),
        covariance=covariance,
        **{name: arrays[name].astype(np.float64) for name in _ARRAYS},
    )


def _has_numbers(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether its arrays hold finite real numbers, and its tray is described."""
    return isinstance(json.loads(str(arrays['tray'])), dict) and all(
        arrays[name].dtype.kind in 'fiu' and bool(np.isfinite(arrays[name]).all())
        for name in (*_NUMBERS, *_ARRAYS, _COVARIANCE)
    )


def _has_these_terms(arrays: Mapping[str, NDArray[Any]]) -> bool:
    return len(arrays['coefficients']) == term_count() and (
        len(arrays['friction_coefficients']) in (0, friction_term_count(len(NUISANCES)))
    )


def library_arrays(library: DecayLibrary) -> dict[str, NDArray[Any]]:
    """Arrays of the file of a library; of the covariances the upper half, in single precision."""
    upper = np.triu_indices(library.distances.size)
    return {
        **{name: np.asarray(getattr(library, name)) for name in _NUMBERS + _ARRAYS},
        _COVARIANCE: library.covariance[..., upper[0], upper[1]].astype(np.float32),
        'format': np.array(_FORMAT),
        'tray': np.array(library.tray),
        'made_by': np.array(library.made_by),
    }
