"""From the width of an autocorrelation to the size of the clusters, by simulated ones.

The area in which the autocorrelation exceeds a level depends on the camera as much as on the
clusters: shadows and blur alone make it up to half as large again. They widen the peak at every
level alike, though, so that the *breadth*, the area over the one at a higher level, hardly depends
on them. What is *read* from a picture is ln(breadth) + weight ln(area), with the weight that tells
sizes best where nothing is known of the camera.

Where two beads touch or lie over each other in the picture they are one object to the
autocorrelation, whether they stick or not, and where all beads hang together its width is that of
the tray. So the reading rises slowly with ln(size), its mean over many simulated pictures is held
as a rising curve, and what single pictures scatter about it is the error of a size. A curve ends
where that error grows beyond a factor of three: there the width says nothing more.
"""

from __future__ import annotations

import json
import math
import zipfile
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.records import UNKNOWN, SizeStatus

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Part of the contrast of the darkest pixel from which on a pixel counts as covered.
DARKER = 0.15
# Level of the area that the level area is divided by.
INNER_LEVEL = 0.7
# Of what single beads were simulated to show: the least level area and contrast that are beads.
_SMALL, _FAINT = 0.6, 0.4
# Beads and what is left of their shadows cover 0.71 to 1.4 times the area of their discs; with
# less to see than this, beads are missing, and those left would seem to be large clusters.
_COVER = 0.68
# By which ln(breadth) may be outside those simulated.
_OUTSIDE = 0.1
# Of ln(size): a factor of three.
_WORST = math.log(3.0)
# Sizes above that part of the largest all look alike: the weight is chosen without them.
_GROWING = 0.7
# Sizes that are tried for an interval.
_GRID = 400
# Of the bins of ln(size), and pictures that a bin needs.
_BIN = 0.3
_FEWEST = 8
# Sizes below this are single beads, with a pair here and there.
_SINGLE = 1.05
_FORMAT = 1
PACKAGED = 'cluster_curves.npz'


class Width(NamedTuple):
    """How wide the autocorrelation of a picture is, and the contrast of the picture.

    `level_area` and `inner_area`: where it exceeds the level and `INNER_LEVEL`, [m^2]; `contrast`:
    standard deviation of the picture, [gray levels]; `cover`: share of it that is darker than
    `DARKER` of its darkest pixel, NaN when it is not known.
    """

    level_area: float
    inner_area: float
    contrast: float
    cover: float = UNKNOWN


class SizeEstimate(NamedTuple):
    """A weight-averaged cluster size, [beads]; NaN where it is not known.

    `lower` and `upper`: sizes between which the width is one standard deviation off or less.
    """

    size: float
    error: float
    lower: float
    upper: float
    status: SizeStatus


@dataclass(frozen=True, kw_only=True, eq=False)
class ClusterCurve:
    """Mean reading of one tray as a rising function of ln(weight-averaged size).

    Parameters
    ----------
    tray : str
        What is seen of a tray, see `curve_key`.
    made_by : str
        JSON: version, seed, runs, level.
    level : float
        Of the autocorrelation.
    log_size : ndarray (n,)
        Rising from 0, to the largest simulated.
    reading : ndarray (n,)
        ln(breadth) + weight ln(level area / m^2), rising.
    scatter : ndarray (n,)
        Standard deviation of the reading of one picture, whatever the camera does.
    end : int
        Points up to the last whose size can be told; 0 where the width says nothing of the size.
    weight : float, >= 0
    least : Width
        Less is not of beads, of level area or of contrast.
    breadths : tuple of 2 floats
        Less or more is not of beads.
    discs : float
        Area of the discs of all beads, over that of the floor.
    samples : ndarray of float32, (n_samples, 6)
        What it was made from: run, time since the shaking event [s], size, level area and inner
        area [m^2], contrast.
    """

    tray: str
    made_by: str
    level: float
    log_size: NDArray[np.float64]
    reading: NDArray[np.float64]
    scatter: NDArray[np.float64]
    end: int
    weight: float
    least: Width
    breadths: tuple[float, float]
    discs: float
    samples: NDArray[np.float32]

    @property
    def largest(self) -> float:
        """Weight-averaged size at which the curve ends, [beads]; NaN when there is none."""
        return math.exp(self.log_size[self.end - 1]) if self.end else UNKNOWN

    def size_of(self, width: Width) -> SizeEstimate:
        """The size that goes with a width, never beyond the curve.

        Parameters
        ----------
        width : Width
        """
        if not self.end:
            return _unknown(SizeStatus.INSENSITIVE)
        if width.cover < _COVER * self.discs:
            return _unknown(SizeStatus.NOTHING)
        if not (
            width.level_area > self.least.level_area
            and width.contrast > self.least.contrast
            and self.breadths[0] * width.inner_area
            < width.level_area
            < self.breadths[1] * width.inner_area
        ):
            return _unknown(SizeStatus.NOTHING)
        read = math.log(width.level_area / width.inner_area)
        read += self.weight * math.log(width.level_area)
        lower, upper = self._interval(read)
        size = self._inverse(read)
        if math.isnan(size):
            return SizeEstimate(UNKNOWN, UNKNOWN, lower, upper, SizeStatus.BEYOND)
        return SizeEstimate(size, 0.5 * (upper - lower), lower, upper, SizeStatus.MEASURED)

    def _interval(self, read: float) -> tuple[float, float]:
        """Least and largest size of which a reading is one standard deviation off or less.

        All sizes that were simulated count, those beyond the end too: where the curve is flat,
        what reads like ten beads may be all there are.
        """
        near = min(max(read, self.reading[0]), self.reading[-1])
        log_size = np.linspace(0.0, self.log_size[-1], _GRID)
        reading = np.interp(log_size, self.log_size, self.reading)
        scatter = np.interp(log_size, self.log_size, self.scatter)
        inside = log_size[np.abs(near - reading) <= scatter]
        return math.exp(inside[0]), math.exp(inside[-1])

    def _inverse(self, read: float) -> float:
        """Size at a reading: 1, the smallest there is, below the curve; NaN beyond its end."""
        if read > self.reading[self.end - 1]:
            return UNKNOWN
        return math.exp(float(np.interp(read, self.reading, self.log_size)))


