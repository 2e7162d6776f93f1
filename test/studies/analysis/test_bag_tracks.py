"""Tracks of a bag, as tables and as a picture."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.outputs.tables import parquet as parquet_files
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.records import NS
from nanorocks_ros.settings import PipelineSettings, SimulationSettings
from nanorocks_ros.studies.analysis.bag_tracks import track_bag
from nanorocks_ros.studies.analysis.results.tracks_files import COLUMNS, write_tracks
from nanorocks_ros.studies.inspection.track_overlay import overlay
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag
from nanorocks_ros.wire import topics

FRAMES = 40


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """A short film of tray 1, in a small picture."""
    path = tmp_path_factory.mktemp('tracks') / 'bag'
    settings = SimulationSettings(width_px=260, height_px=260, first_shake=0.2)
    film_into_bag(
        path, settings, duration=FRAMES / 30.0, quality=90, progress=lambda done, total: None
    )
    return path


@pytest.fixture(scope='module')
def bag_tracks(bag):
    return track_bag(bag, PipelineSettings())


def _rows(path):
    with path.open(encoding='utf-8') as stream:
        return list(csv.DictReader(stream))


def test_every_frame_of_the_bag_has_tracks_of_all_beads(bag_tracks):
    assert bag_tracks.frames == FRAMES
    assert bag_tracks.numbers[1] == list(range(FRAMES))
    assert [tracks.ids.size for tracks in bag_tracks.tracks[1]] == [15] * FRAMES


def test_a_table_holds_what_was_tracked(bag_tracks, tmp_path):
    write_tracks(tmp_path / 'tracks.csv', bag_tracks)
    rows = _rows(tmp_path / 'tracks.csv')
    assert list(rows[0]) == [column.name for column in COLUMNS]
    assert len(rows) == 15 * FRAMES
    last = bag_tracks.tracks[1][-1]
    shown = [(float(row['x']), float(row['y'])) for row in rows if int(row['frame']) == FRAMES - 1]
    np.testing.assert_allclose(shown, last.positions, rtol=1e-6)
    assert rows[0]['vx'] == ''
    assert rows[0]['species'] == 'acrylic'
    assert float(rows[-1]['time']) == pytest.approx((FRAMES - 1) / 30.0, abs=1e-6)


def test_parquet_and_csv_hold_the_same(bag_tracks, tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    write_tracks(tmp_path / 'tracks.csv', bag_tracks)
    write_tracks(tmp_path / 'tracks.parquet', bag_tracks)
    table = parquet.read_table(tmp_path / 'tracks.parquet').to_pydict()
    rows = _rows(tmp_path / 'tracks.csv')
    assert [str(bead) for bead in table['id']] == [row['id'] for row in rows]
    assert [str(seen).lower() for seen in table['seen']] == [row['seen'] for row in rows]
    assert table['time'] == [float(row['time']) for row in rows]
    np.testing.assert_allclose(table['radius'], [float(row['radius']) for row in rows], rtol=1e-6)
    assert table['species'] == [row['species'] for row in rows]
    # Where CSV leaves a field empty.
    assert np.isnan(table['vx'][0])
    # One group of rows for a frame each would make the file many times as large.
    assert parquet.ParquetFile(tmp_path / 'tracks.parquet').num_row_groups == 1


def test_parquet_in_many_groups_of_rows_reads_the_same(bag_tracks, tmp_path, monkeypatch):
    parquet = pytest.importorskip('pyarrow.parquet')
    write_tracks(tmp_path / 'one.parquet', bag_tracks)
    monkeypatch.setattr(parquet_files, '_GROUP_ROWS', 100)
    write_tracks(tmp_path / 'many.parquet', bag_tracks)
    # Seven frames of 15 beads are the first 100 rows.
    assert parquet.ParquetFile(tmp_path / 'many.parquet').num_row_groups == -(-FRAMES // 7)
    whole, many = (parquet.read_table(tmp_path / f'{name}.parquet') for name in ('one', 'many'))
    assert whole['id'].to_pylist() == many['id'].to_pylist()
    assert whole['species'].to_pylist() == many['species'].to_pylist()


def test_without_pyarrow_the_command_refuses_before_it_tracks(bag, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    assert main(['track', str(bag), '-o', str(tmp_path / 'tracks.parquet')]) == 2
    errors = capsys.readouterr().err
    assert errors.count('\n') == 1
    assert "choose another ending, or run: pip install 'nanorocks_ros[parquet]'" in errors


def test_the_overlay_draws_a_ring_around_each_bead_and_leaves_the_rest(bag_tracks):
    image, tracks = bag_tracks.pictures[1], bag_tracks.tracks[1]
    bare = overlay(image, [], bag_tracks.pixels_per_metre)
    drawn = overlay(image, tracks[-1:], bag_tracks.pixels_per_metre)
    changed = (bare != drawn).any(axis=2)
    rows, columns = np.nonzero(changed)
    places = tracks[-1].positions * bag_tracks.pixels_per_metre * 3
    radii = tracks[-1].radii * bag_tracks.pixels_per_metre * 3
    apart = np.hypot(columns[:, None] + 0.5 - places[:, 0], rows[:, None] + 0.5 - places[:, 1])
    assert np.abs(apart - radii).min(axis=1).max() < 3.5
    for k in range(15):
        assert np.count_nonzero(np.abs(apart[:, k] - radii[k]) < 2.0) > 0.8 * 2 * np.pi * radii[k]
    hidden = replace(tracks[-1], seen=np.zeros(15, dtype=bool))
    assert (overlay(image, [hidden], bag_tracks.pixels_per_metre)[changed] != drawn[changed]).any()


def test_the_command_prints_compares_and_writes(bag, tmp_path, capsys, bag_tracks):
    region = bag_tracks.regions[1]
    marks = ['frame,id,x,y']
    for number, tracks in zip(bag_tracks.numbers[1], bag_tracks.tracks[1], strict=True):
        places = (tracks.positions + tracks.displacement) * bag_tracks.pixels_per_metre
        for bead, (x, y) in zip(tracks.ids.tolist(), places.tolist(), strict=True):
            marks.append(f'{number},{bead},{x + region.x},{y + region.y}')
    (tmp_path / 'hand.csv').write_text('\n'.join(marks), encoding='utf-8')
    table, picture = tmp_path / 'out.csv', tmp_path / 'out.png'
    call = ['track', str(bag), '-o', str(table), '--picture', str(picture), '--json']
    assert main([*call, '--compare', str(tmp_path / 'hand.csv')]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['frames'] == FRAMES
    tray = printed['trays']['1']
    assert tray['species'][0]['seen'] == pytest.approx(15.0)
    assert tray['comparison']['found'] == 1.0
    assert tray['comparison']['rms_distance'] < 1e-6
    assert tray['comparison']['switches'] == 0
    assert len(_rows(table)) == 15 * FRAMES
    assert cv2.imread(str(picture)).shape[2] == 3
    assert main(call) == 1
    assert 'exists already' in capsys.readouterr().err


def test_marks_outside_every_tray_are_refused(bag, tmp_path, capsys):
    (tmp_path / 'hand.csv').write_text('frame,id,x,y\n0,1,-50,-50\n', encoding='utf-8')
    assert main(['track', str(bag), '--compare', str(tmp_path / 'hand.csv')]) == 1
    assert 'lie in no tray' in capsys.readouterr().err


def test_a_wrong_ending_is_a_wrong_call(bag, tmp_path, capsys):
    assert main(['track', str(bag), '-o', str(tmp_path / 'tracks.xls')]) == 2
    assert '.csv' in capsys.readouterr().err


def test_a_bag_that_is_not_there_is_refused():
    with pytest.raises(RecordingError):
        track_bag('nowhere', PipelineSettings())


def test_a_gray_camera_is_refused_with_the_remedy(tmp_path):
    names = (topics.EPOCH, topics.RAW)
    path = tmp_path / 'gray'
    rng = np.random.default_rng(1)
    with BagWriter(
        path, {name.absolute(): offered_topic(name) for name in names}, metadata={}
    ) as bag:
        bag.write(topics.EPOCH.absolute(), NS, time_message(NS))
        for number in range(4):
            pixels = rng.integers(90, 110, (210, 210), dtype=np.uint8)
            stamp_ns = NS + number * NS // 30
            message = image_message(stamp_ns, 'camera', 'mono8', pixels)
            bag.write(topics.RAW.absolute(), stamp_ns, message)
    with pytest.raises(FrameError, match=r'the camera is gray.*record in colour'):
        track_bag(path, PipelineSettings())
