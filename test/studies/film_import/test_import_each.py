"""Import of many films into one bag each; existing bags are checked against their film."""

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
from nanorocks_ros.studies.film_import.find_films import find_films
from nanorocks_ros.studies.film_import.import_each import import_each
from nanorocks_ros.studies.film_import.import_film import import_films

NS = 1_000_000_000


def test_each_video_of_a_folder_is_imported_and_invalid_ones_are_listed(tmp_path):
    folder = tmp_path / 'videos'
    folder.mkdir()
    for k in (10, 9, 1):
        write_video(folder / f'run {k}.avi', range(k, k + 3))
    (folder / 'run 2.avi').write_bytes(b'no video')
    (folder / 'read me.txt').write_text('not a video')
    write_images(folder / 'stills', [f'{1_700_000_000_000 + 40 * k}.jpg' for k in range(3)])
    films = find_films([folder]).films
    assert [film.stem for film in films] == ['run 1', 'run 2', 'run 9', 'run 10', 'stills']
    calls = []
    batch = import_each(films, tmp_path / 'bags', STARTED, lambda *call: calls.append(call))
    assert [result.bag.name for result in batch.imported] == ['run 1', 'run 9', 'run 10', 'stills']
    assert list(batch.failed) == [folder / 'run 2.avi']
    assert calls[-1] == (1.0, 'stills')
    frames = BagFrames(tmp_path / 'bags' / 'run 9').frames()
    assert [number_of(frame.image) for frame in frames] == [9, 10, 11]
    # The second time, complete bags are skipped and failed films are imported again.
    write_video(folder / 'run 2.avi', range(2))
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / 'bags').rglob('*.mcap')}
    again = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert [result.bag.name for result in again.imported] == ['run 2']
    assert len(again.skipped) == 4
    assert not again.failed
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in before.items())
    assert sorted(os.listdir(tmp_path / 'bags')) == sorted(film.stem for film in films)


def test_the_bag_of_another_video_is_refused(tmp_path):
    films = [write_video(tmp_path / 'a.avi', range(3))]
    import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    write_video(tmp_path / 'a.avi', range(5))
    batch = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert 'was made from another a.avi' in str(batch.failed[films[0]])
    shutil.rmtree(tmp_path / 'bags' / 'a')
    write_video(tmp_path / 'b.avi', range(3))
    import_films([tmp_path / 'b.avi'], tmp_path / 'bags' / 'a', STARTED, lambda _: None)
    batch = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert 'exists already, but is not a complete import of a.avi' in str(batch.failed[films[0]])


def test_videos_that_differ_only_in_their_extension_get_separate_bags(tmp_path):
    films = [write_video(tmp_path / name, range(2)) for name in ('a.avi', 'a.mkv')]
    batch = import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    assert [result.bag.name for result in batch.imported] == ['a_avi', 'a_mkv']


def uncompressed(folder, numbers):
    """A film whose file size does not depend on its content."""
    folder.mkdir(exist_ok=True)
    return write_video(folder / 'run.avi', numbers, codec='rawvideo', pixel_format='bgr24')


@pytest.mark.parametrize('kind', ['film', 'images'])
def test_a_film_of_the_same_name_and_size_is_distinguished_by_its_content(tmp_path, kind):
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
    batch = import_each(days[1:], bags, STARTED, lambda *_: None)
    message = str(batch.failed[days[1]])
    assert f'was made from another {days[1].name} (same size, different content)' in message
    assert 'delete it, or pass another folder' in message
    # The bag of the first film is still accepted.
    assert import_each(days[:1], bags, STARTED, lambda *_: None).skipped == [bags / days[0].stem]


@pytest.mark.parametrize(('change', 'difference'), [
    ({'rate': Fraction(60)}, '--rate was not given, is 60'),
    ({'start_ns': START_NS + NS}, '--start was 2023-11-14T22:13:20Z, is 2023-11-14T22:13:21Z'),
    ({'start_ns': None}, '--start was 2023-11-14T22:13:20Z, is not given'),
    ({'quality': 80}, '--quality was 95, is 80'),
])  # fmt: skip
def test_a_bag_of_other_settings_is_refused(tmp_path, change, difference):
    films = [write_video(tmp_path / 'a.mkv', range(3), codec='ffv1', pixel_format='bgr0')]
    import_each(films, tmp_path / 'bags', STARTED, lambda *_: None)
    batch = import_each(films, tmp_path / 'bags', replace(STARTED, **change), lambda *_: None)
    assert f'was imported with other settings ({difference}); delete it' in str(
        batch.failed[films[0]]
    )
    assert not batch.skipped


