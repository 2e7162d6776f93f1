"""Which recordings paths, patterns and folders name, and what tells that one has changed."""

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
    """Two days of recordings, and what else lies around there."""
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


def names(found, folder):
    return [str(bag.relative_to(folder)) for bag in found.bags]


def test_a_folder_of_recordings_gives_each_of_them_in_order_of_their_numbers(flight):
    bags = find_bags([str(flight / 'day_1')])
    assert names(bags, flight) == ['day_1/loose.mcap', 'day_1/run_2', 'day_1/run_10']
    assert bags.left_out == [f'{flight}/day_1/run_2_results: holds results']
    assert len(find_bags([str(flight)]).bags) == 4


def test_a_pattern_leaves_out_what_is_no_recording_but_not_one_that_never_began(flight):
    bags = find_bags([str(flight / 'day_1' / '*')])
    assert set(names(bags, flight)) == {
        'day_1/loose.mcap',
        'day_1/never_began',
        'day_1/run_2',
        'day_1/run_10',
    }
    assert {one.rpartition('/')[2] for one in bags.left_out} == {
        'notes.txt: is no recording',
        'run_2_results: holds results',
    }
    # Folders with a marker in them are results wherever they lie; files of a recording are it.
    assert len(find_bags([str(flight / '*' / 'run_2'), str(flight / '*/*/*.mcap')]).bags) == 3


def test_each_is_taken_once_whatever_the_names(flight):
    os.symlink(flight / 'day_1' / 'run_2', flight / 'link')
    one = str(flight / 'day_1' / 'run_2')
    found = find_bags([one, f'{one}/', f'{one}/2_0.mcap', str(flight / 'link'), one])
    assert len(found.bags) == 1


def test_what_is_not_there_is_told_and_the_rest_is_found(flight):
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


def test_files_of_one_name_and_a_number_are_one_recording_others_are_many(tmp_path):
    for kind, files in (('crashed', ('run_0', 'run_1')), ('many', ('run', 'walk'))):
        (tmp_path / kind).mkdir()
        for name in files:
            (tmp_path / kind / f'{name}.mcap').write_bytes(MAGIC)
    assert not is_collection(tmp_path / 'crashed')
    assert is_collection(tmp_path / 'many')
    assert len(find_bags([str(tmp_path / 'many')]).bags) == 2
    assert not is_collection(tmp_path / 'not there')


def test_the_hash_is_of_the_content_wherever_it_lies(flight, tmp_path):
    bag = flight / 'day_1' / 'run_10'
    moved = shutil.copytree(bag, tmp_path / 'elsewhere')
    assert content_hash(moved) == content_hash(bag)
    (moved / '0_0.mcap').write_bytes(MAGIC + b'\x00')
    assert content_hash(moved) != content_hash(bag)
    loose = flight / 'day_1' / 'loose.mcap'
    assert content_hash(loose) != content_hash(bag)


def test_the_state_tells_a_change_even_where_size_and_time_are_put_back(flight):
    file = flight / 'day_1' / 'loose.mcap'
    before, times = file_states(file), file.stat()
    assert file_states(file) == before
    content = bytearray(file.read_bytes())
    content[3] ^= 1
    file.write_bytes(content)
    os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert file_states(file) != before


def test_a_recording_of_ros_1_is_found_for_whoever_says_what_to_do_with_it(flight):
    (flight / 'day_2' / 'old.bag').write_bytes(b'#ROSBAG V2.0\n')
    assert names(find_bags([str(flight / 'day_2')]), flight) == ['day_2/old.bag', 'day_2/run_2']


def test_a_folder_that_cannot_be_read_costs_no_other_recording(flight, monkeypatch):
    closed = flight / 'day_1' / 'closed'
    for one in (closed, flight / 'day_1' / 'lost+found'):
        one.mkdir()
    listed = Path.iterdir

    def iterdir(folder):
        if folder.name in ('closed', 'lost+found'):
            raise PermissionError(errno.EACCES, 'Permission denied', str(folder))
        return listed(folder)

    monkeypatch.setattr(Path, 'iterdir', iterdir)
    found = find_bags([str(flight / 'day_1')])
    assert len(found.bags) == 3
    assert is_collection(flight / 'day_1')
    assert set(found.missing) == {str(closed)}
    assert 'cannot be read (Permission denied)' in str(found.missing[str(closed)])
