"""Parameter file of a calibration of the binarised area.

Tested by ``test/studies/calibration/test_area_calibration.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.calibration.area_fit import AreaFit

# Settings of the speed for which a calibration is valid.
_AREA_SETTINGS = 'geometry', 'averaging', 'averaged_frames', 'time_step', 'threshold'


def write_parameters(path: Path, fit: AreaFit, settings: PipelineSettings, remark: str) -> None:
    """Write a calibration as a ROS parameter file, with the settings for which it is valid.

    Parameters
    ----------
    path : Path
        An existing file is replaced.
    fit : AreaFit
    settings : PipelineSettings
        Settings that were calibrated.
    remark : str
        Description of the calibration, for a comment in the file.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    values = {
        'method': 'binarised_area',
        **{name: getattr(settings.speed, name) for name in _AREA_SETTINGS},
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
    with atomic_file(path) as part:
        part.write_text('\n'.join(lines) + '\n', encoding='utf-8')
