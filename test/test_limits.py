"""The register of limits, and files that are no regular files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from nanorocks_ros import limits
from nanorocks_ros.errors import ConfigurationError, RecordingError

PAGE = Path(__file__).parents[1] / 'docs' / 'reference' / 'limits.md'


def test_every_limit_is_in_the_register_and_on_the_page():
    named = [value for value in vars(limits).values() if isinstance(value, limits.Limit)]
    assert sorted(limits.LIMITS, key=lambda limit: limit.name) == sorted(
        named, key=lambda limit: limit.name
    )
    rows = [
        f'| `{limit.variable}` | {limit.quantity} | {limit.default:,} {limit.unit} |'
        for limit in limits.LIMITS
    ]
    assert [line for line in PAGE.read_text().splitlines() if line.startswith('| `')] == rows


@pytest.mark.parametrize('text', ['-1', '0', 'many', '1.5', '²', '9' * 50])
def test_a_setting_that_is_no_number_is_refused(monkeypatch, text):
    monkeypatch.setenv('NANOROCKS_MAX_DIGITS', text)
    with pytest.raises(ConfigurationError, match=r'NANOROCKS_MAX_DIGITS: .* is no positive whole'):
        _ = limits.DIGITS.value


def test_a_setting_replaces_the_default(monkeypatch):
    monkeypatch.setenv('NANOROCKS_MAX_DIGITS', '7')
    limits.DIGITS.check(7, 'x')
    with pytest.raises(RecordingError, match=r'8 digits, above the limit of 7; .*MAX_DIGITS'):
        limits.DIGITS.check(8, 'x')


def test_a_pipe_and_a_device_are_refused_and_files_and_folders_are_not(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    for path in (tmp_path / 'pipe', Path('/dev/zero')):
        with pytest.raises(RecordingError, match='is no regular file; pass a file on a disk'):
            limits.require_regular_file(path, RecordingError)
    (tmp_path / 'file').write_bytes(b'x' * 10_000)
    for path in (tmp_path, tmp_path / 'file', tmp_path / 'missing'):
        limits.require_regular_file(path, RecordingError)


def test_a_file_that_is_nearly_all_hole_is_refused(tmp_path):
    path = tmp_path / 'hole'
    with path.open('wb') as stream:
        stream.truncate(1 << 40)
    with pytest.raises(RecordingError, match='NANOROCKS_MAX_HOLE_BYTES'):
        limits.require_regular_file(path, RecordingError)
