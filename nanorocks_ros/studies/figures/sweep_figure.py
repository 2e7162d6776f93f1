"""The figure of a sweep over two settings: a map of the deviation from a decay.

Tested by ``test/cli/simulation/test_sweep.py``.
"""

from __future__ import annotations

import json
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.patheffects import withStroke

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import MAP, TWO_COLUMNS, plain_numbers
from nanorocks_ros.settings import SimulationSettings, rows
from nanorocks_ros.studies.decays.chi_square_map import chi_square
from nanorocks_ros.studies.decays.sweep_contours import contours

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve
    from nanorocks_ros.studies.sweeps.sweep_plan import Axis
    from nanorocks_ros.studies.sweeps.sweep_result import Sweep

_PICTURES = ('.png', '.pdf', '.svg')
_MARK = '#ffffff'
_OUTLINE = [withStroke(linewidth=4.5, foreground='black')]
_LABEL_WIDTH = 55
# Chi square below which curves agree; the colour scale begins there.
_AGREEMENT = 0.5


def check_drawable(path: Path, axes: tuple[Axis, ...]) -> None:
    """Reject an unknown picture format, or a grid without two axes of numbers.

    Raises
    ------
    ConfigurationError
        Unless there are two axes with two numbers or more each, and the picture's name ends in
        ``.png``, ``.pdf`` or ``.svg``.
    """
    if path.suffix not in _PICTURES:
        raise ConfigurationError(
            '--figure', f'{str(path)!r} is no picture file', f'end it in {", ".join(_PICTURES)}'
        )
    numbers = [
        axis
        for axis in axes
        if len(axis.values) > 1 and all(isinstance(value, int | float) for value in axis.values)
    ]
    if len(axes) != 2 or len(numbers) != 2:
        shape = ' x '.join(str(len(axis.values)) for axis in axes) or 'a single point'
        raise ConfigurationError(
            '--figure', f'the grid is {shape}', 'vary two numbers, with two values or more each'
        )


def chi_square_figure(
    path: Path, sweep: Sweep, curve: SpeedCurve, *, scaled: bool = False
) -> None:
    """Draw a map of the deviation of a sweep over two settings from a decay.

    For restitutions of beads and walls, or the width of their distribution, lines mark equal decay
    rates by closed forms.

    Parameters
    ----------
    path : Path
    sweep : Sweep
        Over two settings.
    curve : SpeedCurve
    scaled : bool, optional
        Whether the initial speed is free, see `chi_square`.

    Raises
    ------
    ConfigurationError
        When the sweep is not over two settings, cannot be compared with the curve, or the
        picture format is unknown.

    References
    ----------
    After [B19] fig. 12.
    """
    check_drawable(path, sweep.axes)
    values = chi_square(sweep, curve, scaled=scaled)
    across, up = (np.array(axis.values, dtype=np.float64) for axis in sweep.axes)
    order = np.ix_(np.argsort(across), np.argsort(up))
    with figure_file(path, TWO_COLUMNS, 140.0) as figure:
        axes = figure.subplots()
        shown = np.maximum(values[order].T, _AGREEMENT)
        mesh = axes.pcolormesh(
            np.sort(across),
            np.sort(up),
            shown,
            shading='nearest',
            cmap=MAP,
            norm=LogNorm(vmin=_AGREEMENT, vmax=max(float(shown.max()), 2.0)),
        )
        bar = figure.colorbar(mesh, ax=axes, label=r'mean $\chi^2$ over the times', extend='min')
        plain_numbers(bar.ax.yaxis)
        _draw_contours(axes, sweep, curve)
        _mark(axes, sweep, values, curve)


def _mark(axes: Axes, sweep: Sweep, values: NDArray[np.float64], curve: SpeedCurve) -> None:
    first, second = sweep.axes
    if curve.point is not None:
        point, marker, label = curve.point, '*', 'reference'
    else:
        best = np.unravel_index(int(np.argmin(values)), values.shape)
        point = first.values[int(best[0])], second.values[int(best[1])]
        marker, label = 'o', f'best: {point[0]:g}, {point[1]:g}'
    axes.plot(
        *([float(value)] for value in point),
        marker,
        ms=14,
        color=_MARK,
        mec='black',
        ls='none',
        clip_on=False,
        label=label,
    )
    axes.set_xlabel(_label(first))
    axes.set_ylabel(_label(second))
    axes.set_title(f'{_fixed_settings(sweep)}{sweep.runs} runs at each of {values.size} points')
    # Beside the map, since the minimum may lie in a corner.
    figure: Any = axes.figure
    figure.legend(loc='outside lower center', ncols=3, facecolor='#c8ccd4', frameon=True)


def _fixed_settings(sweep: Sweep) -> str:
    """Text with tray and walls, where they do not vary."""
    settings = json.loads(sweep.specification)['settings']
    names = {'tray': 'tray', 'wall_restitution': 'walls'}
    varied = {axis.name for axis in sweep.axes}
    held = [f'{text} {settings[name]:g}' for name, text in names.items() if name not in varied]
    return f'{", ".join(held).capitalize()}: ' if held else ''


def _draw_contours(axes: Axes, sweep: Sweep, curve: SpeedCurve) -> None:
    """Draw the lines of equal decay rate within the map."""
    ends = axes.get_xlim(), axes.get_ylim()
    for contour, style in zip(contours(sweep, curve), ('-', '--'), strict=False):
        first = sweep.axes[0].name == 'restitution'
        x, y = (
            (contour.restitution, contour.other) if first else (contour.other, contour.restitution)
        )
        inside = (x >= ends[0][0]) & (x <= ends[0][1]) & (y >= ends[1][0]) & (y <= ends[1][1])
        label = contour.label if inside.any() else f'{contour.label} (outside)'
        axes.plot(x, y, style, color=_MARK, lw=2.2, label=label, path_effects=_OUTLINE)
    axes.set_xlim(*ends[0])
    axes.set_ylim(*ends[1])


def _label(axis: Axis) -> str:
    (row,) = (row for row in rows(SimulationSettings()) if row.name == axis.name)
    return textwrap.fill(f'{row.doc} [{row.unit}]' if row.unit else row.doc, _LABEL_WIDTH)
