"""Files a command is asked to write."""

from __future__ import annotations

from pathlib import Path

import pytest

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.outputs.atomic_files import atomic_file, check_outputs

KINDS = {'--table': ('.npz', '.parquet'), '--other': ('.npz',)}


def test_new_files_pass_and_leave_nothing(tmp_path):
    check_outputs({'--table': tmp_path / 'a.npz', '--bag': tmp_path / 'deep' / 'bag'}, KINDS)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_ending_is_a_wrong_call(tmp_path):
    with pytest.raises(ConfigurationError, match=r'--table: .*a\.txt ends in none of \.npz'):
        check_outputs({'--table': tmp_path / 'a.txt'}, KINDS)


def test_two_flags_may_not_name_one_file(tmp_path):
    files = {'--table': tmp_path / 'a.npz', '--other': tmp_path / '.' / 'a.npz'}
    with pytest.raises(ConfigurationError, match='--other: names the file of --table'):
        check_outputs(files, KINDS)


def test_what_exists_is_replaced_only_when_asked(tmp_path):
    path = tmp_path / 'a.npz'
    path.touch()
    with pytest.raises(RecordingError, match=r'exists already .*; name another, or add --force'):
        check_outputs({'--table': path}, KINDS)
    check_outputs({'--table': path}, KINDS, force=True)
    with pytest.raises(RecordingError, match='exists already'):
        check_outputs({'--bag': tmp_path}, KINDS, force=True)
    folder = tmp_path / 'b.npz'
    folder.mkdir()
    with pytest.raises(RecordingError, match='exists already'):
        check_outputs({'--table': folder}, KINDS, force=True)


def test_a_folder_that_is_missing_is_said_before_the_work(tmp_path):
    with pytest.raises(RecordingError, match=r'there is no folder .*nowhere; make it'):
        check_outputs({'--table': tmp_path / 'nowhere' / 'a.npz'}, KINDS)


def write(path, content, end=None):
    with atomic_file(path) as part:
        part.write_bytes(content)
        if end is not None:
            raise end


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / 'a.npz'
    with atomic_file(path) as part:
        part.write_bytes(b'new')
        assert not path.exists()
    assert path.read_bytes() == b'new'


@pytest.mark.parametrize('end', [ValueError, KeyboardInterrupt, MemoryError])
def test_half_a_file_never_takes_its_place(tmp_path, end):
    path = tmp_path / 'a.npz'
    write(path, b'old')
    with pytest.raises(end):
        write(path, b'half', end)
    assert path.read_bytes() == b'old'
    assert [file.name for file in tmp_path.iterdir()] == ['a.npz']


def test_the_system_says_why_it_cannot_be_written(tmp_path):
    with pytest.raises(RecordingError, match=r'a\.npz: cannot be written \(No such file'):
        write(tmp_path / 'nowhere' / 'a.npz', b'new')


def test_the_temporary_name_cannot_be_foreseen_and_a_link_is_not_followed(tmp_path):
    path, names = tmp_path / 'a.npz', set()
    for _ in range(3):
        with atomic_file(path) as part:
            names.add(part.name)
            assert part.parent == tmp_path
            assert part.suffix == '.npz'
    assert len(names) == 3
    other = tmp_path / 'other'
    other.write_bytes(b'kept')
    path.unlink()
    path.symlink_to(other)
    write(path, b'new')
    assert (path.read_bytes(), other.read_bytes()) == (b'new', b'kept')


def test_results_are_as_readable_as_other_files(tmp_path):
    write(tmp_path / 'a.npz', b'new')
    (tmp_path / 'b').touch()
    assert (tmp_path / 'a.npz').stat().st_mode == (tmp_path / 'b').stat().st_mode


def test_a_folder_below_a_file_is_refused_before_the_work(tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(RecordingError, match='is no folder; write elsewhere'):
        check_outputs({'--bag': tmp_path / 'file' / 'deep' / 'bag'}, {})


def test_a_name_that_is_too_long_is_refused_before_the_work(tmp_path):
    long = 'x' * 300
    for files in ({'--table': tmp_path / f'{long}.npz'}, {'--bag': tmp_path / long / 'bag'}):
        with pytest.raises(RecordingError, match=r'a name in it has 30\d bytes; use at most 255'):
            check_outputs(files, KINDS)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_takes_no_file_whatever_its_permissions_is_refused_before_the_work():
    for files in ({'--table': Path('/proc/a.npz')}, {'--bag': Path('/proc/bag')}):
        with pytest.raises(RecordingError, match='cannot be written'):
            check_outputs(files, KINDS)
