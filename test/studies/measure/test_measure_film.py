"""``nanorocks measure``: from a film to a page, step by step, and again from what is there."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main

SIZE = 320, 240
RADIUS, FLOOR = 12.0, 210.0
RATE = 60.0
GRAVITY, RESTITUTION = 1500.0, 0.8


def ball(seconds):
    """Places of the centre of a ball that bounces on a floor, px."""
    step, height, speed, x = 1e-4, 150.0, 0.0, 40.0
    places = []
    for k in range(round(seconds / step)):
        if k % round(1.0 / (RATE * step)) == 0:
            places.append((x, FLOOR - RADIUS - height))
        height -= speed * step + 0.5 * GRAVITY * step**2
        speed += GRAVITY * step
        x += 45.0 * step
        if height < 0.0:
            late = -height / speed
            speed = RESTITUTION * (speed - GRAVITY * late)
            height, speed = speed * late - 0.5 * GRAVITY * late**2, -(speed - GRAVITY * late)
    return places


def draw(image, place, value):
    """Draw a disc, with coordinates to a sixteenth of a pixel."""
    centre = tuple(round(16.0 * (axis - 0.5)) for axis in place)
    cv2.circle(image, centre, round(16.0 * RADIUS), value, -1, cv2.LINE_AA, 4)


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    """Pictures of a dark ball that bounces on nothing visible, with a bit of noise."""
    folder = tmp_path_factory.mktemp('films') / 'ball'
    folder.mkdir()
    rng = np.random.default_rng(5)
    for number, place in enumerate(ball(3.2)):
        image = np.full((SIZE[1], SIZE[0], 3), 190, dtype=np.uint8)
        draw(image, place, (45, 45, 45))
        noisy = np.clip(image + rng.normal(0.0, 1.5, image.shape), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f'{number:04d}.png'), noisy)
    bag = folder.parent / 'bag'
    assert main(['import', str(folder), '--rate', f'{RATE:g}', '-o', str(bag)]) == 0
    return bag


@pytest.fixture(scope='module')
def measured(film, tmp_path_factory):
    """Folder of results of the film, and the exit code."""
    folder = tmp_path_factory.mktemp('out') / 'results'
    return folder, main(['measure', str(film), '--diameter-px', '24', '-o', str(folder)])


def test_a_bouncing_ball_gives_the_restitution_of_the_floor_from_its_diameter_alone(measured):
    folder, code = measured
    tray = json.loads((folder / 'measured.json').read_text())['trays']['1']
    assert code == 0
    assert tray['length_unit'] == 'px'
    assert tray['accelerated']
    assert tray['acceleration'][1] == pytest.approx(GRAVITY, rel=0.03)
    floor = tray['by_wall']['floor']
    assert floor['contacts'] >= 3
    assert floor['restitution_lower'] < RESTITUTION < floor['restitution_upper']
    assert floor['restitution_error'] < 0.03
    words = ' '.join([*tray['lines'], *tray['decay']])
    assert 'down the picture' in words
    assert 'beads: no restitution' in words
    assert 'decay: not read' in words
    assert tray['collisions'] == 0


def test_the_page_and_the_tables_hold_the_results(measured):
    folder, _ = measured
    page = (folder / 'report.html').read_text()
    for part in ('usable', 'floor', 'px/s²', 'data:image/png'):
        assert part in page
    header = (folder / 'tracks.csv').read_text().splitlines()[0]
    assert 'x_px' in header
    assert ',x,' not in header
    package = json.loads((folder / 'datapackage.json').read_text())
    units = {
        field['name']: field.get('unit')
        for resource in package['resources']
        for field in resource['schema']['fields']
    }
    assert units['mean_speed_px'] == units['speed_before_px'] == 'px/s'
    assert 'mean_speed' not in units
    rows = (folder / 'tray_1_restitutions.csv').read_text().splitlines()
    assert any(row.startswith('1,floor,') for row in rows)
    assert 'trays_file' in package['provenance']


def test_a_second_run_takes_the_tracks_of_the_first_and_gives_the_same(film, measured, capsys):
    folder, _ = measured
    before = (folder / 'measured.json').read_text()
    stamp = (folder / 'tracks.npz').stat().st_mtime_ns
    arguments = ['measure', str(film), '--diameter-px', '24', '-o', str(folder), '--json']
    assert main(arguments) == 0
    printed = capsys.readouterr()
    assert 'those of an earlier run' in printed.err
    assert (folder / 'tracks.npz').stat().st_mtime_ns == stamp
    assert (folder / 'measured.json').read_text() == before
    assert json.loads(printed.out)['trays']['1'] == json.loads(before)['trays']['1']


def test_a_damaged_archive_is_made_again(film, measured):
    folder, _ = measured
    archive = folder / 'tracks.npz'
    archive.write_bytes(archive.read_bytes()[:1000])
    assert main(['measure', str(film), '--diameter-px', '24', '-o', str(folder)]) == 0
    assert archive.stat().st_size > 1000


def test_a_film_of_unknown_beads_is_refused_with_a_command_to_paste(film, tmp_path, capsys):
    assert main(['measure', str(film), '-o', str(tmp_path / 'out')]) == 2
    error = capsys.readouterr().err
    assert f'nanorocks measure {film} --diameter-px' in error
    assert not (tmp_path / 'out').exists()


def test_a_folder_of_other_things_is_left_alone(film, tmp_path, capsys):
    (tmp_path / 'mine.txt').write_text('mine')
    assert main(['measure', str(film), '--diameter-px', '24', '-o', str(tmp_path)]) == 1
    assert 'pass another -o' in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['mine.txt']


def test_beads_that_are_not_there_are_said_and_the_exit_code_is_three(film, tmp_path):
    out = tmp_path / 'out'
    arguments = ['--diameter-px', '24', '--count', '7', '-o', str(out)]
    assert main(['measure', str(film), *arguments]) == 3
    assert 'NOT USABLE' in (out / 'report.html').read_text()


def test_what_the_decay_says_on_the_way_is_told(tmp_path, capsys):
    bag = Path(__file__).resolve().parents[3] / 'bags/tray_1_sample'
    out = tmp_path / 'out'
    wrong = ['--pixels-per-metre', '12800', '--clusters-level', '0.4']
    assert main(['measure', str(bag), *wrong, '-o', str(out)]) == 0
    said = capsys.readouterr().out
    assert 'decay: tray 1: the rulers of the scale disagree' in said
    # They are not measured here.
    assert 'cluster sizes' not in said
    lines = json.loads((out / 'measured.json').read_text())['trays']['1']['decay']
    assert any('the rulers of the scale disagree' in line for line in lines)
