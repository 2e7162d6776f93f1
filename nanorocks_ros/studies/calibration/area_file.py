"""A calibration of the binarised area as a parameter file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.outputs.atomic_files import whole_file

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.calibration.area_fit import AreaFit

# Settings of the speed that a calibration holds for.
_READING = 'geometry', 'averaging', 'averaged_frames', 'time_step', 'threshold'


def write_parameters(path: Path, fit: AreaFit, settings: PipelineSettings, remark: str) -> None:
    """Write a calibration as a ROS parameter file, with the reading that it holds for.

    Parameters
    ----------
    path : Path
        A file there is replaced.
    fit : AreaFit
    settings : PipelineSettings
        That were calibrated.
    remark : str
        What the calibration is of.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    values = {
        'method': 'binarised_area',
        **{name: getattr(settings.speed, name) for name in _READING},
        'area_factor': fit.factor,
        'area_offset': fit.offset,
    }
    lines = [
        f'# nanorocks calibrate-area: {remark}; {fit.windows} windows,',
        f'# {fit.slowest:.3g} to {fit.fastest:.3g} m/s. For this tray alone.',
        '/**:',
        '  ros__parameters:',
        '    speed:',
        *(f'      {name}: {value}' for name, value in values.items()),
    ]
    with whole_file(path) as part:
        part.write_text('\n'.join(lines) + '\n', encoding='utf-8')
