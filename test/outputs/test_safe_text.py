"""Text for terminals and pages."""

from __future__ import annotations

from pathlib import Path

import pytest

from nanorocks_ros.outputs.safe_text import counted, printable


@pytest.mark.parametrize(
    ('name', 'text'),
    [
        ('tray 1.mp4', 'tray 1.mp4'),
        ('Über.avi', 'Über.avi'),
        ('two\nlines', 'two\\nlines'),
        ('red \x1b[31m', 'red \\x1b[31m'),
        (Path('folder/a\tb'), 'folder/a\\tb'),
    ],
)
def test_control_characters_are_escaped(name, text):
    assert printable(name) == text


def test_a_noun_has_the_number_that_goes_with_its_count():
    assert [counted(count, 'frame') for count in (0, 1, 2)] == ['0 frames', '1 frame', '2 frames']
