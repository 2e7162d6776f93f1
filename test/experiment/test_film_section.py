"""The section ``film`` of a trays file."""

from __future__ import annotations

import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.film_section import FilmSection, film_section
from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings, with_values

TRAY = """materials:
  beads: {density_g_cm3: 1, color_bgr: [90, 90, 90]}
trays:
  3:
    dimensions_mm: [60, 40, 2]
    species:
      - {material: beads, diameter_mm: 2, count: 24}
"""
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
    ],
)
def test_a_section_that_cannot_be_used_is_named_with_its_line(text, problem):
    with pytest.raises(ConfigurationError, match=problem) as error:
        film_section(text + TRAY)
    assert ':1' in str(error.value)
