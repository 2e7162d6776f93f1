"""A bag of each film of a campaign, made once, and never taken for that of another film."""

from __future__ import annotations

import errno
import json
import os
import shutil
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from videos import (
    CALIBRATION,
    START_NS,
    STARTED,
    number_of,
    write_images,
    write_video,
)

from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.calibration_file import load_calibration
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.find_films import films_of
from nanorocks_ros.studies.film_import.import_each import import_each
from nanorocks_ros.studies.film_import.import_film import import_films

NS = 1_000_000_000


def test_each_video_of_a_folder_becomes_a_bag_and_bad_ones_stop_nothing(tmp_path):
    folder = tmp_path / 'videos'
    folder.mkdir()
    for k in (10, 9, 1):
        write_video(folder / f'run {k}.avi', range(k, k + 3))
    (folder / 'run 2.avi').write_bytes(b'no video')
    (folder / 'read me.txt').write_text('left alone')
    write_images(folder / 'stills', [f'{1_700_000_000_000 + 40 * k}.jpg' for k in range(3)])
    films = films_of([folder]).films
    assert [film.stem for film in films] == ['run 1', 'run 2', 'run 9', 'run 10', 'stills']
    told = []
    found = import_each(films, tmp_path / 'bags', STARTED, lambda *one: told.append(one))
    assert [one.bag.name for one in found.imported] == ['run 1', 'run 9', 'run 10', 'stills']
    assert list(found.failed) == [folder / 'run 2.avi']
    assert told[-1] == (1.0, 'stills')
    frames = BagFrames(tmp_path / 'bags' / 'run 9').frames()
    assert [number_of(frame.image) for frame in frames] == [9, 10, 11]
    # Once more: nothing is made twice, and what failed is tried again.
    write_video(folder / 'run 2.avi', range(2))
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / 'bags').rglob('*.mcap')}
    again = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert [one.bag.name for one in again.imported] == ['run 2']
    assert len(again.skipped) == 4
    assert not again.failed
    assert all(one.stat().st_mtime_ns == stamp for one, stamp in before.items())
    assert sorted(os.listdir(tmp_path / 'bags')) == sorted(film.stem for film in films)


def test_a_bag_of_another_video_is_not_taken_for_ours(tmp_path):
    films = [write_video(tmp_path / 'a.avi', range(3))]
    import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    write_video(tmp_path / 'a.avi', range(5))
    found = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert 'was made of another a.avi' in str(found.failed[films[0]])
    shutil.rmtree(tmp_path / 'bags' / 'a')
    write_video(tmp_path / 'b.avi', range(3))
    import_films([tmp_path / 'b.avi'], tmp_path / 'bags' / 'a', STARTED, lambda _: None)
    found = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert 'is there already, but not as the bag of a.avi' in str(found.failed[films[0]])


def test_videos_that_differ_in_their_ending_alone_get_bags_of_their_own(tmp_path):
    films = [write_video(tmp_path / name, range(2)) for name in ('a.avi', 'a.mkv')]
    found = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert [one.bag.name for one in found.imported] == ['a_avi', 'a_mkv']


def uncompressed(folder, numbers):
    """A film whose size does not depend on what it shows."""
    folder.mkdir(exist_ok=True)
    return write_video(folder / 'run.avi', numbers, codec='rawvideo', form='bgr24')