def _unknown(status: SizeStatus) -> SizeEstimate:
    return SizeEstimate(UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, status)


def curve_key(tray: Tray) -> str:
    """What decides how the pictures of a tray look, as a JSON object."""
    species = [
        {'material': one.material, 'low': one.diameter_low, 'high': one.diameter_high}
        | {'count': one.count}
        for one in tray.species
    ]
    return json.dumps({'dimensions': tray.dimensions, 'species': species, 'chalk': tray.chalk})


def build_command(tray: Tray) -> str:
    """What to type to get the curve of a tray."""
    return f'nanorocks cluster-curve --tray {tray.number} -o curve.npz'


def fit_curve(
    tray: str,
    level: float,
    samples: NDArray[np.float32],
    made_by: str = '{}',
    discs: float = 0.0,
) -> ClusterCurve:
    """The curve through simulated pictures.

    Parameters
    ----------
    tray : str
        Its `curve_key`.
    level : float
    samples : ndarray (n_samples, 6)
        See `ClusterCurve`.
    made_by : str
        JSON.
    discs : float
        See `ClusterCurve`.
    """
    seen = samples[samples[:, 4] > 0.0].astype(np.float64)
    log_size, log_area = np.log(seen[:, 2]), np.log(seen[:, 3])
    log_breadth = np.log(seen[:, 3] / seen[:, 4])
    above = np.floor((log_size - math.log(_SINGLE)) / _BIN)
    bins = np.where(seen[:, 2] < _SINGLE, -1, above)
    found = [bins == k for k in np.unique(bins) if (bins == k).sum() >= _FEWEST]
    nodes, means, spreads = np.empty((3, 0))
    end, weight, least, breadths = 0, 0.0, Width(0.0, 0.0, 0.0), (0.0, math.inf)
    # Without pictures of single beads there is nothing to start from.
    if found and bins[found[0]][0] < 0:
        weight = _weight(log_size, log_area, log_breadth)
        reading = log_breadth + weight * log_area
        nodes, means = _rising(
            np.array([log_size[one].mean() for one in found]),
            np.array([reading[one].mean() for one in found]),
            np.array([one.sum() for one in found], dtype=np.float64),
        )
        nodes[0] = 0.0
        single = seen[found[0]].min(axis=0)
        least = Width(_SMALL * float(single[3]), 0.0, _FAINT * float(single[5]))
        breadths = (
            math.exp(log_breadth.min() - _OUTSIDE),
            math.exp(log_breadth.max() + _OUTSIDE),
        )
        spreads = _scatter(log_size, reading, nodes, means)
        end = _useful(nodes, means, spreads)
        # Flat from the last point to the largest there was.
        nodes = np.append(nodes, log_size.max())
        means, spreads = np.append(means, means[-1]), np.append(spreads, spreads[-1])
    return ClusterCurve(
        tray=tray,
        made_by=made_by,
        level=level,
        log_size=nodes,
        reading=means,
        scatter=spreads,
        end=end,
        weight=weight,
        least=least,
        breadths=breadths,
        discs=discs,
        samples=samples,
    )


