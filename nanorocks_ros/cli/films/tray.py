"""``nanorocks tray FILM -o mine.yaml``: describe beads and container of a film, in a trays file.

Tested by ``test/cli/films/test_tray.py``.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from nanorocks_ros.studies.measure.film_samples import FilmSamples
    from nanorocks_ros.studies.measure.film_tray import FilmedTray
    from nanorocks_ros.studies.measure.seen_beads import SeenBeads

_EPILOG = """\
Examples:

  nanorocks tray film.mp4 -o mine.yaml
  nanorocks tray film.mp4 --corners 56 56 776 536 --sides-mm 90 60 --height-mm 4 --diameter-px 24
    --diameter-mm 3 --count 24 -o mine.yaml --picture mine.png

What is not told is guessed, and a line says so. Corners and beads are given in px of the film.
"""


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.film_inputs import accept_films
    from nanorocks_ros.cli.films.film_options import add_film_options

    parser = commands.add_parser(
        'tray',
        help='describe beads and container of a film in a trays file',
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('bag', metavar='FILM', help='video, folder of images or bag')
    accept_films(parser, 'bag')
    add_film_options(parser)
    parser.add_argument(
        '--bead',
        type=float,
        nargs=3,
        action='append',
        metavar=('X', 'Y', 'DIAMETER'),
        help='a bead in the first frame, in place of --diameter-px; once for each species: their '
        'colours are taken there',
    )
    parser.add_argument('-o', '--output', required=True, help='trays file to write, .yaml')
    parser.add_argument('--picture', help='picture of what is recognised to write, .png')
    parser.add_argument('--image-topic', default='', help='camera topic of a bag')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    parser.set_defaults(run=run, trays_file='')


def run(options: argparse.Namespace) -> int:
    """Describe, recognise, write, and return the exit code."""
    from nanorocks_ros.cli.films.film_options import print_notices
    from nanorocks_ros.outputs.atomic_files import write_bytes
    from nanorocks_ros.studies.analysis.recognition_verdicts import EXIT_NOT_USABLE
    from nanorocks_ros.studies.measure.film_samples import film_samples
    from nanorocks_ros.studies.measure.film_tray import described_tray
    from nanorocks_ros.studies.measure.seen_beads import seen_beads
    from nanorocks_ros.studies.measure.told_film import filmed_tray

    _check_outputs(options)
    samples = film_samples(Path(options.bag), options.image_topic, whole=True)
    guesses = _complete(options, samples)
    told: Any = options
    filmed = filmed_tray(told)
    assert filmed is not None
    if options.bead and len(options.bead) > 1 and not options.colour:
        filmed = _coloured(filmed, options.bead, samples)
    tray = described_tray(filmed, samples.size)
    beads = seen_beads(tray.text, samples.frames)
    counted, notice = _with_counts(filmed, beads)
    if notice:
        tray = described_tray(counted, samples.size)
    print_notices((*guesses, *tray.notices, *notice))
    write_bytes(Path(options.output), tray.text.encode())
    if options.picture:
        _write_picture(Path(options.picture), beads)
    _print(options, beads)
    return 0 if min(beads.counts) > 0 else EXIT_NOT_USABLE


def _check_outputs(options: argparse.Namespace) -> None:
    from nanorocks_ros.outputs.atomic_files import check_outputs

    names = {'--output': options.output, '--picture': options.picture}
    files = {flag: Path(name) for flag, name in names.items() if name}
    kinds = {'--output': ('.yaml', '.yml'), '--picture': ('.png',)}
    check_outputs(files, kinds, force=options.force)


def _complete(options: argparse.Namespace, samples: FilmSamples) -> tuple[str, ...]:
    """Put diameters in px into the options: of --bead, or guessed; notices."""
    from nanorocks_ros.studies.measure.seen_beads import guessed_diameter

    if options.bead and options.diameter_px:
        raise ConfigurationError(
            '--bead', 'and --diameter-px both tell the diameter', 'leave out one of them'
        )
    if options.bead:
        options.diameter_px = [diameter for _, _, diameter in options.bead]
    if options.diameter_px:
        return ()
    diameter = guessed_diameter(samples.frames)
    options.diameter_px = [round(diameter, 2)]
    return (f'the diameter is guessed: {diameter:.1f} px; --diameter-px sets it',)


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
    species = tuple(
        told if told.count is not None or seen < 1 else replace(told, count=round(seen))
        for told, seen in zip(filmed.beads, beads.counts, strict=True)
    )
    if species == filmed.beads:
        return filmed, ()
    numbers = ' and '.join(str(told.count) for told in species)
    share = min(beads.steady)
    return replace(filmed, beads=species), (
        f'the number of beads is guessed: {numbers}, seen in {100.0 * share:.0f} % of '
        'frames; --count sets it',
    )


def _write_picture(path: Path, beads: SeenBeads) -> None:
    import cv2

    from nanorocks_ros.outputs.atomic_files import write_bytes

    _, content = cv2.imencode('.png', beads.picture)
    write_bytes(path, content.tobytes())
    print(f'nanorocks: picture in {path}', file=sys.stderr)


def _print(options: argparse.Namespace, beads: SeenBeads) -> None:
    from nanorocks_ros.experiment.trays import load_trays

    species = next(iter(load_trays(options.output).values())).species
    rows = [
        {'material': kind.material, 'expected': kind.expected, 'seen': seen, 'share': share}
        for kind, seen, share in zip(species, beads.counts, beads.steady, strict=True)
    ]
    if options.json:
        print(json.dumps({'output': options.output, 'species': rows}))
    else:
        for row in rows:
            print(f'{row["material"]}: {row["seen"]:g} of {row["expected"]} beads seen (median)')
        film, output = shlex.quote(options.named[0]), shlex.quote(options.output)
        print(f'next: nanorocks measure {film} --tray {output} -o results')
    print(f'nanorocks: trays file in {options.output}', file=sys.stderr)
