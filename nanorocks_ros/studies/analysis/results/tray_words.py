"""The cycles of a tray of an analysis in lines of text.

Tested by ``test/studies/analysis/test_offline_analysis.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.records import CorRelation
from nanorocks_ros.settings import priors_in_words
from nanorocks_ros.studies.analysis.results.cycle_lines import cycle_lines
from nanorocks_ros.studies.analysis.results.cycle_words import (
    is_decay_left_out,
    tray_reason,
    used_speeds,
    wall_prior,
)
from nanorocks_ros.studies.analysis.results.results_json import (
    end_of_cycle,
    ends_of_cycles,
    last_of_each_cycle,
)

if TYPE_CHECKING:
    from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults


def tray_lines(analysis: Analysis, results: TrayResults) -> list[str]:
    """The cycles of a tray in lines of text."""
    recognised = [line for verdict in results.verdicts for line in verdict.lines()]
    reason = tray_reason(results)
    if reason is not None:
        return [*recognised, f'no COR: {reason.text}; {reason.remedy}']
    cycles = last_of_each_cycle(results.cors)
    used = used_speeds(results.speeds, cycles, wall_prior(analysis.prior))
    ends = ends_of_cycles(results.clusters)
    lines = [*recognised, f'priors: {priors_in_words(analysis.prior)}']
    left_out = 0
    for cor, speeds in zip(cycles, used, strict=True):
        is_out = is_decay_left_out(cor, include_inconsistent=analysis.include_inconsistent)
        left_out += is_out
        lines += cycle_lines(cor, end_of_cycle(ends, cor), speeds, left_out=is_out)
    mean = cycles[-1].mean_restitution
    if len(cycles) > 1 and math.isfinite(mean.value):
        without = f', without the decays of {left_out}' if left_out else ''
        lines.append(f'all cycles: COR {mean.value:.4f} +- {mean.error:.4f}{without}')
    if results.truth:
        truth = results.truth[-1]
        lines.append(f'truth:   COR {truth.restitution:g}, walls {truth.wall_restitution:g}')
    if cycles[-1].relation is CorRelation.PAPER:
        lines.append(
            "relation 'paper': its interval is statistical only; pass --cooling-relation library "
            'for one that counts walls and crowding'
        )
    return lines
