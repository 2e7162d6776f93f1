"""Figure of the preprocessing of a frame: eight steps for each tray.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import TWO_COLUMNS, YELLOW, scale_bar
from nanorocks_ros.studies.inspection.track_overlay import overlay

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SpeedSettings
    from nanorocks_ros.studies.inspection.preprocessing_steps import FrameSteps, TraySteps

_COLUMNS = 4
# Height of the title of a panel and of the headline of a tray, [mm].
_TITLE, _HEADLINE = 10.0, 8.0
# Letters of a line of a title.
_TITLE_WIDTH = 30
_MM, _MM2 = 1e3, 1e6
_EDGE = YELLOW
_AVERAGES = {
    'none': 'two frames, subtracted',
    'running_mean': 'running means of {} frames, subtracted',
    'block_mean': 'means of {} frames and the next, subtracted',
}


def steps_figure(path: Path, steps: FrameSteps, settings: SpeedSettings) -> None:
    """Draw every step of the preprocessing of a frame, eight panels for each tray.

    Parameters
    ----------
    path : Path
    steps : FrameSteps
    settings : SpeedSettings
        Settings of the binarised area.

    Raises
    ------
    RecordingError
        If the file cannot be written.

    References
    ----------
    After [B19] fig. 4.
    """
    panels = [_panels(tray, settings) for tray in steps.trays.values()]
    heights = [_height(tray) for tray in steps.trays.values()]
    with figure_file(path, TWO_COLUMNS, sum(heights)) as figure:
        parts: Any = figure.subfigures(len(panels), 1, height_ratios=heights, squeeze=False)
        for part, tray, drawn in zip(parts[:, 0], steps.trays.values(), panels, strict=True):
            part.suptitle(_headline(tray, steps), x=0.01, ha='left', weight='bold')
            axes = part.subplots(2, _COLUMNS, squeeze=False).ravel()
            for panel, (title, draw) in zip(axes, drawn, strict=True):
                panel.set_title(textwrap.fill(title, _TITLE_WIDTH), fontsize=7.0)
                panel.set_axis_off()
                draw(panel)
            # Of the straightened picture; the one as filmed has no single scale.
            scale_bar(axes[1], tray.pixels_per_metre / _MM)


def _height(steps: TraySteps) -> float:
    rows, columns = steps.raw.shape[:2]
    panel = _TITLE + TWO_COLUMNS / _COLUMNS * rows / columns
    return float(_HEADLINE + 2.0 * panel)


def _headline(steps: TraySteps, frame: FrameSteps) -> str:
    flags = ', '.join(steps.image.quality.names()) or 'none'
    return (
        f'tray {steps.tray.number}, frame {frame.number} at {frame.time:.2f} s, '
        f'cycle {steps.image.cycle}; flags: {flags}'
    )


_Panel = tuple[str, 'Callable[[Axes], None]']


def _panels(steps: TraySteps, settings: SpeedSettings) -> list[_Panel]:
    image = steps.image
    stabilised = image.gray if image.color is None else image.color
    averages = _AVERAGES[settings.averaging].format(settings.averaged_frames)
    return [
        ('1  as filmed, with the floor when at rest', lambda axes: _draw_raw(axes, steps)),
        ('2  straightened', lambda axes: _show(axes, steps.straight)),
        (f'3  stabilised: {_displacement_text(steps)}', lambda axes: _show(axes, stabilised)),
        ('4  gray mix', lambda axes: _show(axes, image.gray)),
        ('5  darkness, as the tracker sees it', lambda axes: _show(axes, steps.darkness)),
        (f'6  tracked: {_tracked_counts(steps)}', lambda axes: _draw_tracks(axes, steps)),
        (f'7  {averages}', lambda axes: _show(axes, _stretched(steps.difference))),
        (f'8  {_mask_title(steps, settings)}', lambda axes: _show(axes, steps.mask)),
    ]


def _displacement_text(steps: TraySteps) -> str:
    shift = np.array(steps.image.displacement) * steps.pixels_per_metre
    if np.isnan(shift).any():
        return 'tray displacement unknown'
    return f'tray displaced by {shift[0]:+.2f}, {shift[1]:+.2f} px'.replace('-', '−')


def _tracked_counts(steps: TraySteps) -> str:
    tracks = steps.tracks
    if tracks is None:
        return 'none, the camera is gray'
    counts = []
    for k, species in enumerate(steps.tray.species):
        seen = int((tracks.seen & (tracks.species == k)).sum())
        of = '' if species.expected is None else f' of {species.expected}'
        counts.append(f'{seen}{of} {species.material}')
    return ', '.join(counts)


def _mask_title(steps: TraySteps, settings: SpeedSettings) -> str:
    if steps.moving_area is None:
        return 'moving: too few frames so far'
    return f'moving, above {settings.threshold:g} sigma: {_MM2 * steps.moving_area:.1f} mm²'


def _draw_raw(axes: Axes, steps: TraySteps) -> None:
    _show(axes, steps.raw)
    # Matplotlib centres the first pixel at 0; the outline counts from the corner of that pixel.
    closed = np.vstack([steps.outline, steps.outline[:1]]) - 0.5
    axes.plot(*closed.T, color=_EDGE, lw=0.9)


def _draw_tracks(axes: Axes, steps: TraySteps) -> None:
    if steps.tracks is None:
        _show(axes, None)
    else:
        _show(axes, overlay(steps.image, [steps.tracks], steps.pixels_per_metre))


def _show(axes: Axes, picture: NDArray[Any] | None) -> None:
    if picture is None:
        axes.text(0.5, 0.5, 'none', ha='center', transform=axes.transAxes)
    elif picture.ndim == 3:
        axes.imshow(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), interpolation='nearest')
    else:
        axes.imshow(picture, cmap='gray', vmin=0, vmax=255, interpolation='nearest')


def _stretched(difference: NDArray[Any] | None) -> NDArray[Any] | None:
    """Scale a difference image to the range 0 to 255."""
    if difference is None:
        return None
    return difference * (255.0 / max(float(difference.max()), 1.0))
