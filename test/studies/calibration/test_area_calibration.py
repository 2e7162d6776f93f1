"""The binarised area, calibrated by tracks made by hand."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.settings import PipelineSettings, SimulationSettings
from nanorocks_ros.studies.analysis.bag_tracks import track_bag
from nanorocks_ros.studies.calibration import area_calibration as study
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag

SECONDS = 9.0
# Of what is drawn, and read with running means of 3 frames.
READING = ['--speed-averaged-frames', '3']
EVERY, MARKED, JITTER_PX = 3, 12, 0.7


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('area') / 'bag'
    settings = SimulationSettings(width_px=210, height_px=210, first_shake=0.2, restitution=0.7)
    film_into_bag(path, settings, duration=SECONDS, quality=90, progress=lambda done, total: None)
    return path


@pytest.fixture(scope='module')
def marks(bag, tmp_path_factory):
    """What somebody would mark: most of the beads, in every third frame, a little off."""
    tracked = track_bag(bag, PipelineSettings())
    rng = np.random.default_rng(5)
    region = tracked.regions[1]
    lines = ['frame,id,x,y']
    for number, tracks in zip(tracked.numbers[1], tracked.tracks[1], strict=True):
        if number % EVERY == 0 and number > 6:
            positions_px = (tracks.positions + tracks.displacement) * tracked.pixels_per_metre
            positions_px += np.array([region.x, region.y]) + rng.normal(
                0.0, JITTER_PX, positions_px.shape
            )
            for bead, (x, y) in list(zip(tracks.ids.tolist(), positions_px.tolist(), strict=True))[
                :MARKED
            ]:
                lines.append(f'{number + 1},{bead},{x:.2f},{y:.2f}')
    path = tmp_path_factory.mktemp('marks') / 'hand.csv'
    path.write_text('\n'.join(lines), encoding='utf-8')
    return path


def call(bag, marks, *more):
    return ['calibrate-area', str(bag), str(marks), '--first-frame', '1', *READING, *more]


def test_calibrated_speeds_are_nearer_to_the_truth(bag, marks, tmp_path, capsys):
    file, picture = tmp_path / 'area.yaml', tmp_path / 'area.png'
    assert main(call(bag, marks, '-o', str(file), '--picture', str(picture), '--json')) == 0
    printed = json.loads(capsys.readouterr().out)
    fit = printed['trays']['1']
    assert printed['refused'] == {}
    assert fit['windows'] >= 10
    assert 0.0 < fit['slowest'] < fit['fastest'] < 0.02
    assert cv2.imread(str(picture)).shape[2] == 3

    def ratios(*flags):
        assert main(['speeds', str(bag), '--json', *flags]) == 0
        methods = json.loads(capsys.readouterr().out)['trays']['1']['methods']['binarised_area']
        return methods['ratio_to_truth'], methods['ratio_to_truth_scatter']

    raw, calibrated = ratios(*READING), ratios('--parameters', str(file))
    assert abs(calibrated[0] - 1.0) < 0.1
    assert abs(calibrated[0] - 1.0) < 0.5 * abs(raw[0] - 1.0)


def test_four_marked_beads_of_fifteen_calibrate_as_well(bag, marks, tmp_path, capsys):
    ids = sorted({int(line.split(',')[1]) for line in marks.read_text().splitlines()[1:]})[:4]
    few = [line for line in marks.read_text().splitlines()[1:] if int(line.split(',')[1]) in ids]
    (tmp_path / 'few.csv').write_text('\n'.join(['frame,id,x,y', *few]), encoding='utf-8')
    windows = []
    for file in (marks, tmp_path / 'few.csv'):
        assert main(call(bag, file, '--json')) == 0
        windows.append(json.loads(capsys.readouterr().out)['trays']['1']['windows'])
    assert windows[1] > 0.8 * windows[0]


def test_a_calibration_that_is_set_already_is_no_part_of_the_next(bag, marks, tmp_path, capsys):
    assert main(call(bag, marks, '-o', str(tmp_path / 'area.yaml'), '--json')) == 0
    once = capsys.readouterr().out
    second = call(bag, marks, '--parameters', str(tmp_path / 'area.yaml'), '--json')
    assert main(second) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(once)


def test_people_are_told_the_flags_and_what_they_rest_on(bag, marks, capsys):
    assert main(call(bag, marks)) == 0
    stdout = capsys.readouterr().out
    for text in (
        'windows, manual speeds',
        '--speed-area-factor',
        '--speed-area-offset',
        'chi square',
    ):
        assert text in stdout


def test_tracks_that_cover_too_little_are_refused_in_a_line(bag, marks, tmp_path, capsys):
    few = marks.read_text().splitlines()[: 1 + 5 * MARKED]
    (tmp_path / 'few.csv').write_text('\n'.join(few), encoding='utf-8')
    assert main(call(bag, tmp_path / 'few.csv')) == 1
    stderr = capsys.readouterr().err
    assert 'the tracks cover' in stderr.splitlines()[-1]
    assert 'mark more frames' in stderr.splitlines()[-1]


def test_tracks_elsewhere_are_refused(bag, tmp_path, capsys):
    (tmp_path / 'hand.csv').write_text('frame,id,x,y\n0,1,-50,-50\n', encoding='utf-8')
    assert main(call(bag, tmp_path / 'hand.csv')) == 1
    assert 'lie in no tray and frame' in capsys.readouterr().err


def test_a_file_that_exists_is_refused_before_the_work(bag, marks, tmp_path, capsys):
    (tmp_path / 'area.yaml').write_text('mine', encoding='utf-8')
    assert main(call(bag, marks, '-o', str(tmp_path / 'area.yaml'))) == 1
    assert 'exists already' in capsys.readouterr().err
    two = ['--trays', '1', '3', '-o', str(tmp_path / 'b.yaml')]
    (tmp_path / 'b_tray_3.yaml').write_text('mine', encoding='utf-8')
    assert main(call(bag, marks, *two)) == 1
    assert 'b_tray_3.yaml: exists already' in capsys.readouterr().err


def test_an_interruption_says_that_nothing_was_written(bag, marks, tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, 'calibrate_area', interrupted)
    assert main(call(bag, marks, '-o', str(tmp_path / 'area.yaml'))) == 130
    assert 'interrupted; nothing was written' in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
