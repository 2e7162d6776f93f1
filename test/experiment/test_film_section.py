"""The section ``film`` of a trays file."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration_file import calibrated, load_calibration
from nanorocks_ros.experiment.film_section import FilmSection, film_section
from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Frame
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

TRAY = """materials:
  beads: {density_g_cm3: 1, color_bgr: [90, 90, 90]}
trays:
  3:
    dimensions_mm: [60, 40, 2]
    species:
      - {material: beads, diameter_mm: 2, count: 24}
"""
OBLIQUE_AT = 'pixels_per_metre: 1, region_px: [0, 0, 90, 60]'
CORNERS = 'corners_px: [[0, 0], [90, 9], [80, 70], [0, 60]]'
SECTION = FilmSection(12000.0, (56, 50, 720, 480), True, False)


def test_a_section_reads_as_it_was_written_and_trays_ignore_it():
    assert film_section(SECTION.text() + TRAY) == SECTION
    assert load_trays(SECTION.text() + TRAY) == load_trays(TRAY)
    assert film_section(TRAY) is None
    assert film_section('') is None


def test_the_settings_of_a_recording_follow_from_the_file_alone():
    settings = with_values(PipelineSettings(), {'trays_file': SECTION.text() + TRAY}, 'test')
    result = recorded_settings(settings, {'trays_file'}, {}, 'bag')
    assert result.notices == ()
    assert result.settings.trays == (3,)
    assert result.settings.preprocess.regions_px == (56, 50, 720, 480)
    assert result.settings.preprocess.pixels_per_metre == 12000.0
    assert not result.settings.preprocess.stabilise


OBLIQUE = FilmSection(
    4000.0,
    (0, 0, 240, 160),
    corners_px=((60.0, 20.0), (300.0, 24.0), (330.5, 220.0), (34.0, 215.0)),
    picture_px=(360, 240),
    tray=3,
)


def test_corners_of_a_tray_that_is_seen_at_an_angle_are_a_calibration():
    text = OBLIQUE.text() + TRAY
    assert film_section(text) == OBLIQUE
    settings = with_values(PipelineSettings(), {'trays_file': text}, 'test')
    told = calibrated(recorded_settings(settings, {'trays_file'}, {}, 'bag').settings)
    assert told.preprocess.regions_px == (0, 0, 240, 160)
    assert told.preprocess.pixels_per_metre == 4000.0
    view = load_calibration(told.preprocess.calibration).view
    ends = view.source(np.array([(0.0, 0.0), (240.0, 160.0)]))
    assert ends == pytest.approx(np.array([(60.0, 20.0), (330.5, 220.0)]), abs=1e-3)


def test_a_frame_is_cut_out_as_it_is_rectified():
    frame = np.random.default_rng(1).integers(0, 255, (240, 360, 3), dtype=np.uint8)
    frame = cv2.GaussianBlur(frame, (0, 0), 4.0)
    settings = with_values(
        PipelineSettings(),
        {'trays_file': OBLIQUE.text() + TRAY, 'preprocess.stabilise': False},
        'test',
    )
    told = recorded_settings(settings, {'trays_file', 'preprocess.stabilise'}, {}, 'bag').settings
    stage = Preprocessor(told, load_trays(told.trays_file), 'test')
    (image, *_) = stage.push(Frame(stamp_ns=1, encoding='bgr8', image=frame))
    assert image.color.shape == (160, 240, 3)
    off = image.color.astype(int) - OBLIQUE.crop(frame)
    assert np.abs(off).max() <= 2


def test_what_is_told_replaces_the_section():
    values = {
        'trays_file': SECTION.text() + TRAY,
        'preprocess.pixels_per_metre': 9000.0,
    }
    settings = with_values(PipelineSettings(), values, 'test')
    result = recorded_settings(settings, set(values), {}, 'bag').settings
    assert result.preprocess.pixels_per_metre == 9000.0
    assert result.preprocess.regions_px == (56, 50, 720, 480)


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        ('film: {region_px: [1, 2, 3, 4]}\n', 'lacks pixels_per_metre'),
        ('film: {pixels_per_metre: 1, region_px: [1, 2, 3]}\n', 'a region of'),
        ('film: {pixels_per_metre: 1, region_px: [1, 2, 3, 4.5]}\n', 'a region of'),
        ('film: {pixels_per_metre: -1, region_px: [1, 2, 3, 4]}\n', 'positive'),
        ('film: {pixels_per_metre: 1, region_px: [1, 2, 3, 4], scale: so}\n', "'so'"),
        (f'film: {{{OBLIQUE_AT}, corners_px: [[1, 2], [3, 4]]}}\n', 'no four corners'),
        (f'film: {{{OBLIQUE_AT}, {CORNERS}}}\n', 'corners without picture_px'),
        (f'film: {{{OBLIQUE_AT}, {CORNERS}, picture_px: [9]}}\n', 'width and height of the film'),
        (f'film: {{pixels_per_metre: 1, region_px: [1, 2, 3, 4], {CORNERS}}}\n', 'one tray'),
    ],
)
def test_a_section_that_cannot_be_used_is_named_with_its_line(text, problem):
    with pytest.raises(ConfigurationError, match=problem) as error:
        film_section(text + TRAY)
    assert ':1' in str(error.value)
