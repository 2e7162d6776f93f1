"""Cluster counts, sizes and onsets by the methods of [B19], for comparison.

Its calibration is a straight line through the origin, but the area of the autocorrelation
saturates while clusters grow; its rule for the onset of sticking triggers without sticking
(``docs/method/autocorrelation.md``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ManualClusters:
    """Clusters counted by hand in one tray, averaged over 18 shaking cycles ([B19] table 3).

    Parameters
    ----------
    clusters : float
        Per tray; two or more beads that stick are a cluster.
    beads_per_cluster : float
        Number average without single beads.
    deviation : float
        Mean absolute deviation of `beads_per_cluster`.
    share : float, 0 to 1
        Fraction of the beads in clusters; in tray 4 of the beads not hidden by glare.
    """

    clusters: float
    beads_per_cluster: float
    deviation: float
    share: float


def _row(clusters: float, beads: float, deviation: float, percent: float) -> ManualClusters:
    return ManualClusters(
        clusters=clusters, beads_per_cluster=beads, deviation=deviation, share=0.01 * percent
    )


# [B19] table 3, by tray.
PAPER_TABLE_3 = {
    1: _row(3.44, 2.85, 0.73, 65.4),
    2: _row(6.78, 7.2, 2.77, 88.7),
    3: _row(8.44, 5.52, 1.36, 84.8),
    4: _row(6.67, 7.7, 2.09, 85.6),
    5: _row(9.61, 6.55, 1.34, 78.7),
    6: _row(5.78, 97.54, 21.95, 93.9),
    7: _row(6.56, 42.17, 9.14, 98.7),
    8: _row(4.83, 133.01, 44.96, 80.4),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperCalibration:
    """The paper's cluster size, proportional to the level area.

    Parameters
    ----------
    beads_per_area : float, [1/m^2]
    beads_per_area_error : float, [1/m^2]
        One standard error of the mean over the cycles; NaN for a single cycle.
    """

    beads_per_area: float
    beads_per_area_error: float

    def size(self, level_area: NDArray[np.float64]) -> NDArray[np.float64]:
        """Number of beads per cluster at level areas, [m^2].

        At every area: the paper states no range.
        """
        return np.asarray(level_area, dtype=np.float64) * self.beads_per_area


def paper_calibration(final_areas: NDArray[np.float64], manual_size: float) -> PaperCalibration:
    """The paper's calibration of the autocorrelation, by clusters counted by hand.

    Parameters
    ----------
    final_areas : ndarray (n_cycles,), [m^2]
        Level area at the end of each counted cycle.
    manual_size : float, [beads]
        Mean number of beads per cluster counted in those cycles, as in `PAPER_TABLE_3`.

    Raises
    ------
    ConfigurationError
        When no area is known, or the size is not positive.

    References
    ----------
    [B19] section 3.2.1: "we use the manual cluster analysis as calibration". The text does not
    say more; a factor is the reading that its calibrated curves allow.
    """
    known = np.asarray(final_areas, dtype=np.float64)
    known = known[np.isfinite(known) & (known > 0.0)]
    if not known.size or not manual_size > 0.0:
        raise ConfigurationError(
            'paper_calibration',
            f'{known.size} areas and {manual_size:g} beads per cluster',
            'give the level areas at the end of cycles and the counted size',
        )
    factor = manual_size / float(known.mean())
    spread = float(known.std(ddof=1)) if known.size > 1 else np.nan
    error = factor * spread / (float(known.mean()) * np.sqrt(known.size))
    return PaperCalibration(beads_per_area=factor, beads_per_area_error=float(error))


def paper_onset(
    times: NDArray[np.float64], sizes: NDArray[np.float64], start: float = 0.0
) -> float:
    """Onset of clustering by the paper: when the derivative of the cluster size becomes positive.

    The derivative of a fluctuating quantity soon becomes positive: in gases without sticking this
    rule triggers every time.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Rising.
    sizes : ndarray (n,)
        Cluster size, or the level area it is proportional to.
    start : float, [s]
        Of the search: the shaking event.

    Returns
    -------
    float, [s]
        Middle of the first two pictures after the start between which the size grows; NaN where
        it never does.

    Raises
    ------
    FitError
        When there are fewer than two known sizes after the start.

    References
    ----------
    [B19] section 3.2.3: "the moment this derivative becomes positive".
    """
    time, size = (np.asarray(values, dtype=np.float64) for values in (times, sizes))
    kept = (time >= start) & np.isfinite(size)
    time, size = time[kept], size[kept]
    if time.size < 2:
        raise FitError(
            'paper_onset',
            f'{time.size} cluster sizes after {start:g} s',
            'give two or more pictures after the shaking event',
        )
    growing = np.flatnonzero(np.diff(size) > 0.0)
    if not growing.size:
        return float('nan')
    first = int(growing[0])
    return float(0.5 * (time[first] + time[first + 1]))
