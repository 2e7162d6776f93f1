"""Results of an analysis as a JSON object.

Tested by ``test/studies/analysis/results/test_results_folder.py``.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.json_values import finite_or_none
from nanorocks_ros.records import NS, ClusterEstimate, CorEstimate, CorStatus
from nanorocks_ros.studies.analysis.recognition_verdicts import verdict_as_json
from nanorocks_ros.studies.analysis.results.cycle_words import (
    cycle_as_json,
    is_decay_left_out,
    tray_reason,
    used_speeds,
    wall_prior,
)
from nanorocks_ros.wire.array_layouts import layout
from nanorocks_ros.wire.flat_records import flat_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from nanorocks_ros.records import ArrayRecord
    from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults


# Elements of the arrays, under the same names in the object.
_SPEEDS = (
    'mean_projected_speed',
    'mean_projected_speed_error',
    'first_species_speed',
    'second_species_speed',
)
BY_SOURCE = tuple(
    field.name
    for field in layout(CorEstimate).fields
    if field.name.startswith(('joint_', 'decay_', 'contact_', 'wall_friction'))
)
"""Restitutions by each source; those without a source are of the one that `headline` names."""
_EXPONENTS = tuple(
    field.name
    for field in layout(CorEstimate).fields
    if '_exponent' in field.name or 'impact_' in field.name
)
_RESTITUTIONS = (
    *('initial_speed', 'initial_speed_error', 'haff_time', 'haff_time_error'),
    *('restitution', 'restitution_lower', 'restitution_upper'),
    *('wall_restitution', 'wall_restitution_lower', 'wall_restitution_upper'),
    *('restitution_lower_68', 'restitution_upper_68'),
    *('wall_restitution_lower_68', 'wall_restitution_upper_68'),
    *('correlation', 'paper_restitution'),
    *('mean_restitution', 'mean_restitution_error'),
    *('mean_wall_restitution', 'mean_wall_restitution_error'),
    *BY_SOURCE,
    *('drag', 'drag_error'),
    *('acceleration', 'acceleration_error', 'acceleration_lower', 'acceleration_upper'),
    *_EXPONENTS,
)
_SPECIES_DECAYS = tuple(
    field.name for field in layout(CorEstimate).fields if '_species_' in field.name
)


def _elements(record: ArrayRecord, names: Iterable[str]) -> dict[str, float | None]:
    """Elements of the array of a record, None where one is not known."""
    return {name: finite_or_none(flat_value(record, name)) for name in names}


def last_of_each_cycle(cors: Sequence[CorEstimate]) -> list[CorEstimate]:
    """The final estimate of every cycle, or its last where none is final."""
    latest: dict[tuple[int, int], CorEstimate] = {}
    passes = 0
    last: CorEstimate | None = None
    for cor in cors:
        # Time went back: cycles are counted from 1 again.
        if last is not None and cor.stamp_ns < last.stamp_ns and not _ended_by_merge(last, cor):
            passes += 1
        last = cor
        before = latest.get((passes, cor.cycle))
        if before is None or before.status is not CorStatus.FINAL:
            latest[passes, cor.cycle] = cor
    return list(latest.values())


def _ended_by_merge(last: CorEstimate, estimate: CorEstimate) -> bool:
    """Whether an earlier stamp is that of a merge, known later, which ended the cycle's window."""
    final = CorStatus.FINAL
    return (
        estimate.cycle == last.cycle
        and last.status is not final
        and estimate.status is not CorStatus.COOLING
    )


def as_json(analysis: Analysis, *, series: bool = True) -> dict[str, Any]:
    """The analysis as the command-line contract wants it: SI units, null for unknown.

    Parameters
    ----------
    analysis : Analysis
    series : bool
        With what was measured at every instant, not only cycle by cycle.
    """
    return {
        'frames': analysis.frames,
        'frames_lost': analysis.frames_lost,
        'seconds': analysis.seconds,
        'complete': analysis.complete,
        'notices': list(analysis.notices),
        'priors': asdict(analysis.prior),
        'trays': {
            str(number): _tray_as_json(analysis, results, series=series)
            for number, results in analysis.trays.items()
        },
    }


