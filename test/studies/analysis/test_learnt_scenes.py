"""Films of beads of any look, from the video to tracks and a verdict."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.drawn_scenes import DrawnScene, draw
from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.recordings.bag.bag_folder import read_metadata
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.scene_frames import scene_frames

STRUCK = DrawnScene(
    floor=(40, 120, 35),
    colours=((210, 210, 215),),
    count=8,
    radii=(12.0, 12.0),
    at_rest=0.6,
    speed=5.0,
    frames=90,
)
TRAY = 'trays:\n  1:\n    dimensions_mm: [{}, {}]\n    species:\n      - {{{}}}\n'


def imported(folder, frames, species, *, scale=1000.0):
    """A bag of the frames, which knows its trays file; the scale is in px/m."""
    video = folder / 'film.avi'
    size = frames[0].shape[1], frames[0].shape[0]
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter_fourcc(*'MJPG'), 30, size)
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, 95)
    for frame in frames:
        writer.write(frame)
    writer.release()
    sides = (1e3 * length / scale for length in size)
    (folder / 'mine.yaml').write_text(TRAY.format(*sides, species), encoding='utf-8')
    bag = folder / 'bag'
    call = [
        'import',
        str(video),
        '-o',
        str(bag),
        '--trays',
        '1',
        '--pixels-per-metre',
        f'{scale:g}',
    ]
    assert main([*call, '--trays-file', str(folder / 'mine.yaml')]) == 0
    return bag


@pytest.fixture(scope='module')
def struck(tmp_path_factory):
    pytest.importorskip('av')
    frames, truth = draw(STRUCK)
    bag = imported(tmp_path_factory.mktemp('struck'), frames, 'diameter_mm: 24, look: auto')
    return bag, truth


def test_balls_struck_from_rest_keep_their_numbers(struck, tmp_path, capsys):
    bag, truth = struck
    table = tmp_path / 'tracks.csv'
    assert main(['track', str(bag), '-o', str(table), '--json']) == 0
    tray = json.loads(capsys.readouterr().out)['trays']['1']
    assert tray['species'][0]['expected'] is None
    assert tray['species'][0]['tracks'] == STRUCK.count
    assert tray['recognition'][0]['usable']
    with table.open(encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    beads = {}
    for row in rows:
        place = 1e3 * np.array([float(row['x']), float(row['y'])]) - 0.5
        apart = np.hypot(*(truth[int(row['frame'])][:, :2] - place).T)
        assert apart.min() < 1.0
        beads.setdefault(row['id'], set()).add(int(apart.argmin()))
    assert sorted(beads.values(), key=min) == [{k} for k in range(STRUCK.count)]


def test_frames_to_learn_from_are_spread_over_the_film(struck):
    bag, _ = struck
    settings, _, _ = recorded_settings(
        PipelineSettings(), frozenset(), read_metadata(bag), str(bag)
    )
    frames = scene_frames(bag, settings)[1]
    assert 25 <= len(frames) <= 35
    assert frames[0].shape == (300, 400, 3)
    assert scene_frames(bag, replace(settings, trays_file='')) == {}


@pytest.mark.parametrize('scale', [20.0, 1e7])
def test_rooms_and_microscopes_are_followed(scale, tmp_path, capsys):
    pytest.importorskip('av')
    frames, _ = draw(replace(STRUCK, at_rest=0.0, speed=2.0, frames=30))
    species = f'diameter_mm: {24e3 / scale:g}, look: auto, count: {STRUCK.count}'
    bag = imported(tmp_path, frames, species, scale=scale)
    capsys.readouterr()
    assert main(['track', str(bag), '--json']) == 0
    counts = json.loads(capsys.readouterr().out)['trays']['1']['species'][0]
    assert counts['seen'] > 0.97 * STRUCK.count
    assert counts['tracks'] == STRUCK.count


def test_a_film_without_beads_is_done_but_not_usable(tmp_path, capsys):
    pytest.importorskip('av')
    frames, _ = draw(DrawnScene(count=0, frames=25))
    bag = imported(tmp_path, frames, 'diameter_mm: 18, look: auto, count: 20')
    capsys.readouterr()
    assert main(['track', str(bag)]) == 3
    printed = capsys.readouterr().out
    assert 'NOT USABLE' in printed
    assert 'nothing_seen: no bead was recognised' in printed
