"""Beads in some frames: colour and number."""

from __future__ import annotations

import pytest
from drawn_discs import SIZE, disc_frames

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.studies.measure.film_tray import FilmedBeads, FilmedTray, described_tray
from nanorocks_ros.studies.measure.seen_beads import colour_at, seen_beads

DARK, RED = (40, 40, 40), (30, 30, 190)


def test_beads_are_counted_by_species_and_drawn():
    frames = disc_frames([RED, DARK], count=10)
    beads = tuple(
        FilmedBeads(diameter_px=20.0, colour=colour_at(frames[0], place, 20.0))
        for place in ((40.0, 45.0), (90.0, 45.0))
    )
    assert beads[0].colour.startswith('#b')
    text = described_tray(FilmedTray(beads=beads), SIZE).text
    seen = seen_beads(text, frames)
    assert seen.counts == (5.0, 5.0)
    assert min(seen.steady) > 0.8
    assert seen.picture.shape == frames[0].shape
    assert (seen.picture != frames[len(frames) // 2]).any()


def test_a_bead_outside_the_picture_is_refused():
    with pytest.raises(ConfigurationError, match='outside the picture'):
        colour_at(disc_frames([DARK])[0], (400.0, 20.0), 20.0)
