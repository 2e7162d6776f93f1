"""The figure of the packing of clusters, after figure 10 of the paper.

Tested by ``test/cli/figures/test_figure_packing.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, GREY, MEASURED, PAPER, SERIES, TWO_COLUMNS
from nanorocks_ros.physics.filling_factor import (
    HEXAGONAL_LAYER,
    PAPER_COMPACTION,
    RANDOM_CLOSE_PACKING,
)
from nanorocks_ros.studies.analysis.cluster_packing import compaction, paper_filling_of_level_area

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.analysis.cluster_packing import Compaction, PackingCurve

_BINS = 30
# Time since the shaking event in which beads are single, [s].
_SINGLE_TIME = 1.5


def packing_figure(
    path: Path, trays: Mapping[int, Tray], curves: Mapping[int, Sequence[PackingCurve]]
) -> dict[str, Any]:
    """Draw filling factors over a cycle, where positions are known, and the compaction.

    Parameters
    ----------
    path : Path
    trays : mapping of int to Tray
    curves : mapping of int to sequence of PackingCurve
        The cycles of each tray.

    Returns
    -------
    dict
        By tray: number of cycles, compaction by the paper's rule and true compaction with their
        standard errors over the cycles, and filling factors at the end; None where unknown.

    Raises
    ------
    RecordingError
        When a cycle is too short, or the picture cannot be written.
    """
    compactions = {
        number: [compaction(curve) for curve in tray_curves]
        for number, tray_curves in curves.items()
    }
    with figure_file(path, TWO_COLUMNS, 85.0) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        known = any(
            np.isfinite(curve.filling).any()
            for tray_curves in curves.values()
            for curve in tray_curves
        )
        (_draw_fillings if known else _draw_areas)(left, curves)
        _draw_compaction(right, compactions)
        left.set_xlabel('time since the shaking event [s]')
        for axes in (left, right):
            axes.grid(alpha=0.25)
    return {
        str(number): _values(trays[number], tray_curves, compactions[number])
        for number, tray_curves in curves.items()
    }


def _values(
    tray: Tray, curves: Sequence[PackingCurve], compactions: Sequence[Compaction]
) -> dict[str, Any]:
    apparent = _mean([cycle.apparent for cycle in compactions])
    true = _mean([cycle.true for cycle in compactions])
    single = float(
        np.median(
            np.concatenate([curve.level_area[curve.times < _SINGLE_TIME] for curve in curves])
        )
    )
    end = float(np.mean([cycle.end for cycle in compactions]))
    return {
        'cycles': len(curves),
        'apparent_compaction': apparent[0],
        'apparent_compaction_error': apparent[1],
        'true_compaction': true[0],
        'true_compaction_error': true[1],
        'paper_compaction': PAPER_COMPACTION.get(tray.number),
        'paper_filling_from_picture': (
            paper_filling_of_level_area(tray, end, single) if single > 0.0 else None
        ),
        'layer_filling': _mean([curve.filling[-1] for curve in curves])[0],
        'paper_filling': _mean([curve.paper[-1] for curve in curves])[0],
        'filling_in_space': _mean([curve.in_space[-1] for curve in curves])[0],
        'beads_per_cluster': _mean([curve.beads[-1] for curve in curves])[0],
    }


def _mean(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Mean of the finite values and its standard error."""
    known = np.array(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    if known.size == 0:
        return None, None
    error = float(known.std(ddof=1)) / math.sqrt(known.size) if known.size > 1 else None
    return float(known.mean()), error


def _binned(
    curves: Sequence[PackingCurve], values: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean of all cycles in bins of time; bins without a value are left out."""
    times = np.concatenate([curve.times for curve in curves])
    all_values = np.concatenate(values)
    edges = np.linspace(0.0, float(times.max()) * (1.0 + 1e-9), _BINS + 1)
    bins = np.digitize(times, edges) - 1
    rows = [
        (times[in_bin].mean(), all_values[in_bin].mean())
        for k in range(_BINS)
        if (in_bin := (bins == k) & np.isfinite(all_values)).any()
    ]
    middle, mean = np.array(rows).reshape(-1, 2).T
    return middle, mean


def _draw_fillings(axes: Axes, curves: Mapping[int, Sequence[PackingCurve]]) -> None:
    for colour, (number, tray_curves) in zip(SERIES, curves.items(), strict=False):
        for style, kind, text in (
            ('-', 'filling', 'layer one bead high'),
            (':', 'in_space', 'true height'),
        ):
            times, mean = _binned(tray_curves, [getattr(curve, kind) for curve in tray_curves])
            axes.plot(times, mean, style, color=colour, lw=1.8, label=f'tray {number}, {text}')
    axes.axhline(HEXAGONAL_LAYER, color='black', lw=1.0, ls='--')
    axes.text(
        0.99,
        HEXAGONAL_LAYER - 0.008,
        f'hexagonal layer of equal beads, {HEXAGONAL_LAYER:.3f}',
        ha='right',
        va='top',
        fontsize=7.0,
        transform=axes.get_yaxis_transform(),
    )
    axes.axhline(RANDOM_CLOSE_PACKING, color=GREY, lw=1.0, ls='--')
    axes.text(
        0.99,
        RANDOM_CLOSE_PACKING + 0.005,
        f'random close packing in space, {RANDOM_CLOSE_PACKING:g}',
        ha='right',
        va='bottom',
        fontsize=7.0,
        color=GREY,
        transform=axes.get_yaxis_transform(),
    )
    axes.set_ylim(0.0, 0.95)
    axes.set_ylabel('filling factor of the hulls of clusters')
    axes.set_title('True positions: mean over cycles')
    axes.legend(ncols=2, loc='upper right')


def _draw_areas(axes: Axes, curves: Mapping[int, Sequence[PackingCurve]]) -> None:
    for colour, (number, tray_curves) in zip(SERIES, curves.items(), strict=False):
        ends = [compaction(curve).end for curve in tray_curves]
        relative = [end / curve.level_area for curve, end in zip(tray_curves, ends, strict=True)]
        times, mean = _binned(tray_curves, relative)
        axes.plot(times, mean, '-', color=colour, lw=1.8, label=f'tray {number}')
    axes.axhline(1.0, color='black', lw=0.7)
    axes.set_ylabel('end of the cycle over level area')
    axes.set_title("The paper's filling factor, over that at the end")
    axes.legend()


def _draw_compaction(axes: Axes, compactions: Mapping[int, Sequence[Compaction]]) -> None:
    labelled: set[str] = set()
    for place, (number, cycles) in enumerate(compactions.items()):
        series = [
            (
                -0.2,
                "the paper's rule, these images",
                'o',
                MEASURED,
                [cycle.apparent for cycle in cycles],
            ),
            (0.2, 'true', 's', FITTED, [cycle.true for cycle in cycles]),
        ]
        for offset, text, mark, colour, values in series:
            mean, error = _mean(values)
            if mean is None:
                continue
            axes.errorbar(
                place + offset,
                100.0 * mean,
                yerr=100.0 * (error or 0.0),
                fmt=mark,
                ms=6,
                capsize=3,
                color=colour,
                label=None if text in labelled else text,
            )
            labelled.add(text)
        printed = PAPER_COMPACTION.get(number)
        if printed is not None:
            text = 'printed in the paper'
            axes.plot(
                place,
                100.0 * printed,
                'D',
                ms=6,
                color=PAPER,
                mec='black',
                mew=0.5,
                label=None if text in labelled else text,
            )
            labelled.add(text)
    axes.axhline(0.0, color='black', lw=0.7)
    axes.set_xticks(range(len(compactions)), [f'tray {number}' for number in compactions])
    axes.set_xlim(-0.6, len(compactions) - 0.4)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.4 * (high - low))
    axes.set_ylabel('compaction [%]')
    axes.set_title('Widest autocorrelation to the end')
    axes.legend()
