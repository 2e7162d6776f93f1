"""``nanorocks tray``: a trays file by options and guesses."""

from __future__ import annotations

import csv
import json

import cv2
import numpy as np
import pytest
from drawn_discs import SIZE, disc_frames

from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import load_trays

DARK, RED = (40, 40, 40), (30, 30, 190)


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    """A bag of dark and red discs."""
    folder = tmp_path_factory.mktemp('film') / 'discs'
    folder.mkdir()
    for number, frame in enumerate(disc_frames([RED, DARK], count=10)):
        cv2.imwrite(str(folder / f'{number}.png'), frame)
    bag = folder.parent / 'bag'
    assert main(['import', str(folder), '--rate', '30', '-o', str(bag)]) == 0
    return str(bag)


def test_without_options_all_is_guessed_and_said(film, tmp_path, capsys):
    output = tmp_path / 'mine.yaml'
    assert main(['tray', film, '-o', str(output)]) == 0
    printed = capsys.readouterr()
    (species,) = load_trays(output)[1].species
    assert species.expected == 10
    for part in ('the diameter is guessed: 2', 'no length is given', 'guessed: 10'):
        assert part in printed.err
    assert f'nanorocks measure {film} --trays-file {output}' in printed.out


def test_options_are_written_as_told_and_the_picture_shows_it(film, tmp_path, capsys):
    output, picture = tmp_path / 'mine.yaml', tmp_path / 'mine.png'
    width, height = SIZE
    arguments = [
        '--bead', '40', '45', '20', '--bead', '90', '45', '20', '--count', '5', '5',
        '--diameter-mm', '2', '2', '--density-g-cm3', '1.2', '7.8', '--corners', '0', '0',
        str(width), str(height), '--sides-mm', '36', '24', '--height-mm', '4', '--json',
    ]  # fmt: skip
    command = ['tray', film, *arguments, '-o', str(output), '--picture', str(picture)]
    assert main(command) == 0
    printed = capsys.readouterr()
    assert [row['seen'] for row in json.loads(printed.out)['species']] == [5, 5]
    tray, section = load_trays(output)[1], film_section(output)
    assert section.container_known
    assert section.pixels_per_metre == pytest.approx(10000.0)
    assert [kind.density for kind in tray.species] == pytest.approx([1200.0, 7800.0])
    assert tray.species[0].appearance.colour[2] > 150.0
    assert 'guessed' not in printed.err
    assert cv2.imread(str(picture)).shape == (height, width, 3)


def test_a_number_that_few_frames_show_is_left_open(tmp_path, capsys):
    folder, output = tmp_path / 'discs', tmp_path / 'mine.yaml'
    folder.mkdir()
    for number, frame in enumerate(disc_frames([DARK], count=12)):
        # A lid covers one more of them every other frame.
        frame[: 70 * (number % 4 > 1), : 70 * (1 + number % 4)] = 170
        cv2.imwrite(str(folder / f'{number:02d}.png'), frame)
    bag = tmp_path / 'bag'
    assert main(['import', str(folder), '--rate', '30', '-o', str(bag)]) == 0
    assert main(['tray', str(bag), '-o', str(output)]) == 0
    printed = capsys.readouterr()
    assert 'the number of beads is left open' in printed.err
    assert load_trays(output)[1].species[0].expected is None


def test_a_film_from_aside_is_rectified_by_its_corners(tmp_path, capsys):
    folder, output, table = tmp_path / 'discs', tmp_path / 'mine.yaml', tmp_path / 'tracks.csv'
    folder.mkdir()
    corners = np.array([(26.0, 18.0), (330.0, 12.0), (345.0, 230.0), (14.0, 226.0)])
    width, height = SIZE
    whole = np.float32([(0, 0), (width, 0), (width, height), (0, height)])
    tilt = cv2.getPerspectiveTransform(whole - 0.5, np.float32(corners) - 0.5)
    for number, frame in enumerate(disc_frames([DARK], count=10)):
        tilted = cv2.warpPerspective(frame, tilt, SIZE, borderValue=(170, 170, 170))
        cv2.imwrite(str(folder / f'{number:02d}.png'), tilted)
    bag = str(tmp_path / 'bag')
    assert main(['import', str(folder), '--rate', '30', '-o', bag]) == 0
    told = ['--corners', *(f'{value:g}' for value in corners.ravel())]
    told += ['--sides-mm', f'{width / 10}', f'{height / 10}', '--diameter-px', '20']
    assert main(['tray', bag, *told, '--diameter-mm', '2', '-o', str(output)]) == 0
    assert 'seen at an angle' in capsys.readouterr().err
    assert main(['track', bag, '--trays-file', str(output), '-o', str(table)]) == 0
    with table.open() as stream:
        rows = [row for row in csv.DictReader(stream) if row['frame'] == '0']
    places = np.array([(float(row['x']), float(row['y'])) for row in rows])
    drawn = np.array([(40 + 50 * (k % 6), 45 + 55 * (k // 6)) for k in range(10)]) * 1e-4
    away = np.hypot(*(drawn[:, None] - places[None]).transpose(2, 0, 1))
    assert len(rows) == 10
    assert away.min(axis=1).max() < 5e-5
    radii = np.array([float(row['radius']) for row in rows])
    assert radii == pytest.approx(1e-3, rel=0.06)


def test_an_existing_file_is_not_overwritten(film, tmp_path, capsys):
    output = tmp_path / 'mine.yaml'
    output.write_text('mine')
    assert main(['tray', film, '-o', str(output)]) == 1
    assert '--force' in capsys.readouterr().err
    assert output.read_text() == 'mine'


def test_two_ways_to_tell_the_diameter_are_refused(film, tmp_path, capsys):
    arguments = ['--bead', '40', '45', '20', '--diameter-px', '20']
    assert main(['tray', film, *arguments, '-o', str(tmp_path / 'a.yaml')]) == 2
    assert 'leave out one' in capsys.readouterr().err
