"""Words about a scale that looks wrong before any bead is tracked, and what to do about it.

Tested by ``test/stages/preprocess/test_scale_advice.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.stages.scale.picture_scale import PictureScale, scale_near, scale_of_picture
from nanorocks_ros.stages.scale.rulers import TOLERANCE
from nanorocks_ros.stages.scale.scale_words import scale_flag

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings, PreprocessSettings


def scale_of_beads(
    picture: NDArray[np.uint8], tray: Tray, settings: PipelineSettings, ratio: float
) -> PictureScale | None:
    """The scale by the beads, at that of the settings, at that of the edges, or at any."""
    told = settings.preprocess.pixels_per_metre
    return (
        scale_near(picture, tray, settings.tracking, told)
        or scale_near(picture, tray, settings.tracking, told * ratio)
        or scale_of_picture(picture, tray, settings.tracking)
    )


def scale_text(settings: PreprocessSettings, edges: float, beads: PictureScale | None) -> str:
    """What looks wrong with the scale; '' where the beads contradict the edges alone.

    Parameters
    ----------
    settings : PreprocessSettings
    edges : float, [px/m]
        Scale at which the edges are those of the trays.
    beads : PictureScale or None
    """
    told = settings.pixels_per_metre
    subject = f'{scale_source(settings)} looks wrong'
    # The outside of a rim is hardly larger than the floor.
    if beads is None or abs(math.log(edges / beads.pixels_per_metre)) <= TOLERANCE:
        return (
            f'{subject}: the trays look as at {edges:.0f} px/m, not at {told:.0f}; '
            f'{remedy_for(settings, edges)}'
        )
    if beads.agrees(told):
        return ''
    value = beads.pixels_per_metre
    remedy = 'calibrate again' if settings.calibration else f'pass {scale_flag(value)}'
    return (
        f'{subject}: the beads look as at {value:.0f} px/m, not at {told:.0f} (edges that would '
        f'fit {edges:.0f} px/m are not those of the floor); {remedy} or correct diameter_mm in '
        'the trays file'
    )


def misfit_remedy(image: NDArray[np.uint8], tray: Tray, settings: PipelineSettings) -> str:
    """What to do about a centred tray that is larger than the picture at the scale that is set.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, channels), blue first
    tray : Tray
    settings : PipelineSettings
    """
    remedy = 'set preprocess.regions_px or preprocess.pixels_per_metre'
    if image.shape[2] != 3:
        return remedy
    beads = scale_of_picture(image, tray, settings.tracking)
    if beads is None:
        return remedy
    value = beads.pixels_per_metre
    return f'the beads look as at {value:.0f} px/m: pass {scale_flag(value)}'


def scale_source(settings: PreprocessSettings) -> str:
    """The setting that gives the positions of the trays."""
    if settings.calibration:
        return settings.calibration
    if settings.regions_px:
        return 'preprocess.regions_px'
    return 'preprocess.pixels_per_metre'


def remedy_for(settings: PreprocessSettings, scale: float = 0.0) -> str:
    """What the user should do."""
    if settings.calibration:
        remedy = 'calibrate again'
    elif scale and not settings.regions_px:
        # Around the floor there may be a rim, which looks like a tray as well.
        remedy = 'set it to about that and see with nanorocks look that the floor fills the crop'
    else:
        remedy = 'set preprocess.regions_px'
    return f'{remedy}, or set preprocess.check_tray_positions to false'
