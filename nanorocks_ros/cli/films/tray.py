"""``nanorocks tray FILM -o mine.yaml``: describe beads and container of a film, in a trays file.

Tested by ``test/cli/films/test_tray.py``.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nanorocks_ros.studies.measure.seen_beads import SeenBeads

_EPILOG = """\
Examples:

  nanorocks tray film.mp4 -o mine.yaml
  nanorocks tray film.mp4 --browse -o mine.yaml
  nanorocks tray film.mp4 --corners 56 56 776 536 --sides-mm 90 60 --height-mm 4 --diameter-px 24
    --diameter-mm 3 --count 24 -o mine.yaml --picture mine.png

What is not told is guessed, and a line says so. Corners and beads are given in px of the film.
"""


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.films.film_options import add_film_options
    from nanorocks_ros.cli.imported_films import accept_films

    parser = commands.add_parser(
        'tray',
        help='describe beads and container of a film in a trays file',
        epilog=_EPILOG,
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
    parser.add_argument(
        '--browse',
        action='store_true',
        help='a page in the browser, on this machine only, to mark corners and beads; it shows '
        'what is recognised',
    )
    parser.add_argument('-o', '--output', required=True, help='trays file to write, .yaml')
    parser.add_argument('--picture', help='picture of what is recognised to write, .png')
    parser.add_argument('--image-topic', default='', help='camera topic of a bag')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.add_argument('--force', action='store_true', help='replace files that exist')
    finer = '--look', '--colour', '--material', '--density-g-cm3'
    parser.leave_out(*finer, '--image-topic', '--json', '--force')
    parser.set_defaults(run=run, trays_file='')


def run(options: argparse.Namespace) -> int:
    """Describe, recognise, write, and return the exit code."""
    from nanorocks_ros.cli.films.recognised_tray import recognised_tray, save
    from nanorocks_ros.cli.remedies import print_notices
    from nanorocks_ros.studies.analysis.recognition_verdicts import EXIT_NOT_USABLE
    from nanorocks_ros.studies.measure.film_samples import film_samples

    _check_outputs(options)
    if options.browse:
        from nanorocks_ros.cli.films.tray_page import check_browsing, described_in_browser

        check_browsing(options)
    samples = film_samples(Path(options.bag), options.image_topic, whole=True)
    if options.browse:
        tray = described_in_browser(options, samples)
    else:
        tray = recognised_tray(options, samples)
        save(options, tray)
    print_notices(tray.notices, options)
    _print(options, tray.beads)
    return 0 if min(tray.beads.counts) > 0 else EXIT_NOT_USABLE


def _check_outputs(options: argparse.Namespace) -> None:
    from nanorocks_ros.outputs.atomic_files import check_outputs

    names = {'--output': options.output, '--picture': options.picture}
    files = {flag: Path(name) for flag, name in names.items() if name}
    kinds = {'--output': ('.yaml', '.yml'), '--picture': ('.png',)}
    check_outputs(files, kinds, force=options.force)


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
            told = '' if row['expected'] is None else f' of {row["expected"]}'
            print(f'{row["material"]}: {row["seen"]:g}{told} beads seen (median)')
        film, output = shlex.quote(options.named[0]), shlex.quote(options.output)
        print(f'next: nanorocks measure {film} --trays-file {output} -o results')
    print(f'nanorocks: trays file in {options.output}', file=sys.stderr)
