"""Files of cluster curves: the relation of cluster size to level area, for each tray."""

from __future__ import annotations

import json
import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.calibration_archives import load_archive
from nanorocks_ros.inference.cluster_size.curve_fit import fit_curve

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.cluster_size.size_from_width import ClusterCurve

_FORMAT = 1
PACKAGED = 'cluster_curves.npz'


def curve_key(tray: Tray) -> str:
    """Properties that determine the images of a tray, as a JSON object."""
    species = [
        {'material': kind.material, 'low': kind.diameter_low, 'high': kind.diameter_high}
        | {'count': kind.count}
        for kind in tray.species
    ]
    return json.dumps({'dimensions': tray.dimensions, 'species': species, 'chalk': tray.chalk})


def build_command(tray: Tray) -> str:
    """Command that makes the curve of a tray."""
    return f'nanorocks cluster-curve --trays {tray.number} -o curve.npz'


def curve_of(tray: Tray, path: str | Path = '') -> ClusterCurve:
    """The curve of a tray, from a file or from the package.

    Parameters
    ----------
    tray : Tray
    path : str or Path
        Empty: the file in the package.

    Raises
    ------
    ConfigurationError
        When the file cannot be read, or has no curve of this tray.
    """
    name = str(path) or PACKAGED
    curves = load_curves(name, packaged=not path)
    curve = curves.get(curve_key(tray))
    if curve is None:
        raise ConfigurationError(
            name,
            f'there is no calibration of cluster sizes for the beads and sides of tray '
            f'{tray.number}',
            f'make one: {build_command(tray)}, and pass it as clusters.curve',
        )
    return curve


@lru_cache(maxsize=16)
def load_curves(name: str, *, packaged: bool) -> Mapping[str, ClusterCurve]:
    """The curves of a file, by the `curve_key` of their trays.

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
        _curves_from_arrays,
        kind='calibration of cluster sizes',
        command='nanorocks cluster-curve',
    )


def _curves_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> dict[str, ClusterCurve]:
    if int(arrays['format']) != _FORMAT:
        raise ValueError('of another release')
    samples, level = arrays['samples'], float(arrays['level'])
    made_by = str(arrays['made_by'])
    return {
        str(key): fit_curve(
            str(key), level, samples[samples[:, 0] == number, 1:], made_by, _discs(str(key))
        )
        for number, key in zip(arrays['trays'], arrays['keys'], strict=True)
    }


def _discs(key: str) -> float:
    """Ratio of the disc area of all beads to the area of the floor, from a `curve_key`."""
    tray = json.loads(key)
    discs = sum(
        kind['count'] * 0.25 * math.pi * (0.5 * (kind['low'] + kind['high'])) ** 2
        for kind in tray['species']
    )
    return float(discs / (tray['dimensions'][0] * tray['dimensions'][1]))


def as_arrays(
    trays: Mapping[int, Tray], level: float, samples: NDArray[np.float32], made_by: str
) -> dict[str, NDArray[Any]]:
    """Arrays of a file of curves.

    Parameters
    ----------
    trays : mapping of int to Tray
    level : float
    samples : ndarray (n_samples, 7)
        The number of the tray, and the columns of `ClusterCurve.samples`.
    made_by : str
        JSON.
    """
    return {
        'format': np.array(_FORMAT),
        'level': np.array(level),
        'made_by': np.array(made_by),
        'trays': np.array(list(trays)),
        'keys': np.array([curve_key(tray) for tray in trays.values()]),
        'samples': samples.astype(np.float32),
    }
