"""What the pipeline measures in a video file, imported as a user does it."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import cv2
import numpy as np
from scipy.spatial import cKDTree

from benchmarks.place_errors import PlaceErrors, place_errors
from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import Pipeline, Wanted
from nanorocks_ros.records import (
    ClusterEstimate,
    CorEstimate,
    CorStatus,
    Merge,
    Notice,
    PairCollision,
    Quality,
    SpeedEstimate,
    Tracks,
)
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.restitution.restitution_estimator import (
    RestitutionEstimator,
    RestitutionInput,
)
from nanorocks_ros.studies.analysis.bag_images import open_camera
from nanorocks_ros.studies.analysis.results.results_json import last_of_each_cycle
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films
from nanorocks_ros.wire.products import is_measured

if TYPE_CHECKING:
    from collections.abc import Iterable

    from benchmarks.film_truth import FilmTruth
    from nanorocks_ros.pipeline.composition import Result
    from nanorocks_ros.records import ArrayRecord

_Kind = TypeVar('_Kind')
DECADES = (0.1e-3, 0.3e-3, 1e-3, 3e-3, 10e-3)
"""Limits of the groups of true speeds, [m/s]."""
_NS = 1e9
_SURE = 0.68
# Stated errors within which a speed holds.
_HOLDS = 2.0
_RADII_FRAMES = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmResult:
    """What was measured in a film.

    Parameters
    ----------
    refusal : str
        The line that ended the analysis; empty when nothing did.
    notices : tuple of str
    cycles : tuple of CorEstimate
        Last estimate of each cycle, intervals of 95 %.
    sure : tuple of CorEstimate
        The same with intervals of 68 %.
    speed_ratios : tuple of float
        Measured over true mean projected speed in each of `DECADES`; NaN without any.
    speed_pulls, speeds_held : tuple of float
        Mean error over the stated one there, and share of errors below twice the stated ones.
    flagged_speeds : float, 0 to 1
        Share of the speeds after the kick with a flag.
    counts : tuple of float
        Of each species: beads seen over those of which at least half shows, means over frames.
    radii : tuple of float
        Of each species: median of the measured radii over the mean true one.
    errors : tuple of PlaceErrors or None
        Of each species: stated errors of places and radii over the true ones.
    collisions : tuple of PairCollision
    clusters : tuple of ClusterEstimate
        Last estimate of each cycle, and of the time before the first.
    merges : tuple of Merge
    epoch_ns : int
        Stamp of the first frame.
    """

    refusal: str = ''
    notices: tuple[str, ...] = ()
    cycles: tuple[CorEstimate, ...] = ()
    sure: tuple[CorEstimate, ...] = ()
    speed_ratios: tuple[float, ...] = ()
    speed_pulls: tuple[float, ...] = ()
    speeds_held: tuple[float, ...] = ()
    flagged_speeds: float = 0.0
    counts: tuple[float, ...] = ()
    radii: tuple[float, ...] = ()
    errors: tuple[PlaceErrors | None, ...] = ()
    collisions: tuple[PairCollision, ...] = ()
    clusters: tuple[ClusterEstimate, ...] = ()
    merges: tuple[Merge, ...] = ()
    epoch_ns: int = 0

    @property
    def final(self) -> CorEstimate | None:
        """The final estimate of the only cycle; None when there is none."""
        if len(self.cycles) != 1 or self.cycles[0].status is not CorStatus.FINAL:
            return None
        return self.cycles[0]


HARMLESS = Quality.GRAY_CAMERA | Quality.GLARE | Quality.SATURATED
"""Flags that say nothing against a restitution."""


def is_flagged(estimate: CorEstimate) -> bool:
    """Whether a flag warns of the restitution."""
    return bool(estimate.quality & ~HARMLESS)


def measure(film: FilmTruth) -> FilmResult:
    """Import a film into a temporary bag and push it through the pipeline."""
    cv2.setNumThreads(1)
    settings = settings_for(film)
    with tempfile.TemporaryDirectory() as scratch:
        bag = Path(scratch) / 'bag'
        try:
            import_films([film.video], bag, ImportSettings(threads=1), lambda _: None)
            return _Reading(film, settings).of(bag)
        except NanorocksError as error:
            return FilmResult(refusal=str(error))


def settings_for(film: FilmTruth) -> PipelineSettings:
    """What a user tells of the film: tray and scale, and where the floor is."""
    values: dict[str, object] = {
        'trays': [film.tray],
        'preprocess.pixels_per_metre': film.scale,
    }
    if film.region:
        values['preprocess.regions_px'] = [round(side) for side in film.region]
    return with_values(PipelineSettings(), values, 'benchmark')


class _Reading:
    """Reads one bag and gathers what `FilmResult` holds."""

    def __init__(self, film: FilmTruth, settings: PipelineSettings) -> None:
        self._film, self._settings = film, settings
        self._tracks: list[Tracks] = []
        self._records: list[ArrayRecord] = []

    def of(self, bag: Path) -> FilmResult:
        source, epoch_ns, view = open_camera(bag, self._settings)
        pipeline = Pipeline(self._settings, source.where, view)
        wanted = {self._film.tray: Wanted(tracks=True)}
        notices = []
        for frame in source.frames():
            if isinstance(frame, Exception):
                notices.append(str(frame))
                continue
            self._keep(pipeline.follow(pipeline.preprocessor.push(frame), wanted), notices)
        self._keep(pipeline.flush(), notices)
        speeds = self._of_kind(SpeedEstimate)
        estimates = self._of_kind(CorEstimate)
        return FilmResult(
            notices=tuple(notices),
            cycles=tuple(last_of_each_cycle(estimates)),
            sure=self._narrower(),
            **self._compared_speeds(speeds, epoch_ns),
            flagged_speeds=self._flagged(speeds, epoch_ns),
            counts=self._counts(),
            radii=self._radii(epoch_ns),
            errors=place_errors(self._film, self._tracks, epoch_ns),
            collisions=tuple(self._of_kind(PairCollision)),
            clusters=tuple(
                {record.cycle: record for record in self._of_kind(ClusterEstimate)}.values()
            ),
            merges=tuple(self._of_kind(Merge)),
            epoch_ns=epoch_ns,
        )

    def _keep(self, records: Iterable[Result], notices: list[str]) -> None:
        for record in records:
            if isinstance(record, Tracks):
                self._tracks.append(record)
            elif isinstance(record, Notice):
                notices.append(record.text)
            elif is_measured(record):
                self._records.append(record)

    def _of_kind(self, kind: type[_Kind]) -> list[_Kind]:
        return [record for record in self._records if isinstance(record, kind)]

    def _narrower(self) -> tuple[CorEstimate, ...]:
        """The estimates with intervals of 68 % from the same speeds and contacts."""
        values = {'cooling.probability': _SURE, 'cooling.update_interval': 60.0}
        settings = with_values(self._settings, values, 'benchmark')
        tray = load_trays(settings.trays_file)[self._film.tray]
        estimator = RestitutionEstimator(settings, tray)
        estimates: list[CorEstimate] = []
        for record in self._records:
            if isinstance(record, RestitutionInput):
                estimates += estimator.push(record)
        return tuple(last_of_each_cycle([*estimates, *estimator.flush()]))

    def _compared_speeds(
        self, speeds: list[SpeedEstimate], epoch_ns: int
    ) -> dict[str, tuple[float, ...]]:
        """Fields that compare speeds with true ones, in each of `DECADES`."""
        film = self._film
        groups: list[list[tuple[float, float, float]]] = [[] for _ in DECADES[1:]]
        for speed in speeds:
            middle = (speed.stamp_ns - epoch_ns) / _NS
            if middle - 0.5 * speed.window <= film.shake:
                continue
            first = round((middle - 0.5 * speed.window) * film.frame_rate)
            last = round((middle + 0.5 * speed.window) * film.frame_rate)
            true = film.mean_projected_speed[max(first, 0) : last + 1]
            mean = speed.mean_projected_speed
            if not true.size or not np.isfinite([mean.value, mean.error]).all():
                continue
            group = int(np.searchsorted(DECADES, true.mean())) - 1
            if 0 <= group < len(groups):
                groups[group].append((mean.value, float(true.mean()), mean.error))
        ratios, pulls, held = [], [], []
        for group in groups:
            value, true, stated = np.reshape(group, (-1, 3)).T
            with np.errstate(invalid='ignore', divide='ignore'):
                pull = (value - true) / stated
                ratios.append(float(value.sum() / true.sum()))
            pulls.append(float(pull.mean()) if group else math.nan)
            held.append(float(np.mean(np.abs(pull) < _HOLDS)) if group else math.nan)
        return {
            'speed_ratios': tuple(ratios),
            'speed_pulls': tuple(pulls),
            'speeds_held': tuple(held),
        }

    def _flagged(self, speeds: list[SpeedEstimate], epoch_ns: int) -> float:
        start_ns = epoch_ns + round(self._film.shake * _NS)
        later = [speed for speed in speeds if speed.stamp_ns > start_ns]
        flagged = [speed for speed in later if speed.quality & ~HARMLESS]
        return len(flagged) / len(later) if later else 0.0

    def _counts(self) -> tuple[float, ...]:
        if not self._tracks:
            return ()
        visible = self._film.visible
        seen = [
            np.bincount(tracks.species[tracks.seen], minlength=visible.size)
            for tracks in self._tracks
        ]
        return tuple((np.mean(seen, axis=0) / visible).tolist())

    def _radii(self, epoch_ns: int) -> tuple[float, ...]:
        """Median over beads of the measured over the true radius, by species."""
        film = self._film
        ratios: list[list[float]] = [[] for _ in np.bincount(film.species)]
        for tracks in self._tracks[:: max(len(self._tracks) // _RADII_FRAMES, 1)]:
            number = round((tracks.stamp_ns - epoch_ns) / _NS * film.frame_rate)
            if not (0 <= number < len(film.positions) and tracks.seen.any()):
                continue
            bead = cKDTree(film.positions[number]).query(tracks.positions[tracks.seen])[1]
            radii = tracks.radii[tracks.seen] / film.radii[bead]
            kinds = tracks.species[tracks.seen]
            for kind, ratio, true_kind in zip(kinds, radii, film.species[bead], strict=True):
                if kind == true_kind:
                    ratios[kind].append(float(ratio))
        return tuple(float(np.median(values)) if values else float('nan') for values in ratios)
