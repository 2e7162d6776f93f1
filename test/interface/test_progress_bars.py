"""Progress bars: quiet where nobody looks, closed when work is interrupted."""

from __future__ import annotations

import sys

import pytest
from tqdm.auto import tqdm

from nanorocks_ros.interface.progress_bars import count_bar, part_bar


def test_nothing_is_shown_in_a_pipe(capsys):
    with count_bar('work', shown=True) as show:
        show(1, 2)
        show(2, 2)
    assert capsys.readouterr() == ('', '')


def interrupted():
    with part_bar('work', shown=True) as show:
        show(0.5)
        assert len(tqdm._instances) == 1
        raise KeyboardInterrupt


def test_an_interruption_removes_the_bar(monkeypatch):
    monkeypatch.setattr(sys.stderr, 'isatty', lambda: True)
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert len(tqdm._instances) == 0
