"""Calibration files: what is written is read, and what cannot be used names its line."""

from __future__ import annotations

import math

import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration import Calibration, CameraInfo, rectified_view
from nanorocks_ros.experiment.calibration_file import (
    calibrated,
    load_calibration,
    write_calibration,
)
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.settings import PipelineSettings, with_values

INFO = CameraInfo(
    width=1920,
    height=1080,
    distortion_model='equidistant',
    d=(-0.02, 0.004, 0.0, 0.0),
    k=(1400.1, 0.0, 960.2, 0.0, 1400.1, 533.3, 0.0, 0.0, 1.0),
)
REGIONS = {1: Region(535, 102, 188, 188), 3: Region(985, 352, 400, 125)}


def calibration(**values):
    numbers = {'info': INFO, 'view': rectified_view(INFO, 'test'), 'pixels_per_metre': 12503.25}
    return Calibration(**{'regions': REGIONS, 'residual_px': 0.125, **numbers, **values})


@pytest.fixture
def path(tmp_path):
    file = tmp_path / 'mine.yaml'
    write_calibration(calibration(), file, 'made by a test')
    return file


def test_a_written_calibration_is_read_back(path):
    assert load_calibration(path) == calibration()


def test_an_unknown_residual_stays_unknown(tmp_path):
    file = tmp_path / 'mine.yaml'
    write_calibration(calibration(residual_px=math.nan), file, 'made by a test')
    assert math.isnan(load_calibration(file).residual_px)


def test_the_settings_take_scale_and_regions_from_the_file_in_the_order_of_the_trays(path):
    values = {'trays': [3, 1], 'preprocess.calibration': str(path)}
    settings = calibrated(with_values(PipelineSettings(), values, 'test')).preprocess
    assert settings.pixels_per_metre == 12503.25
    assert settings.regions_px == (*REGIONS[3], *REGIONS[1])
    assert calibrated(PipelineSettings()) == PipelineSettings()


def test_a_tray_missing_from_the_file_is_named(path):
    values = {'trays': [1, 2, 5], 'preprocess.calibration': str(path)}
    with pytest.raises(ConfigurationError, match=r'mine.yaml: holds no region of tray 2, 5; '):
        calibrated(with_values(PipelineSettings(), values, 'test'))


@pytest.mark.parametrize(
    ('old', 'new', 'line', 'message'),
    [
        ('width: 1920', 'width: wide', 3, "'wide' is no finite number"),
        ('width: 1920', 'width: 19.5', 3, 'width of 19.5 px'),
        ('equidistant', 'fov', 3, "distortion model 'fov' is not supported"),
        ('1400.1, 0.0, 960.2', '1400.1, 960.2', 7, '8 numbers; give 9'),
        ('pixels_per_metre: 12503.25', 'pixels_per_metre: -1', 9, 'a scale of -1'),
        ('pixels_per_metre: 12503.25', 'pixels: 1', 2, 'lacks pixels_per_metre'),
        ('residual_px', 'rest', 10, "unknown entry 'rest'"),
        ('1: [535', 'one: [535', 12, "tray 'one'"),
        ('535, 102, 188, 188', '535, 102, 188', 12, '3 numbers; give 4'),
        ('535, 102, 188, 188', '535.5, 102, 188, 188', 12, 'whole pixels'),
        ('535, 102, 188, 188', '535, 102, 5, 188', 12, 'the sides 8 or more'),
        ('trays:', 'trays: [', None, 'not YAML'),
    ],
)
def test_an_invalid_entry_names_its_line(path, old, new, line, message):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigurationError) as caught:
        load_calibration(path)
    assert message in str(caught.value)
    assert f'mine.yaml:{line or ""}' in str(caught.value)


def test_a_missing_calibration_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match='No such file'):
        load_calibration(tmp_path / 'none.yaml')
    with pytest.raises(ConfigurationError, match='write elsewhere'):
        write_calibration(calibration(), tmp_path / 'none' / 'mine.yaml', 'test')


def test_an_entry_that_stands_twice_is_refused(path):
    path.write_text(path.read_text() + 'pixels_per_metre: 3000.0\n')
    with pytest.raises(ConfigurationError, match="'pixels_per_metre' stands twice; remove one"):
        load_calibration(path)
