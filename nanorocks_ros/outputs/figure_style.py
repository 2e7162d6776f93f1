"""The one style of all figures: sizes of a journal, colours that the colour-blind tell apart.

Tested by ``test/outputs/test_figure_style.py``.

References
----------
Colours: M. Okabe and K. Ito, *Color Universal Design*, 2008. Maps: viridis and cividis, whose
lightness rises evenly.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

BLACK, ORANGE, SKY, GREEN = '#000000', '#E69F00', '#56B4E9', '#009E73'
YELLOW, BLUE, VERMILION, PURPLE, GREY = '#F0E442', '#0072B2', '#D55E00', '#CC79A7', '#606060'

MEASURED, FITTED, TRUTH, PAPER, LIBRARY = BLUE, VERMILION, GREY, ORANGE, BLACK
"""What a colour means in every figure that has measurements, fits, truth and the paper."""

SERIES = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY)
MARKS = ('o', 's', '^', 'D', 'v', 'P', 'X', '*')
"""Colours and marks of trays or species; the two differ together, for prints without colour."""

MAP = 'viridis'
"""Colour map of a quantity."""

ONE_COLUMN, TWO_COLUMNS = 85.0, 175.0
"""Widths of figures in a journal, [mm]."""

_INCH = 25.4
_DPI = 200
_BAR_STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_BAR_SHARE = 0.28
# Decades below which a logarithmic axis has ticks as a linear one, and above which only powers of
# ten have room.
_SHORT, _LONG = 0.35, 3.0
_FEW, _MANY = (1.0, 2.0, 5.0), (1.0, 2.0, 3.0, 4.0, 5.0, 7.0)

STYLE: Any = {
    'font.family': 'DejaVu Sans',
    'font.size': 8.0,
    'axes.titlesize': 8.5,
    'axes.titlelocation': 'left',
    'axes.labelsize': 8.0,
    'axes.linewidth': 0.7,
    'axes.grid': False,
    'axes.axisbelow': True,
    'figure.titlesize': 9.0,
    'grid.alpha': 0.25,
    'grid.linewidth': 0.6,
    'image.cmap': MAP,
    'legend.fontsize': 7.0,
    'legend.frameon': False,
    'legend.handlelength': 1.8,
    'lines.linewidth': 1.3,
    'lines.markersize': 3.5,
    'xtick.labelsize': 7.5,
    'ytick.labelsize': 7.5,
    'hatch.linewidth': 0.5,
    'savefig.dpi': _DPI,
    # TrueType letters, which stay text; never Type 3, which journals refuse.
    'pdf.fonttype': 42,
    'ps.fonttype': 42,
    # Letters as outlines: an SVG looks the same where the font is not installed.
    'svg.fonttype': 'path',
}


def inches(width: float, height: float) -> tuple[float, float]:
    """Size of a figure for Matplotlib, from millimetres."""
    return width / _INCH, height / _INCH


def plain_numbers(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers: 0.5, 1, 2; no powers of ten."""
    axis.set_major_locator(_RoundNumbers())
    axis.set_major_formatter('{x:g}')
    axis.set_minor_formatter(NullFormatter())


class _RoundNumbers(LogLocator):
    """Round numbers on a logarithmic axis, as many as it has room for."""

    def tick_values(self, vmin: float, vmax: float) -> Any:
        decades = math.log10(vmax / vmin) if 0.0 < vmin < vmax else 1.0
        if decades < _SHORT:
            return MaxNLocator(6).tick_values(vmin, vmax)
        if decades > _LONG:
            self.set_params(subs=(1.0,), numticks=12)
        else:
            self.set_params(subs=_FEW if decades > 1.0 else _MANY, numticks=12)
        return super().tick_values(vmin, vmax)


def scale_bar(axes: Axes, units_per_mm: float) -> float:
    """Draw a bar of a round length into the lower left corner of a picture.

    Parameters
    ----------
    axes : Axes
        Of a picture, with its limits set.
    units_per_mm : float, > 0
        Units of the axes in a millimetre, for instance pixels.

    Returns
    -------
    float, [mm]
        The length of the bar.
    """
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    length = bar_length(abs(right - left) / units_per_mm)
    x, y = left + 0.04 * (right - left), bottom + 0.06 * (top - bottom)
    end = x + length * units_per_mm * (1.0 if right > left else -1.0)
    outline = [withStroke(linewidth=4.0, foreground='black')]
    axes.plot([x, end], [y, y], '-', color='white', lw=2.2, path_effects=outline,
              solid_capstyle='butt')  # fmt: skip
    axes.text(
        0.5 * (x + end),
        y + 0.02 * (top - bottom),
        f'{length:g} mm',
        color='white',
        ha='center',
        va='bottom',
        fontsize=7.0,
        path_effects=[withStroke(linewidth=1.8, foreground='black')],
    )
    return length


def bar_length(width: float) -> float:
    """The longest round length below about a quarter of a width, both in the same unit."""
    fitting = [step for step in _BAR_STEPS if step <= _BAR_SHARE * width]
    return max(fitting, default=_BAR_STEPS[0])