def _tray_as_json(analysis: Analysis, results: TrayResults, *, series: bool) -> dict[str, Any]:
    epoch_ns = analysis.epoch_ns
    cycles = last_of_each_cycle(results.cors)
    wanted = {cycle.stamp_ns for cycle in cycles}
    starts = {
        speed.stamp_ns: speed.cycle_start_ns
        for speed in results.speeds
        if speed.stamp_ns in wanted
    }
    ends = ends_of_cycles(results.clusters)
    used = used_speeds(results.speeds, cycles, wall_prior(analysis.prior))
    reason = tray_reason(results)
    return {
        **(_series_as_json(results, epoch_ns) if series else {}),
        'cycles': [
            {
                **_cycle_as_json(
                    estimate,
                    ((starts[estimate.stamp_ns] or 0) - epoch_ns) / NS,
                    clusters := end_of_cycle(ends, estimate),
                ),
                **cycle_as_json(estimate, clusters, speeds),
            }
            for estimate, speeds in zip(cycles, used, strict=True)
        ],
        'decays_left_out': sum(
            is_decay_left_out(estimate, include_inconsistent=analysis.include_inconsistent)
            for estimate in cycles
        ),
        'reason': None if reason is None else reason._asdict(),
        'recognition': [verdict_as_json(verdict) for verdict in results.verdicts],
        'truth': _truth_as_json(analysis, results, series=series),
    }


def _series_as_json(results: TrayResults, epoch_ns: int) -> dict[str, Any]:
    return {
        'time': [(speed.stamp_ns - epoch_ns) / NS for speed in results.speeds],
        **{
            name: [finite_or_none(flat_value(speed, name)) for speed in results.speeds]
            for name in _SPEEDS
        },
        'method': [speed.method.name.lower() for speed in results.speeds],
        'quality': [speed.quality.names() for speed in results.speeds],
    }


def ends_of_cycles(
    clusters: Iterable[ClusterEstimate],
) -> dict[int, list[tuple[int, ClusterEstimate]]]:
    """Of each cycle, and every time it was played: stamp of the first estimate, and the last."""
    ends: dict[int, list[tuple[int, ClusterEstimate]]] = {}
    for cluster in clusters:
        parts = ends.setdefault(cluster.cycle, [])
        if parts and cluster.stamp_ns > parts[-1][1].stamp_ns:
            parts[-1] = parts[-1][0], cluster
        else:
            parts.append((cluster.stamp_ns, cluster))
    return ends


def end_of_cycle(
    ends: Mapping[int, Sequence[tuple[int, ClusterEstimate]]], cor: CorEstimate
) -> ClusterEstimate | None:
    """The last estimate of the cycle, in the same pass of a recording that was played twice."""
    parts = ends.get(cor.cycle, ())
    near = [last for first, last in parts if first <= cor.stamp_ns <= last.stamp_ns]
    return near[-1] if near else parts[-1][1] if parts else None


def _cycle_as_json(
    cor: CorEstimate, start: float, clusters: ClusterEstimate | None
) -> dict[str, Any]:
    return {
        'cycle': cor.cycle,
        'start': start,
        **_elements(cor, _RESTITUTIONS),
        'rebounds': cor.rebounds,
        'body_rebounds': cor.body_rebounds,
        'collisions': cor.collisions,
        'tension': finite_or_none(cor.tension),
        'quality': cor.quality.names(),
        **_elements(cor, ('window_start', 'window_end', 'cooling_start')),
        **_elements(cor, _SPECIES_DECAYS),
        'relation': cor.relation.name.lower(),
        'status': cor.status.name.lower(),
        'reduced_chi_square': finite_or_none(cor.reduced_chi_square),
        'samples': cor.samples,
        **_clusters_as_json(clusters),
    }


def _clusters_as_json(last: ClusterEstimate | None) -> dict[str, Any]:
    """The clusters at the end of a cycle."""
    if last is None:
        return dict.fromkeys(('cluster_size', 'bodies', 'onset', 'sticking_speed'))
    return {
        'cluster_size': finite_or_none(last.combined_size.value),
        'cluster_size_error': finite_or_none(last.combined_size.error),
        'bodies': finite_or_none(last.bodies.value),
        'bodies_error': finite_or_none(last.bodies.error),
        'onset': finite_or_none(last.onset),
        'sticking_status': last.sticking_status.name.lower(),
        'sticking_speed': finite_or_none(last.sticking_speed.value),
        'sticking_speed_lower': finite_or_none(last.sticking_speed.lower),
        'sticking_speed_upper': finite_or_none(last.sticking_speed.upper),
        'sticking_speed_lower_68': finite_or_none(last.sticking_speed_lower_68),
        'sticking_speed_upper_68': finite_or_none(last.sticking_speed_upper_68),
    }


def _truth_as_json(
    analysis: Analysis, results: TrayResults, *, series: bool
) -> dict[str, Any] | None:
    truth = results.truth
    if not truth:
        return None
    series_of_truth: dict[str, Any] = {
        'time': [(frame.stamp_ns - analysis.epoch_ns) / NS for frame in truth],
        'mean_projected_speed': [frame.mean_projected_speed for frame in truth],
        'bodies': [frame.bodies for frame in truth],
    }
    return {
        **(series_of_truth if series else {}),
        'restitution': truth[-1].restitution,
        'wall_restitution': truth[-1].wall_restitution,
        'sticking_speed': truth[-1].sticking_speed,
    }
