"""Diameters that a trays file leaves open are seen, and numbers put where they belong."""

from __future__ import annotations

import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.unknown_diameters import (
    UnknownDiameter,
    unknown_diameters,
    with_diameters,
)

FILE = """\
# µm stand nowhere
trays:
  1:
    dimensions_mm: [300, 200]
    species:
      - {look: auto, colour: red, diameter_mm: auto}
      - {diameter_mm: 3, look: auto, colour: blue}
      - {look: dark, colour: green}
  4:
    dimensions_mm: [30, 20]
    species:
      - look: auto   # the only one
        count: 7
"""
OPEN = UnknownDiameter(1, 0), UnknownDiameter(1, 2), UnknownDiameter(4, 0)


def test_species_without_a_diameter_are_named():
    assert unknown_diameters(FILE) == OPEN
    assert unknown_diameters('') == ()


def test_numbers_are_put_in_their_places_and_nothing_else_changes():
    text = with_diameters(FILE, dict(zip(OPEN, (2.5, 1.25, 0.5), strict=True)))
    assert unknown_diameters(text) == ()
    trays = load_trays(text)
    sizes = [1e3 * kind.diameter for tray in trays.values() for kind in tray.species]
    assert sizes == pytest.approx([2.5, 3.0, 1.25, 0.5])
    assert trays[4].species[0].expected == 7
    assert text.replace('2.5}', 'auto}').replace('diameter_mm: 1.25, ', '') == FILE.replace(
        '- look', '- diameter_mm: 0.5\n        look'
    )


def test_a_file_by_its_path_is_read(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text(FILE, encoding='utf-8')
    assert unknown_diameters(path) == OPEN
    with pytest.raises(ConfigurationError, match=r'mine.yaml:6: lacks diameter_mm; add it; with'):
        load_trays(path)


@pytest.mark.parametrize('text', ['- 1\n', 'trays: {1: 2}\n', 'trays: {1: {species: [3]}}\n'])
def test_of_files_of_another_form_nothing_is_said(text):
    assert unknown_diameters(text) == ()
