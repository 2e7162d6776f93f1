"""Recordings found by paths, patterns and folders, and detection of changes."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

import pytest

from nanorocks_ros.recordings.bag.find_bags import (
    RESULTS_MARK,
    find_bags,
    is_collection,
    is_pattern,
)
from nanorocks_ros.recordings.bag.fingerprint import content_hash, file_states
from nanorocks_ros.recordings.mcap.mcap_blocks import MAGIC


@pytest.fixture
def flight(tmp_path):
    """Two days of recordings, with results, notes and an empty folder."""
    for name in ('day_1/run_2', 'day_1/run_10', 'day_2/run_2'):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / f'{name[-1]}_0.mcap').write_bytes(MAGIC)
        (tmp_path / name / 'metadata.yaml').write_text('')
    (tmp_path / 'day_1' / 'loose.mcap').write_bytes(MAGIC)
    (tmp_path / 'day_1' / 'notes.txt').write_text('sunny')
    results = tmp_path / 'day_1' / 'run_2_results'
    (results / 'results_bag').mkdir(parents=True)
    (results / 'results_bag' / 'results_bag.mcap').write_bytes(MAGIC)
    (results / RESULTS_MARK).touch()
    (tmp_path / 'day_1' / 'never_began').mkdir()
    return tmp_path


def names(result, folder):
    return [str(bag.relative_to(folder)) for bag in result.bags]


def test_recordings_in_a_folder_are_sorted_by_their_numbers(flight):
    bags = find_bags([str(flight / 'day_1')])
    assert names(bags, flight) == ['day_1/loose.mcap', 'day_1/run_2', 'day_1/run_10']
    assert bags.left_out == [f'{flight}/day_1/run_2_results: holds results']
    assert len(find_bags([str(flight)]).bags) == 4


def test_a_pattern_skips_other_files_but_not_empty_recordings(flight):
    bags = find_bags([str(flight / 'day_1' / '*')])
    assert set(names(bags, flight)) == {
        'day_1/loose.mcap',
        'day_1/never_began',
        'day_1/run_2',
        'day_1/run_10',
    }
    assert {notice.rpartition('/')[2] for notice in bags.left_out} == {
        'notes.txt: is not a recording',
        'run_2_results: holds results',
    }
    # Folders with a results marker are skipped anywhere; files of a recording belong to it.
    assert len(find_bags([str(flight / '*' / 'run_2'), str(flight / '*/*/*.mcap')]).bags) == 3


def test_a_recording_with_several_names_is_found_once(flight):
    os.symlink(flight / 'day_1' / 'run_2', flight / 'link')
    path = str(flight / 'day_1' / 'run_2')
    result = find_bags([path, f'{path}/', f'{path}/2_0.mcap', str(flight / 'link'), path])
    assert len(result.bags) == 1


def test_missing_inputs_are_reported_and_the_others_found(flight):
    bags = find_bags([str(flight / 'day_3*'), str(flight / 'day_2'), str(flight / 'nothing')])
    assert names(bags, flight) == ['day_2/run_2']
    first, second = (str(error) for error in bags.missing.values())
    assert 'matches nothing; correct the pattern' in first
    assert 'does not exist' in second


def test_a_file_with_the_name_of_a_pattern_is_that_file(flight):
    odd = flight / 'day_2' / 'run[1]*.mcap'
    odd.write_bytes(MAGIC)
    assert not is_pattern(str(odd))
    assert find_bags([str(odd)]).bags == [odd]
    assert is_pattern(str(flight / '*'))


def test_numbered_files_of_one_name_are_one_recording_others_are_several(tmp_path):
    for kind, files in (('crashed', ('run_0', 'run_1')), ('many', ('run', 'walk'))):
        (tmp_path / kind).mkdir()
        for name in files:
            (tmp_path / kind / f'{name}.mcap').write_bytes(MAGIC)
    assert not is_collection(tmp_path / 'crashed')
    assert is_collection(tmp_path / 'many')
    assert len(find_bags([str(tmp_path / 'many')]).bags) == 2
    assert not is_collection(tmp_path / 'not there')


def test_the_hash_depends_on_the_content_only(flight, tmp_path):
    bag = flight / 'day_1' / 'run_10'
    moved = shutil.copytree(bag, tmp_path / 'elsewhere')
    assert content_hash(moved) == content_hash(bag)
    (moved / '0_0.mcap').write_bytes(MAGIC + b'\x00')
    assert content_hash(moved) != content_hash(bag)
    loose = flight / 'day_1' / 'loose.mcap'
    assert content_hash(loose) != content_hash(bag)


def test_the_state_reveals_a_change_with_restored_size_and_time(flight):
    file = flight / 'day_1' / 'loose.mcap'
    before, times = file_states(file), file.stat()
    assert file_states(file) == before
    content = bytearray(file.read_bytes())
    content[3] ^= 1
    file.write_bytes(content)
    os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert file_states(file) != before


def test_a_ros_1_bag_is_found(flight):
    (flight / 'day_2' / 'old.bag').write_bytes(b'#ROSBAG V2.0\n')
    assert names(find_bags([str(flight / 'day_2')]), flight) == ['day_2/old.bag', 'day_2/run_2']


def test_an_unreadable_folder_does_not_hide_other_recordings(flight, monkeypatch):
    closed = flight / 'day_1' / 'closed'
    for folder in (closed, flight / 'day_1' / 'lost+found'):
        folder.mkdir()
    original = Path.iterdir

    def iterdir(folder):
        if folder.name in ('closed', 'lost+found'):
            raise PermissionError(errno.EACCES, 'Permission denied', str(folder))
        return original(folder)

    monkeypatch.setattr(Path, 'iterdir', iterdir)
    result = find_bags([str(flight / 'day_1')])
    assert len(result.bags) == 3
    assert is_collection(flight / 'day_1')
    assert set(result.missing) == {str(closed)}
    assert 'cannot be read (Permission denied)' in str(result.missing[str(closed)])
