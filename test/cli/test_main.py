"""Errors of the system in the command ``nanorocks``."""

from __future__ import annotations

import argparse
import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from nanorocks_ros.cli import main as command

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ((errno.EACCES, 'Permission denied', 'a\udcff b'), 'a\\udcff b: Permission denied; '),
        ((errno.ENOSPC, 'No space left on device'), 'No space left on device; '),
    ],
)
def test_a_system_error_is_one_line_that_names_the_file(monkeypatch, capsys, arguments, message):
    def run(_):
        raise OSError(*arguments)

    parser = argparse.ArgumentParser()
    parser.set_defaults(run=run)
    monkeypatch.setattr(command, 'build_parser', lambda *_: parser)
    assert command.main([]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f'nanorocks: {message}free some space, or write elsewhere'
    # Surrogates are escaped, so that any terminal can print the line.
    assert os.fsencode(line) == line.encode('utf-8')


def test_a_full_memory_is_one_line_with_a_remedy(monkeypatch, capsys):
    def full(options):
        raise MemoryError

    monkeypatch.setattr('nanorocks_ros.cli.recordings.info.run', full)
    assert command.main(['info', str(SAMPLE)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('nanorocks: the memory is full; close other programs')


@pytest.mark.parametrize('name', ['salvage', 'import'])
def test_an_output_that_cannot_be_written_is_refused_before_the_input_is_read(
    tmp_path, capsys, name
):
    (tmp_path / 'file').touch()
    output = tmp_path / 'file' / 'bag'
    assert command.main([name, str(tmp_path / 'missing'), '-o', str(output)]) == 1
    assert 'is no folder; write elsewhere' in capsys.readouterr().err


def test_line_ends_and_control_sequences_in_a_name_stay_on_one_line(tmp_path, capsys):
    assert command.main(['info', str(tmp_path / 'a\n\x1b[2Jb.mcap')]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert r'a\n\x1b[2Jb.mcap: does not exist; ' in line


def test_the_help_loads_no_large_library():
    program = (
        'import sys; from nanorocks_ros.cli.main import build_parser; build_parser(); '
        'print(*sys.modules)'
    )
    run = subprocess.run(
        [sys.executable, '-c', program], cwd=SAMPLE.parents[1], capture_output=True, check=True
    )
    loaded = set(run.stdout.decode().split())
    assert 'nanorocks_ros.cli.recordings.info' in loaded
    assert not loaded & {'cv2', 'matplotlib', 'numba', 'numpy', 'pandas', 'scipy', 'tqdm'}
