"""What is wrong with the scale of a tray, in one line with a remedy that can be pasted.

Tested by ``test/stages/scale/test_scale_check.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.records import Quality
from nanorocks_ros.stages.scale.rulers import AXES, TOLERANCE, agree, flag_of, mean_ratio

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PreprocessSettings
    from nanorocks_ros.stages.scale.rulers import Ruler

_MILLIMETRE = 1e-3


def scale_flag(pixels_per_metre: float) -> str:
    """The option that sets the scale."""
    return f'--preprocess-pixels-per-metre {pixels_per_metre:.0f}'


def disagreement(rulers: Sequence[Ruler], tray: Tray, settings: PreprocessSettings) -> str:
    """Which rulers disagree, by how much, what follows and what to do.

    Parameters
    ----------
    rulers : sequence of Ruler
        The first is the scale of the settings.
    tray : Tray
    settings : PreprocessSettings
    """
    told = settings.pixels_per_metre
    first, *others = rulers
    values = ', '.join(
        f'{ruler.name} {told * ruler.ratio:.0f} px/m ({100.0 * (ruler.ratio - 1.0):+.1f} %)'
        for ruler in others
    )
    refused = Quality.WRONG_SCALE in flag_of(rulers)
    consequence = 'no restitution is given' if refused else 'results carry DOUBTFUL_SCALE'
    return (
        f'tray {tray.number}: the rulers of the scale disagree, {consequence}: '
        f'{first.name} says {told:.0f} px/m, {values}; {_remedy(rulers, tray, settings)}'
    )


def _remedy(rulers: Sequence[Ruler], tray: Tray, settings: PreprocessSettings) -> str:
    told = rulers[0]
    beads = [ruler for ruler in rulers if ruler.source == 'beads']
    walls = [ruler for ruler in rulers if ruler.source == 'walls']
    measured = [*beads, *walls]
    if not measured:
        return 'set preprocess.pixels_per_metre or preprocess.regions_px so that they agree'
    scale = settings.pixels_per_metre * mean_ratio(measured)
    if agree(measured) and (not (beads and walls) or _near(beads, walls)):
        if not flag_of([told, *measured]):
            sides = ' x '.join(f'{side * scale:.0f}' for side in tray.dimensions[:2])
            return f'give a region of {sides} px around the floor in preprocess.regions_px'
        if not (beads and walls):
            return _one_source(scale, tray, of_beads=bool(beads))
        if settings.calibration:
            return f'beads and walls support {scale:.0f} px/m: calibrate again'
        return f'beads and walls agree: pass {scale_flag(scale)}'
    if walls and agree(walls) and _near([told], walls):
        return _wrong_diameter(beads, tray)
    if beads and agree(beads) and _near([told], beads):
        return _wrong_dimensions(walls, tray)
    return (
        f'no scale fits: correct diameter_mm and dimensions_mm of tray {tray.number} in the trays '
        'file, and calibrate the camera with nanorocks calibrate'
    )


def _near(some: Sequence[Ruler], others: Sequence[Ruler]) -> bool:
    """Whether two groups agree whatever their errors: no value is advised on errors alone."""
    return abs(math.log(mean_ratio(some) / mean_ratio(others))) <= TOLERANCE


def _one_source(scale: float, tray: Tray, *, of_beads: bool) -> str:
    """A remedy when beads or walls alone tell of the scale."""
    source, key = ('beads', 'diameter_mm') if of_beads else ('walls', 'dimensions_mm')
    return (
        f'the {source} alone support {scale:.0f} px/m: if {key} of tray {tray.number} in the '
        f'trays file is right, pass {scale_flag(scale)}'
    )


def _wrong_diameter(beads: Sequence[Ruler], tray: Tray) -> str:
    factor = mean_ratio(beads)
    size = f'{factor:.3f} times as large as given'
    if len(tray.species) == 1:
        size = f'{tray.diameter * factor / _MILLIMETRE:.2f} mm large'
    light = ''
    if factor < 1.0:
        light = '; or light them from all sides, if their shaded side does not show'
    return (
        f'the scale fits the walls, and beads look {size}: correct diameter_mm of tray '
        f'{tray.number} in the trays file{light}'
    )


def _wrong_dimensions(walls: Sequence[Ruler], tray: Tray) -> str:
    lengths = [
        f'{tray.dimensions[axis] * ruler.ratio / _MILLIMETRE:.2f} mm along {name}'
        for ruler in walls
        for axis, name in enumerate(AXES)
        if ruler.name.endswith(name)
    ]
    return (
        f'the scale fits the beads, and the floor looks {" and ".join(lengths)}: correct '
        f'dimensions_mm of tray {tray.number} in the trays file'
    )
