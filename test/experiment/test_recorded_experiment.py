"""A recording says which trays it shows; what is told wins."""

from __future__ import annotations

import pytest

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.recorded_experiment import (
    experiment_metadata,
    metadata_of_settings,
    recorded_settings,
)
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings, with_values

OWN_TRAY = """\
trays:
  2:
    dimensions_mm: [16, 16, 3.5]
    species:
      - {material: acrylic, diameter_mm: 2, count: 12}
"""
CALIBRATION = """\
camera_info:
  width: 640
  height: 480
  distortion_model: equidistant
  d: [0.0, 0.0, 0.0, 0.0]
  k: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]
pixels_per_metre: 9000.0
trays:
  1: [10, 20, 135, 135]
  4: [200, 20, 432, 135]
"""


def completed(metadata, **told):
    told = {name.replace('__', '.'): value for name, value in told.items()}
    settings = with_values(PipelineSettings(), told, 'test')
    return recorded_settings(settings, told.keys(), metadata, 'bag')


def test_every_setting_of_the_experiment_comes_back():
    settings = with_values(
        PipelineSettings(),
        {
            'trays': [1, 4],
            'preprocess.regions_px': [0, 0, 100, 90, 150, 0, 200, 90],
            'preprocess.pixels_per_metre': 9000.0,
        },
        'test',
    )
    back = recorded_settings(PipelineSettings(), (), metadata_of_settings(settings), 'bag')
    assert back.settings == settings
    assert back.notices == ()
    assert back.trays_known


def test_a_layout_comes_back():
    metadata = experiment_metadata({'trays': [1, 2], 'preprocess.layout': 'plate'})
    assert completed(metadata).settings.preprocess.layout == 'plate'


def test_the_content_of_a_trays_file_is_kept_and_not_its_path(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text(OWN_TRAY)
    expected = load_trays(path)
    metadata = experiment_metadata({'trays': [2], 'trays_file': str(path)})
    path.unlink()
    settings = completed(metadata).settings
    assert settings.trays == (2,)
    assert load_trays(settings.trays_file) == expected
    # A recording of such a recording keeps it as well.
    assert metadata_of_settings(settings)['experiment.trays_file'] == OWN_TRAY


def test_a_calibration_is_kept_with_its_trays(tmp_path):
    path = tmp_path / 'lens.yaml'
    path.write_text(CALIBRATION)
    metadata = experiment_metadata({'preprocess.calibration': str(path)})
    path.unlink()
    settings = completed(metadata).settings
    assert settings.trays == (1, 4)
    assert settings.preprocess.calibration == CALIBRATION


def test_a_told_scale_replaces_a_stored_calibration():
    metadata = experiment_metadata({'preprocess.calibration': CALIBRATION})
    settings = completed(metadata, preprocess__pixels_per_metre=8000.0).settings
    assert settings.preprocess.calibration == ''
    assert settings.preprocess.pixels_per_metre == 8000.0


def test_some_of_the_trays_may_be_chosen_with_their_regions():
    regions = [0, 0, 100, 90, 150, 0, 200, 90]
    metadata = experiment_metadata({'trays': [1, 4], 'preprocess.regions_px': regions})
    chosen = completed(metadata, trays=[4])
    assert chosen.settings.preprocess.regions_px == (150, 0, 200, 90)
    assert chosen.notices == ()


def test_what_is_told_wins_and_the_contradiction_is_one_line():
    metadata = experiment_metadata({'trays': [3], 'preprocess.pixels_per_metre': 9000.0})
    result = completed(metadata, trays=[1], preprocess__pixels_per_metre=8000.0)
    assert result.settings.trays == (1,)
    assert result.settings.preprocess.pixels_per_metre == 8000.0
    (notice,) = result.notices
    assert 'says trays 3' in notice
    assert 'trays 1' in notice
    assert '9000.0' in notice
    assert '8000.0' in notice
    assert '\n' not in notice


def test_other_beads_told_are_a_contradiction(tmp_path):
    metadata = experiment_metadata({'trays': [2], 'trays_file': OWN_TRAY})
    path = tmp_path / 'other.yaml'
    path.write_text(OWN_TRAY.replace('12', '13'))
    result = completed(metadata, trays_file=str(path))
    assert load_trays(result.settings.trays_file)[2].count == 13
    assert len(result.notices) == 1
    path.write_text(OWN_TRAY)
    assert completed(metadata, trays_file=str(path)).notices == ()


def test_an_unknown_tray_is_assumed_aloud():
    result = completed({'source': 'film.avi'})
    assert result.settings == PipelineSettings()
    assert not result.trays_known
    (notice,) = result.notices
    assert 'tray 1 is assumed' in notice
    assert '--trays' in notice
    assert completed({}, trays=[1]).notices == ()


@pytest.mark.parametrize(
    ('metadata', 'trays', 'layout', 'scale'),
    [
        (
            {'nanorocks_ros': '0.1.0', 'tray': '3', 'pixels_per_metre': '9000.0'},
            (3,),
            'centred',
            9000.0,
        ),
        (
            {
                'nanorocks_ros': '0.1.0',
                'scene.trays': '(1, 4)',
                'scene.pixels_per_metre': '12500.0',
            },
            (1, 4),
            'plate',
            12500.0,
        ),
        ({'tray': '3', 'pixels_per_metre': '9000.0'}, (1,), 'centred', 13500.0),
        ({'nanorocks_ros': '0.1.0', 'tray': 'left'}, (1,), 'centred', 13500.0),
        ({'nanorocks_ros': '0.1.0', 'import': 'complete'}, (1,), 'centred', 13500.0),
    ],
)
def test_recordings_of_before_say_what_they_can(metadata, trays, layout, scale):
    settings = completed(metadata).settings
    assert settings.trays == trays
    assert settings.preprocess.layout == layout
    assert settings.preprocess.pixels_per_metre == scale


@pytest.mark.parametrize(
    ('key', 'text'),
    [
        ('trays', ''),
        ('trays', 'all'),
        ('trays', '0'),
        ('trays', '1 1'),
        ('trays', '9' * 400),
        ('trays', '1 ' * 100_000),
        ('layout', 'upside down'),
        ('layout', 'x' * 5000),
        ('pixels_per_metre', 'nan'),
        ('pixels_per_metre', '[1, 2]'),
        ('pixels_per_metre', '-4'),
        ('regions_px', '1 2 3'),
        ('regions_px', '1 2 3 x'),
        ('trays_file', '[' * 50_000),
        ('trays_file', 'trays: {1: 3}'),
        ('trays_file', 'x' * 10_000_000),
        ('trays_file', '/etc/passwd'),
        ('calibration', 'a: &a [*a]'),
        ('calibration', '\x00\n'),
    ],
)
def test_hostile_entries_end_in_one_line_with_a_remedy(key, text):
    metadata = {'experiment.trays': '1', f'experiment.{key}': text}
    with pytest.raises(RecordingError) as caught:
        completed(metadata)
    line = str(caught.value)
    assert f'experiment.{key}' in line
    assert 'which replaces it' in line
    assert '\n' not in line
    assert len(line) < 500


def test_what_is_told_replaces_an_entry_that_cannot_be_used():
    assert completed({'experiment.trays': 'all'}, trays=[3]).settings.trays == (3,)


def test_a_file_that_does_not_exist_cannot_be_kept():
    with pytest.raises(ConfigurationError, match=r'nowhere\.yaml'):
        experiment_metadata({'trays': [1], 'trays_file': 'nowhere.yaml'})
