"""A trays file by the options of `nanorocks tray`, and the beads that are recognised with it.

Tested by ``test/cli/films/test_tray.py``.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.appearance import AUTO

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.measure.film_samples import FilmSamples
    from nanorocks_ros.studies.measure.film_tray import FilmedTray
    from nanorocks_ros.studies.measure.seen_beads import SeenBeads

# A number is that of the beads if at least this part of the frames shows it.
_STEADY = 0.5


class RecognisedTray(NamedTuple):
    """A trays file, what was guessed for it, and what is seen with it."""

    text: str
    notices: tuple[str, ...]
    beads: SeenBeads


def recognised_tray(options: argparse.Namespace, samples: FilmSamples) -> RecognisedTray:
    """The trays file that the options describe, and the beads that are recognised with it.

    Raises
    ------
    ConfigurationError
        For options that do not fit each other or the picture.
    """
    from nanorocks_ros.studies.measure.film_tray import described_tray
    from nanorocks_ros.studies.measure.seen_beads import seen_beads
    from nanorocks_ros.studies.measure.told_film import filmed_tray, sized_beads

    _complete(options)
    filmed = filmed_tray(options)
    assert filmed is not None
    guesses: tuple[str, ...] = ()
    if any(math.isnan(beads.diameter_px) for beads in filmed.beads):
        filmed, guess = sized_beads(filmed, samples)
        guesses = (guess,)
    if options.bead and len(options.bead) > 1 and not options.colour:
        filmed = _coloured(filmed, options.bead, samples)
    tray = described_tray(filmed, samples.size)
    beads = seen_beads(tray.text, samples.frames)
    counted, notice = _with_counts(filmed, beads)
    if notice:
        tray = described_tray(counted, samples.size)
    return RecognisedTray(tray.text, (*guesses, *tray.notices, *notice), beads)


def save(options: argparse.Namespace, tray: RecognisedTray) -> None:
    """Write the trays file, and the picture where one is wanted.

    Raises
    ------
    RecordingError
        When a file cannot be written.
    """
    from nanorocks_ros.outputs.atomic_files import write_bytes

    write_bytes(Path(options.output), tray.text.encode())
    if options.picture:
        _write_picture(Path(options.picture), tray.beads)


def _complete(options: argparse.Namespace) -> None:
    """Put diameters in px into the options: of --bead, or to be found."""
    if options.bead and options.diameter_px:
        raise ConfigurationError(
            '--bead', 'and --diameter-px both tell the diameter', 'leave out one of them'
        )
    if options.bead:
        options.diameter_px = [diameter for _, _, diameter in options.bead]
    options.diameter_px = options.diameter_px or [AUTO]


def _coloured(filmed: FilmedTray, beads: list[list[float]], samples: FilmSamples) -> FilmedTray:
    """The species with the colours of their beads in the first frame."""
    from nanorocks_ros.studies.measure.seen_beads import colour_at

    species = tuple(
        replace(told, colour=colour_at(samples.frames[0], (x, y), diameter))
        for told, (x, y, diameter) in zip(filmed.beads, beads, strict=True)
    )
    return replace(filmed, beads=species)


def _with_counts(filmed: FilmedTray, beads: SeenBeads) -> tuple[FilmedTray, tuple[str, ...]]:
    """The numbers that are seen where none are told, and a notice of them."""
    if all(told.count is not None for told in filmed.beads) or min(beads.counts) < 1:
        return filmed, ()
    numbers = ' and '.join(f'{seen:.0f}' for seen in beads.counts)
    seen_in = f'{numbers}, seen in {100.0 * min(beads.steady):.0f} % of frames; --count sets it'
    if min(beads.steady) < _STEADY:
        # As a number that is told it would leave out the others.
        return filmed, (f'the number of beads is left open: {seen_in}',)
    species = tuple(
        replace(told, count=round(seen) if told.count is None else told.count)
        for told, seen in zip(filmed.beads, beads.counts, strict=True)
    )
    return replace(filmed, beads=species), (f'the number of beads is guessed: {seen_in}',)


def _write_picture(path: Path, beads: SeenBeads) -> None:
    import cv2

    from nanorocks_ros.outputs.atomic_files import write_bytes

    _, content = cv2.imencode('.png', beads.picture)
    write_bytes(path, content.tobytes())
    print(f'nanorocks: picture in {path}', file=sys.stderr)
