"""Errors of the system in the command ``nanorocks``."""

from __future__ import annotations

import argparse
import errno
import os

import pytest

from nanorocks_ros.cli import main as command


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
    monkeypatch.setattr(command, 'build_parser', lambda: parser)
    assert command.main([]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f'nanorocks: {message}free some space, or write elsewhere'
    # Surrogates are escaped, so that any terminal can print the line.
    assert os.fsencode(line) == line.encode('utf-8')