def _weight(
    log_size: NDArray[np.float64],
    log_area: NDArray[np.float64],
    log_breadth: NDArray[np.float64],
) -> float:
    """Of ln(area) beside ln(breadth): Fisher's linear discriminant, none of them negative."""
    growing = log_size <= log_size.max() + math.log(_GROWING)
    terms = np.polynomial.polynomial.polyvander(log_size[growing], 3)
    seen = np.column_stack((log_area, log_breadth))[growing]
    factors = np.linalg.lstsq(terms, seen, rcond=None)[0]
    noise = np.cov((seen - terms @ factors).T)
    largest = log_size[growing].max()
    rise = (largest ** np.arange(1, 4)) @ factors[1:]
    by_area, by_breadth = np.linalg.lstsq(noise, rise, rcond=None)[0]
    return float(np.clip(by_area / by_breadth, 0.0, 1.0)) if by_breadth > 0.0 else 0.0


def _rising(
    places: NDArray[np.float64], values: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places and values that rise strictly: neighbours that do not are taken together."""
    blocks: list[NDArray[np.float64]] = []
    for one in np.column_stack((weights * places, weights * values, weights)):
        blocks.append(one)
        while len(blocks) > 1 and blocks[-2][1] / blocks[-2][2] >= blocks[-1][1] / blocks[-1][2]:
            last = blocks.pop()
            blocks[-1] = blocks[-1] + last
    sums = np.array(blocks)
    return sums[:, 0] / sums[:, 2], sums[:, 1] / sums[:, 2]


def _scatter(
    log_size: NDArray[np.float64],
    reading: NDArray[np.float64],
    nodes: NDArray[np.float64],
    means: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Standard deviation about the curve of the pictures nearest to each node."""
    squares = (reading - np.interp(log_size, nodes, means)) ** 2
    nearest = np.abs(log_size[:, None] - nodes).argmin(axis=1)
    # A node of very few pictures between others may have none that is nearest.
    return np.array(
        [
            math.sqrt(squares[nearest == k].mean() if (nearest == k).any() else squares.mean())
            for k in range(nodes.size)
        ]
    )


def _useful(
    nodes: NDArray[np.float64], means: NDArray[np.float64], spreads: NDArray[np.float64]
) -> int:
    """How many nodes there are up to the last whose size is known to a factor of three.

    None when that is below three beads: then hardly more is known than that there are beads.
    """
    # Downwards, where there is a curve for sure; no size is below 1.
    errors = nodes - np.interp(means - spreads, means, nodes)
    good = np.flatnonzero((errors <= _WORST) & (means - means[0] > spreads))
    end = int(good[-1]) + 1 if good.size else 0
    return end if end and nodes[end - 1] >= _WORST else 0


def curve_of(tray: Tray, path: str | Path = '') -> ClusterCurve:
    """The curve of a tray: from a file, or the one that comes with the package.

    Parameters
    ----------
    tray : Tray
    path : str or Path
        Empty: of the package.

    Raises
    ------
    ConfigurationError
        When the file cannot be read, or has no curve of this tray.
    """
    name = str(path) or PACKAGED
    curves = load_curves(name, packaged=not path)
    found = curves.get(curve_key(tray))
    if found is None:
        raise ConfigurationError(
            name,
            f'there is no calibration of cluster sizes for the beads and sides of tray '
            f'{tray.number}',
            f'make one: {build_command(tray)}, and pass it as clusters.curve',
        )
    return found


@lru_cache(maxsize=16)
def load_curves(name: str, *, packaged: bool) -> Mapping[str, ClusterCurve]:
    """The curves of a file, by what is seen of their trays (`curve_key`).

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
    remedy = 'make it again with `nanorocks cluster-curve`'
    source: Any = resources.files(__package__).joinpath(name) if packaged else Path(name)
    try:
        with source.open('rb') as stream, np.load(stream, allow_pickle=False) as arrays:
            return _curves(arrays)
    except FileNotFoundError as error:
        raise ConfigurationError(
            name, 'there is no such calibration of cluster sizes', remedy
        ) from error
    except OSError as error:
        raise ConfigurationError(name, f'cannot be read ({error.strerror})', remedy) from error
    except (ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile) as error:
        raise ConfigurationError(
            name, 'is damaged, or no calibration of cluster sizes', remedy
        ) from error


def _curves(arrays: Mapping[str, NDArray[Any]]) -> dict[str, ClusterCurve]:
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
    """Area of the discs of all beads over that of the floor, from a `curve_key`."""
    tray = json.loads(key)
    discs = sum(
        one['count'] * 0.25 * math.pi * (0.5 * (one['low'] + one['high'])) ** 2
        for one in tray['species']
    )
    return float(discs / (tray['dimensions'][0] * tray['dimensions'][1]))


def as_arrays(
    trays: Mapping[int, Tray], level: float, samples: NDArray[np.float32], made_by: str
) -> dict[str, NDArray[Any]]:
    """What a file of curves holds.

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