@pytest.mark.parametrize('kind', ['film', 'images'])
def test_a_film_of_the_same_name_and_size_is_told_by_its_contents(tmp_path, kind):
    bags, days = tmp_path / 'bags', []
    for day, first in (('monday', 0), ('tuesday', 50)):
        if kind == 'film':
            days.append(uncompressed(tmp_path / day, range(first, first + 4)))
        else:
            (tmp_path / day).mkdir()
            names = [f'{START_NS + 40_000_000 * k}.bmp' for k in range(first, first + 4)]
            days.append(write_images(tmp_path / day / 'run', names))
            (days[-1] / names[0]).write_bytes((days[-1] / names[first // 50]).read_bytes())
    import_each(days[:1], bags, STARTED, lambda *_: None)
    found = import_each(days[1:], bags, STARTED, lambda *_: None)
    said = str(found.failed[days[1]])
    assert f'was made of another {days[1].name} (of the same size, with other contents)' in said
    assert 'delete it, or pass another folder' in said
    # The first is still known.
    assert import_each(days[:1], bags, STARTED, lambda *_: None).skipped == [bags / days[0].stem]


@pytest.mark.parametrize(('change', 'what'), [
    ({'rate': Fraction(60)}, '--rate was not given, is 60'),
    ({'start_ns': START_NS + NS}, '--start was 2023-11-14T22:13:20Z, is 2023-11-14T22:13:21Z'),
    ({'start_ns': None}, '--start was 2023-11-14T22:13:20Z, is not given'),
    ({'quality': 80}, '--quality was 95, is 80'),
])  # fmt: skip
def test_a_bag_of_other_settings_is_not_taken_for_what_is_wanted(tmp_path, change, what):
    films = [write_video(tmp_path / 'a.mkv', range(3), codec='ffv1', form='bgr0')]
    import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    found = import_each(films, tmp_path / 'bags', replace(STARTED, **change), lambda *_: None)
    assert f'was imported with other settings ({what}); delete it' in str(found.failed[films[0]])
    assert not found.skipped


def test_a_bag_of_another_calibration_is_not_taken_for_what_is_wanted(tmp_path):
    def settings(content):
        (tmp_path / 'lens.yaml').write_text(content)
        lens = load_calibration(tmp_path / 'lens.yaml')
        return ImportSettings(start_ns=START_NS, calibration=lens, calibration_name='lens.yaml')

    def said(settings):
        found = import_each(films, tmp_path / 'bags', settings, lambda *_: None)
        return ''.join(str(error) for error in found.failed.values())

    films = [write_video(tmp_path / 'a.avi', range(3))]
    assert said(settings(CALIBRATION)) == said(settings(CALIBRATION)) == ''
    # JPEGs go in as they are, so their quality says nothing.
    assert said(replace(settings(CALIBRATION), quality=50)) == ''
    assert '--calibration was lens.yaml, is not given' in said(STARTED)
    other = settings(CALIBRATION.replace('0.01', '0.02'))
    assert '--calibration was lens.yaml, is one of that name with other contents' in said(other)


# --- what is looked for -----------------------------------------------------------------------


def test_films_of_all_formats_are_found_and_what_may_be_one_is_named(tmp_path, capsys):
    folder = tmp_path / 'films'
    folder.mkdir()
    for name, codec in (('a.mp4', 'mpeg4'), ('b.asf', 'mpeg4'), ('c.flv', 'flv1'),
                        ('d.NUT', 'ffv1'), ('e.h264', 'libx264')):  # fmt: skip
        path = write_video(folder / name.lower(), range(3), codec=codec)
        path.rename(folder / name)
    for name in ('notes.txt', 'lens.yaml', 'times.json', '.hidden.mov'):
        (folder / name).write_text('no film')
    shutil.copy(folder / 'a.mp4', folder / 'copy of a')
    (folder / 'thumb.jpg').write_bytes(b'beside a film, a picture is none')
    (folder / 'old.m2v').write_bytes(b'of a format that is not read')
    code = main(['import', str(folder), '--each', '-o', str(tmp_path / 'bags'), '--rate', '25',
                 '--json'])  # fmt: skip
    out, err = capsys.readouterr()
    assert code == 0
    printed = json.loads(out)
    assert [os.path.basename(one['bag']) for one in printed['imported']] == list('abcde')
    others = ['copy of a', 'old.m2v', 'thumb.jpg']
    assert [os.path.basename(one) for one in printed['left_out']] == others
    assert f'left out 3 files that may be films or pictures of one, but not by their names ' \
        f'({", ".join(others)})' in err  # fmt: skip
    assert 'notes' not in err


def close(monkeypatch, folder):
    """Let nobody look into a folder, as it is for all but root where they have no permission."""
    really = Path.iterdir

    def iterdir(path):
        if path == folder:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return really(path)

    monkeypatch.setattr(Path, 'iterdir', iterdir)


def test_what_a_system_keeps_on_a_disk_for_itself_is_nobodys_concern(tmp_path, monkeypatch):
    folder = tmp_path / 'films'
    (folder / 'lost+found').mkdir(parents=True)
    film = write_video(folder / 'a.avi', range(3))
    close(monkeypatch, folder / 'lost+found')
    found = films_of([folder])
    assert (found.films, found.failed) == ([film], {})


@pytest.mark.parametrize('passed', ['the folder', 'what is in it'])
def test_a_folder_that_cannot_be_read_costs_no_other(tmp_path, capsys, monkeypatch, passed):
    folder = tmp_path / 'films'
    closed = folder / 'lost'
    closed.mkdir(parents=True)
    for name in ('a.avi', 'z.avi'):
        write_video(folder / name, range(3))
    paths = [folder] if passed == 'the folder' else sorted(folder.iterdir())
    close(monkeypatch, closed)
    code = main(['import', *map(str, paths), '--each', '-o', str(tmp_path / 'bags'), '--json'])
    out, err = capsys.readouterr()
    printed = json.loads(out)
    assert code == 1
    assert [os.path.basename(one['bag']) for one in printed['imported']] == ['a', 'z']
    (failed,) = printed['failed']
    assert failed['video'] == str(closed)
    assert (
        failed['reason'] == f'{closed}: cannot be read (Permission denied); check its permissions'
    )
    assert '1 of 3 videos could not be imported' in err


def test_a_folder_of_which_nothing_can_be_read_is_said_in_one_line(tmp_path, capsys, monkeypatch):
    closed = tmp_path / 'films'
    closed.mkdir()
    close(monkeypatch, closed)
    assert main(['import', str(closed), '--each', '-o', str(tmp_path / 'bags')]) == 1
    said = capsys.readouterr().err.strip()
    assert (
        said == f'nanorocks: {closed}: cannot be read (Permission denied); check its permissions'
    )
    assert not (tmp_path / 'bags').exists()
