"""Means and posteriors over all cycles of all recordings of a batch, per tray.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.npz_archive import read_archive
from nanorocks_ros.pipeline.composition import TrayStages, trays_of
from nanorocks_ros.records import (
    Headline,
    Measured,
    Quality,
)
from nanorocks_ros.records.result_words import fitted
from nanorocks_ros.studies.analysis.cycle_summaries import SIZE_MEASURES, CycleSummary
from nanorocks_ros.studies.analysis.long_term import Campaign, campaign_of
from nanorocks_ros.studies.analysis.results.results_folder import EVIDENCE
from nanorocks_ros.studies.batch.batch_trays import of_these_trays, settings_by_tray

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.inference.cycle_likelihoods import MeanRestitution
    from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.batch.batch_analysis import BagResults

# Of a cycle, what a mean is taken of.
MEANS = {
    'initial_speed': 'm/s',
    'peak_speed': 'm/s',
    'haff_time': 's',
    'cycle_restitution': '1',
    'paper_restitution': '1',
    'cluster_size': '1',
    'bodies': '1',
    'onset': 's',
}
# Of these a decay that is too short tells nothing, and its fit anything: they are not part of a
# mean unless they are known to a part of themselves.
_FITTED = 'initial_speed', 'haff_time'
# Of sticking cycles: results of earlier versions do not have these.
_LATER = {'bounces', 'undecided'}
(_WRONG_SCALE,) = Quality.WRONG_SCALE.names()


class Mean(NamedTuple):
    """Mean over cycles, its standard error, scatter of a cycle, and cycles that are known."""

    mean: float
    error: float
    scatter: float
    cycles: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TrayMeans:
    """All cycles of one tray.

    Parameters
    ----------
    tray : int
    recordings, cycles : int
        With a cycle of this tray.
    restitution : MeanRestitution or None
        Of all cycles together; None where none was read.
    sticking : StickingEstimate or None
    means : dict of str to Mean
        Of `MEANS`.
    left_out : int
        Cycles whose decays are not counted in the restitutions, since contacts contradict them.
    """

    tray: int
    recordings: int
    cycles: int
    restitution: MeanRestitution | None
    sticking: StickingEstimate | None
    means: dict[str, Mean]
    left_out: int = 0


class CycleRow(NamedTuple):
    """A cycle of a tray: name of its recording, and its quantities."""

    recording: str
    tray: int
    values: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Combined:
    """A whole batch.

    Parameters
    ----------
    trays : dict of int to TrayMeans
    cycles : list of CycleRow
        In order of recordings, trays, cycles.
    campaign : Campaign or None
        For its figure; None without a cycle.
    size_unit : str
        Of cluster sizes: ``1``, beads, or ``m`` where only correlation lengths are known.
    notices : list of str
    """

    trays: dict[int, TrayMeans]
    cycles: list[CycleRow]
    campaign: Campaign | None
    size_unit: str
    notices: list[str]


def combined(
    results: Sequence[BagResults],
    settings: PipelineSettings,
    progress: Callable[[int, int], None] | None = None,
) -> Combined:
    """Put the cycles of all recordings together.

    Parameters
    ----------
    results : sequence of BagResults
        Each recording once, in order of time.
    settings : PipelineSettings
        By which all of them were analysed.
    progress : callable, optional
        Called with the steps done and the steps there are.
    """
    notices: list[str] = []
    of_results = settings_by_tray(results, settings)
    results = [of_these_trays(result, settings, of_results, notices) for result in results]
    column, unit = _measure(results)
    rows = [row for result in results for row in _rows(result, column)]
    evidence, sticking = _added_up(results, notices, progress)
    trays: dict[int, TrayMeans] = {}
    for number, own_settings in sorted(of_results.items()):
        own = [row for row in rows if row.tray == number]
        stages = TrayStages(calibrated(own_settings), trays_of(own_settings)[number])
        mean = None
        if number in evidence:
            try:
                mean = stages.restitution.mean_of(evidence[number])
            except FitError as error:
                notices.append(str(error))
        trays[number] = TrayMeans(
            tray=number,
            recordings=len({row.recording for row in own}),
            cycles=len(own),
            restitution=mean,
            sticking=stages.clusters.together(sticking.get(number, [])),
            means={name: _mean(_counted(own, name, settings), name) for name in MEANS},
            left_out=mean.by_contacts if mean else 0,
        )
    return Combined(
        trays=trays,
        cycles=rows,
        campaign=_campaign(results, column),
        size_unit=unit,
        notices=notices,
    )


def _measure(results: Sequence[BagResults]) -> tuple[str, str]:
    """The best measure of cluster sizes that every tray of every recording with cycles has.

    Of a tray filmed at a wrong scale no size is known, and nobody else's is given up for that.
    """
    last = SIZE_MEASURES[-1]
    trays = [
        tray['by_cycle']
        for result in results
        for tray in result.summary['trays'].values()
        if tray['by_cycle'].get(last.column)
        and not any(_WRONG_SCALE in cycle['quality'] for cycle in tray['cycles'])
    ]
    for measure in SIZE_MEASURES:
        if trays and all(measure.column in tray for tray in trays):
            return measure.column, measure.unit
    return last.column, last.unit


def _rows(result: BagResults, column: str) -> Iterable[CycleRow]:
    for number, tray in result.summary['trays'].items():
        by_cycle = {own['cycle']: own for own in tray['by_cycle'].get(column, [])}
        for cycle in tray['cycles']:
            own = by_cycle.get(cycle['cycle'], {})
            values = {
                **cycle,
                'cycle_restitution': cycle['restitution'],
                'peak_speed': own.get('peak_speed'),
                'peak_speed_error': own.get('peak_speed_error'),
                'cluster_size': own.get('cluster_size'),
                'cluster_size_error': own.get('cluster_size_error'),
            }
            yield CycleRow(result.name, int(number), values)


def _counted(
    rows: Sequence[CycleRow], name: str, settings: PipelineSettings
) -> Sequence[CycleRow]:
    """The cycles of a mean: for the closed form without decays that contacts contradict."""
    if settings.cooling.include_inconsistent or name != 'paper_restitution':
        return rows
    return [row for row in rows if not _by_contacts(row)]


def _by_contacts(row: CycleRow) -> bool:
    return bool(row.values['headline'] == Headline.CONTACTS.name.lower())


def _mean(rows: Sequence[CycleRow], name: str) -> Mean:
    values = [row.values for row in rows]
    if name in _FITTED:
        values = [value for value in values if _fitted(value, name)]
    mean, scatter, count = mean_of([value.get(name) for value in values])
    error = scatter / math.sqrt(count) if count else math.nan
    return Mean(mean=mean, error=error, scatter=scatter, cycles=count)


def _fitted(values: Mapping[str, Any], name: str) -> bool:
    value, error = values.get(name), values.get(f'{name}_error')
    return value is not None and error is not None and fitted(Measured(value, error))


def _added_up(
    results: Sequence[BagResults],
    notices: list[str],
    progress: Callable[[int, int], None] | None,
) -> tuple[dict[int, CycleLikelihoods], dict[int, list[StickingCycle]]]:
    """Add up the recordings one by one: only one is in memory."""
    evidence: dict[int, CycleLikelihoods] = {}
    sticking: dict[int, list[StickingCycle]] = {}
    for done, result in enumerate(results, start=1):
        try:
            arrays = read_archive(result.folder / EVIDENCE)
            for number in map(int, result.summary['trays']):
                own = _below(arrays, f'{number}/cor/')
                if own:
                    likelihoods = CycleLikelihoods.from_arrays(own, str(result.folder / EVIDENCE))
                    evidence[number] = (
                        evidence[number] + likelihoods if number in evidence else likelihoods
                    )
                sticking.setdefault(number, []).extend(_sticking(arrays, number))
        except (RecordingError, FitError, ValueError) as error:
            notices.append(
                f'{result.name}: is not part of what all cycles say together ({error}); delete '
                f'{result.folder} and run the command again'
            )
        if progress is not None:
            progress(done, len(results))
    return evidence, sticking


def _below(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, NDArray[Any]]:
    return {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}


def _sticking(arrays: Mapping[str, NDArray[Any]], number: int) -> list[StickingCycle]:
    by_cycle: dict[str, dict[str, NDArray[Any]]] = {}
    for name, values in _below(arrays, f'{number}/sticking/').items():
        cycle, _, field_name = name.partition('/')
        by_cycle.setdefault(cycle, {})[field_name] = values
    names = {field.name for field in fields(StickingCycle)} - _LATER
    cycles = []
    for cycle in sorted(by_cycle):
        own = by_cycle[cycle]
        if names == {*own} - _LATER:
            undecided = float(own.pop('undecided')) if 'undecided' in own else 0.0
            cycles.append(StickingCycle(**own, undecided=undecided))
    return cycles


def _campaign(results: Sequence[BagResults], column: str) -> Campaign | None:
    measure = next(measure for measure in SIZE_MEASURES if measure.column == column)
    recordings = []
    for result in results:
        own = {
            int(number): [
                replace(_cycle(cycle), recording=result.name)
                for cycle in tray['by_cycle'].get(column, [])
            ]
            for number, tray in result.summary['trays'].items()
        }
        recordings.append(own)
    if not any(cycles for own in recordings for cycles in own.values()):
        return None
    return campaign_of(recordings, measure)


def _cycle(values: Mapping[str, Any]) -> CycleSummary:
    summary: dict[str, Any] = {k: math.nan if v is None else v for k, v in values.items()}
    return CycleSummary(**summary)
