"""A film is imported once, beside it, and again when it has changed."""

from __future__ import annotations

import json
import os
import shutil

import pytest
from videos import write_video

from benchmarks.file_steps import kill_at_each_step
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.film_import import film_cache
from nanorocks_ros.studies.film_import.film_cache import CACHE, cached_import, is_film


def imported(film):
    return cached_import(film, lambda done: None)


def test_a_film_is_imported_beside_it_and_its_import_is_used_again(tmp_path):
    film = write_video(tmp_path / 'a.avi', range(8))
    first, second = imported(film), imported(film)
    assert first.bag == tmp_path / CACHE / 'a.avi'
    assert (first.reused, second.reused) == (False, True)
    assert second.frames == first.frames == BagFrames(second.bag).count == 8
    assert sorted(path.name for path in (tmp_path / CACHE).iterdir()) == ['a.avi', 'a.avi.json']


def test_a_film_that_changed_is_imported_again(tmp_path):
    film = write_video(tmp_path / 'a.avi', range(8))
    imported(film)
    write_video(film, range(5))
    again = imported(film)
    assert not again.reused
    assert BagFrames(again.bag).count == 5


def test_an_interrupted_import_leaves_nothing_and_the_next_one_is_whole(tmp_path):
    film = write_video(tmp_path / 'a.avi', range(8))

    def interrupt(done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cached_import(film, interrupt)
    assert list((tmp_path / CACHE).iterdir()) == []
    assert imported(film).frames == 8


def test_an_import_killed_at_any_step_is_made_by_the_next_call_and_leaves_nothing(tmp_path):
    write_video(tmp_path / 'a.avi', range(3))
    folder = tmp_path / 'films'
    folder.mkdir()

    def job():
        film = folder / 'a.avi'
        if not film.exists():
            shutil.copy2(tmp_path / 'a.avi', film)
        imported(film)

    kills, differences = kill_at_each_step(job, folder)
    assert differences == []
    assert kills > 10


def test_a_damaged_note_of_the_import_makes_a_new_one(tmp_path):
    film = write_video(tmp_path / 'a.avi', range(4))
    note = tmp_path / CACHE / 'a.avi.json'
    imported(film)
    known = json.loads(note.read_text())
    wrong_count = json.dumps({**known, 'frames': 'four'})
    for content in ('', '[]', '{"film": 1}', '[' * 100_000, wrong_count):
        note.write_text(content)
        assert not imported(film).reused


def test_without_a_writable_folder_the_cache_of_the_user_is_used(tmp_path, monkeypatch):
    (tmp_path / 'films').mkdir()
    film = write_video(tmp_path / 'films' / 'a.avi', range(4))
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    real = os.access
    monkeypatch.setattr(
        film_cache.os,
        'access',
        lambda path, mode: (tmp_path / 'films') not in path.parents and real(path, mode),
    )
    assert tmp_path / 'cache' in imported(film).bag.parents
    shutil.rmtree(tmp_path / 'cache')
    (tmp_path / 'cache').write_text('a file where the folder should be')
    with pytest.raises(RecordingError, match='nanorocks import'):
        imported(film)


def test_bags_and_other_files_are_no_films(tmp_path):
    film = write_video(tmp_path / 'a.avi', range(4))
    (tmp_path / 'notes.txt').write_text('text')
    pictures = tmp_path / 'pictures'
    pictures.mkdir()
    (pictures / '1.png').write_bytes(b'')
    assert is_film(film)
    assert is_film(pictures)
    assert not is_film(imported(film).bag)
    assert not is_film(tmp_path / 'notes.txt')
    assert not is_film(tmp_path / 'missing.avi')
