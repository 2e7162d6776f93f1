"""What results carry, written and read back; another tray is refused."""

from __future__ import annotations

import json
import platform

import numpy as np
import pytest

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.recorded_experiment import metadata_of_settings
from nanorocks_ros.experiment.trays import load_trays, trays_text
from nanorocks_ros.outputs.tables.table_files import PACKAGE, write_package
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.results.results_provenance import (
    BAG_NAME,
    provenance_of,
    read_provenance,
    trays_of_results,
)

EPOCH_NS = 1_700_000_000_123_456_789
DEFAULT_SCALE = PipelineSettings().preprocess.pixels_per_metre
FILM = 'film: {pixels_per_metre: 5000, region_px: [0, 0, 100, 80], scale: known}\n'


def own_trays(count=20, film=''):
    return (
        'trays:\n  3:\n    dimensions_mm: [40, 30, 10]\n    species:\n'
        f'      - {{material: glass, diameter_mm: 2, count: {count}}}\n{film}'
    )


@pytest.fixture
def trays_file(tmp_path):
    path = tmp_path / 'own.yaml'
    path.write_text(own_trays())
    return path


def settings_of(trays_file, **more):
    values = {'trays': [3], 'trays_file': str(trays_file), **more}
    return with_values(PipelineSettings(), values, 'test')


def written(folder, settings, recorded=()):
    folder.mkdir(exist_ok=True)
    made = provenance_of(settings, source='film.mcap', epoch_ns=EPOCH_NS, recorded=dict(recorded))
    write_package(folder, {}, made.as_json())
    return made


def test_results_carry_trays_settings_scale_and_versions(trays_file, tmp_path):
    settings = settings_of(trays_file, **{'speed.method': 'tracking'})
    made = written(tmp_path / 'results', settings)
    trays = load_trays(str(trays_file))
    trays_file.unlink()
    read = read_provenance(tmp_path / 'results')
    assert read == made
    assert read.trays == trays
    assert read.trays[3].count == 20
    assert read.own_trays
    assert read.settings.speed.method == 'tracking'
    assert read.scale == (DEFAULT_SCALE, 'default')
    assert read.epoch_ns == EPOCH_NS
    assert read.source == 'film.mcap'
    assert read.versions['nanorocks_ros'] == __version__
    assert read.versions['python'] == platform.python_version()
    assert read.versions['numpy'] == np.__version__
    assert read.run['created']


def test_results_of_the_flight_carry_its_trays_too(tmp_path):
    made = written(tmp_path / 'results', PipelineSettings())
    assert not made.own_trays
    assert made.trays_file == trays_text()
    assert read_provenance(tmp_path / 'results').trays == {1: load_trays()[1]}


@pytest.mark.parametrize(
    ('film', 'values', 'recorded', 'source'),
    [
        (FILM, {'preprocess.pixels_per_metre': 5000.0}, {}, 'trays file'),
        (FILM, {'preprocess.pixels_per_metre': 4000.0}, {}, 'settings'),
        (
            '',
            {'preprocess.pixels_per_metre': 4000.0},
            {'experiment.pixels_per_metre': '4000.0'},
            'recording',
        ),
        ('', {}, {}, 'default'),
    ],
)
def test_results_say_where_the_scale_is_from(tmp_path, film, values, recorded, source):
    path = tmp_path / 'own.yaml'
    path.write_text(own_trays(film=film))
    scale = written(tmp_path / 'results', settings_of(path, **values), recorded).scale
    assert scale.source == source
    assert scale.pixels_per_metre == values.get('preprocess.pixels_per_metre', DEFAULT_SCALE)


def test_results_of_an_earlier_version_carry_their_trays_in_the_bag(trays_file, tmp_path):
    metadata = {'nanorocks_ros': '0.2.0', 'source': 'film.mcap'}
    metadata |= metadata_of_settings(settings_of(trays_file))
    with BagWriter(tmp_path / 'results' / BAG_NAME, {}, metadata=metadata):
        pass
    read = read_provenance(tmp_path / 'results')
    assert read.trays == load_trays(str(trays_file))
    assert read.versions == {'nanorocks_ros': '0.2.0'}
    assert read.source == 'film.mcap'


def test_tables_without_a_tray_take_what_is_told(trays_file, tmp_path):
    assert read_provenance(tmp_path) is None
    assert trays_of_results(tmp_path) == load_trays()
    assert trays_of_results(tmp_path, str(trays_file)) == load_trays(str(trays_file))


def test_another_tray_is_refused_with_a_line_that_names_both(trays_file, tmp_path):
    folder = tmp_path / 'results'
    written(folder, settings_of(trays_file))
    other = tmp_path / 'other.yaml'
    other.write_text(own_trays(count=21))
    with pytest.raises(ConfigurationError) as error:
        trays_of_results(folder, str(other))
    text = str(error.value)
    assert str(other) in text
    assert str(folder) in text
    assert 'tray 3' in text
    assert '\n' not in text


def test_the_same_tray_under_another_name_is_taken(trays_file, tmp_path):
    folder = tmp_path / 'results'
    written(folder, settings_of(trays_file))
    same = tmp_path / 'same.yaml'
    same.write_text(f'# The same.\n{own_trays()}')
    assert trays_of_results(folder, str(same)) == load_trays(str(same))


@pytest.mark.parametrize('content', ['', '{', '{"provenance": {"trays_file": 1}}'])
def test_a_damaged_description_is_an_error_in_one_line(tmp_path, content):
    (tmp_path / PACKAGE).write_text(content)
    with pytest.raises(RecordingError, match=r'description of results; analyse'):
        read_provenance(tmp_path)


def test_a_setting_of_another_version_says_nothing(trays_file, tmp_path):
    written(tmp_path / 'results', settings_of(trays_file))
    path = tmp_path / 'results' / PACKAGE
    content = json.loads(path.read_text())
    content['provenance']['settings']['tracking.from_the_future'] = 1
    path.write_text(json.dumps(content))
    assert read_provenance(tmp_path / 'results').trays[3].count == 20
