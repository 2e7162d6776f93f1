"""Unfinished files of killed processes go; those that a process writes stay."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from nanorocks_ros.outputs.atomic_files import atomic_file, write_bytes
from nanorocks_ros.outputs.unfinished_files import (
    delete_unfinished,
    holds_files,
    open_unfinished,
)

WRITER = """
import sys
from pathlib import Path
from nanorocks_ros.outputs.atomic_files import atomic_file

with atomic_file(Path(sys.argv[1])) as part:
    part.write_bytes(b'half')
    print(part, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def writer(tmp_path):
    """A process that has written half of a file."""
    command = [sys.executable, '-c', WRITER, str(tmp_path / 'a.npz')]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        process.stdout.readline()
        yield process
        process.kill()


def names(folder):
    return sorted(file.name for file in folder.iterdir())


def test_what_a_killed_process_left_goes_with_the_next_file_of_that_name(writer, tmp_path):
    write_bytes(tmp_path / 'a.csv', b'new')
    write_bytes(tmp_path / 'b.npz', b'new')
    (unfinished,) = [name for name in names(tmp_path) if name.startswith('.a.')]
    # Its process lives: it stays, and so it is completed.
    write_bytes(tmp_path / 'a.npz', b'new')
    assert unfinished in names(tmp_path)
    os.kill(writer.pid, signal.SIGKILL)
    writer.wait()
    write_bytes(tmp_path / 'b.npz', b'other')
    assert unfinished in names(tmp_path)
    write_bytes(tmp_path / 'a.npz', b'new')
    assert names(tmp_path) == ['a.csv', 'a.npz', 'b.npz']


def test_two_writers_of_one_file_do_not_disturb_each_other(writer, tmp_path):
    with atomic_file(tmp_path / 'a.npz') as part:
        part.write_bytes(b'mine')
        writer.communicate('', timeout=60)
        assert (tmp_path / 'a.npz').read_bytes() == b'half'
    assert writer.returncode == 0
    assert (tmp_path / 'a.npz').read_bytes() == b'mine'
    assert names(tmp_path) == ['a.npz']


def test_all_of_a_folder_are_deleted_but_other_hidden_files_stay(tmp_path):
    kept = ['.a.part', '.hidden', '.part-1', 'b.0123456789abcdef.part']
    for name in (*kept, '.a.0123456789abcdef.part', '..mark.0123456789abcdef.part.json'):
        (tmp_path / name).touch()
    delete_unfinished(tmp_path)
    assert names(tmp_path) == kept


def test_a_link_or_a_pipe_with_such_a_name_does_not_block_and_its_target_stays(tmp_path):
    (tmp_path / 'target').touch()
    (tmp_path / '.a.0123456789abcdef.part').symlink_to(tmp_path / 'target')
    os.mkfifo(tmp_path / '.b.0123456789abcdef.part')
    delete_unfinished(tmp_path)
    assert (tmp_path / 'target').exists()


def test_the_longest_name_in_letters_of_three_bytes_is_written(tmp_path):
    # 255 bytes: one more and the file system refuses it.
    path = tmp_path / ('漢' * 83 + 'ab.npz')
    for content in (b'first', b'second'):
        write_bytes(path, content)
    assert path.read_bytes() == b'second'
    assert names(tmp_path) == [path.name]


def test_a_folder_with_unfinished_files_alone_holds_nothing(tmp_path):
    assert not holds_files(tmp_path)
    part, lock = open_unfinished(tmp_path / 'a.npz')
    assert not holds_files(tmp_path)
    os.rename(part, tmp_path / 'a.npz')
    os.close(lock)
    assert holds_files(tmp_path)
    assert holds_files(tmp_path / 'a.npz')