def test_a_bag_of_another_calibration_is_refused(tmp_path):
    def settings(content):
        (tmp_path / 'lens.yaml').write_text(content)
        lens = load_calibration(tmp_path / 'lens.yaml')
        return ImportSettings(start_ns=START_NS, calibration=lens, calibration_name='lens.yaml')

    def message(settings):
        batch = import_each(films, tmp_path / 'bags', settings, lambda *_: None)
        return ''.join(str(error) for error in batch.failed.values())

    films = [write_video(tmp_path / 'a.avi', range(3))]
    assert message(settings(CALIBRATION)) == message(settings(CALIBRATION)) == ''
    # JPEGs are not recompressed, so the quality does not matter.
    assert message(replace(settings(CALIBRATION), quality=50)) == ''
    assert '--calibration was lens.yaml, is not given' in message(STARTED)
    other = settings(CALIBRATION.replace('0.01', '0.02'))
    assert (
        '--calibration was lens.yaml, is a file of the same name with different content'
        in message(other)
    )


# --- search for films -------------------------------------------------------------------------


def test_films_of_all_formats_are_found_and_skipped_files_named(tmp_path, capsys):
    folder = tmp_path / 'films'
    folder.mkdir()
    for name, codec in (('a.mp4', 'mpeg4'), ('b.asf', 'mpeg4'), ('c.flv', 'flv1'),
                        ('d.NUT', 'ffv1'), ('e.h264', 'libx264')):  # fmt: skip
        path = write_video(folder / name.lower(), range(3), codec=codec)
        path.rename(folder / name)
    for name in ('notes.txt', 'lens.yaml', 'times.json', '.hidden.mov'):
        (folder / name).write_text('no film')
    shutil.copy(folder / 'a.mp4', folder / 'copy of a')
    (folder / 'thumb.jpg').write_bytes(b'an image next to a film is skipped')
    (folder / 'old.m2v').write_bytes(b'an unsupported format')
    code = main(['import', str(folder), '--each', '-o', str(tmp_path / 'bags'), '--rate', '25',
                 '--json'])  # fmt: skip
    out, err = capsys.readouterr()
    assert code == 0
    printed = json.loads(out)
    assert [os.path.basename(result['bag']) for result in printed['imported']] == list('abcde')
    others = ['copy of a', 'old.m2v', 'thumb.jpg']
    assert [os.path.basename(path) for path in printed['left_out']] == others
    assert f'skipped 3 files without a supported video extension ({", ".join(others)})' in err
    assert 'notes' not in err


def close(monkeypatch, folder):
    """Make a folder unreadable, also for root."""
    original = Path.iterdir

    def iterdir(path):
        if path == folder:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return original(path)

    monkeypatch.setattr(Path, 'iterdir', iterdir)


def test_system_folders_are_ignored(tmp_path, monkeypatch):
    folder = tmp_path / 'films'
    (folder / 'lost+found').mkdir(parents=True)
    film = write_video(folder / 'a.avi', range(3))
    close(monkeypatch, folder / 'lost+found')
    search = find_films([folder])
    assert (search.films, search.failed) == ([film], {})


@pytest.mark.parametrize('passed', ['the folder', 'its content'])
def test_an_unreadable_folder_does_not_stop_the_others(tmp_path, capsys, monkeypatch, passed):
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
    assert [os.path.basename(result['bag']) for result in printed['imported']] == ['a', 'z']
    (failed,) = printed['failed']
    assert failed['video'] == str(closed)
    assert (
        failed['reason'] == f'{closed}: cannot be read (Permission denied); check its permissions'
    )
    assert '1 of 3 videos could not be imported' in err


def test_an_unreadable_folder_is_reported_in_one_line(tmp_path, capsys, monkeypatch):
    closed = tmp_path / 'films'
    closed.mkdir()
    close(monkeypatch, closed)
    assert main(['import', str(closed), '--each', '-o', str(tmp_path / 'bags')]) == 1
    message = capsys.readouterr().err.strip()
    assert (
        message
        == f'nanorocks: {closed}: cannot be read (Permission denied); check its permissions'
    )
    assert not (tmp_path / 'bags').exists()
