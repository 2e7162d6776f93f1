"""The example in docs/method/theory.md gives the numbers that its comments state."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / 'docs' / 'method' / 'theory.md'


def test_the_example_of_the_theory_page_runs_and_gives_the_printed_numbers():
    (example,) = re.findall(r'```python\n(.*?)```', PAGE.read_text(), flags=re.DOTALL)
    names = {}
    exec(example, names)
    assert names['paper'].value == pytest.approx(0.89, abs=0.005)
    assert names['paper'].error > 0.0
    assert names['ellipse'].wall_axis == pytest.approx(0.95, abs=0.01)
    assert names['ellipse'].bead_axis == pytest.approx(2.8, abs=0.05)
    # Walls take most of the energy: without them a gas cools several times as slowly.
    assert names['time'] > 3.0 * 1.64
