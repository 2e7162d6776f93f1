"""``nanorocks figure impacts RESULTS...``: restitution against impact speed, from contacts."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.parsing.tray_options import add_tray
from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.settings import PriorSettings

_PICTURES = ('.png', '.pdf', '.svg')
_TEXT = 'restitution against impact speed, from single contacts, with laws (figure 13)'
_EPILOG = """\
Takes the collisions and rebounds in the cooling windows of all cycles: their restitution in ranges
of the impact speed, the constant one and the power law of 1 - restitution with 95 % bands, beside
the values of the paper. Example:

  nanorocks analyse BAG && nanorocks figure impacts BAG_results -o impacts.png
"""


def add_parser(kinds: Any) -> None:
    """Add the kind to those of ``nanorocks figure``."""
    parser = kinds.add_parser(
        'impacts',
        help=_TEXT,
        description=_TEXT,
        epilog=_EPILOG,
    )
    parser.add_argument(
        'results', nargs='+', help='folders of results of `nanorocks analyse`, of bags or a batch'
    )
    parser.add_argument('-o', '--output', required=True, help='picture: .png, .pdf or .svg')
    add_tray(parser, 'number of the tray; required with several trays')
    parser.add_argument('--parameters', help='ROS parameter file with the priors')
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument('--force', action='store_true', help='replace a picture that exists')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Read, draw and print, and return the exit code."""
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.studies.analysis.results.contact_tables import contacts_of_results
    from nanorocks_ros.studies.figures.impact_figure import ImpactData, impact_figure

    path = Path(options.output)
    check_outputs({'--output': path}, {'--output': _PICTURES}, force=options.force)
    prior = _prior(options)
    folders = [folder for name in options.results for folder in _folders(Path(name))]
    tray = _tray(folders, options.tray)
    terms, losses, cycles = contacts_of_results(folders, tray, prior)
    values = impact_figure(
        path, ImpactData(tray=tray, cycles=cycles, terms=terms, losses=losses, prior=prior)
    )
    if options.json:
        print(json.dumps(values, allow_nan=False))
    else:
        _print(values)
    print(f'nanorocks: contacts of tray {tray} in {path}', file=sys.stderr)
    return 0


def _prior(options: argparse.Namespace) -> PriorSettings:
    from nanorocks_ros.cli.flags import settings_from
    from nanorocks_ros.settings import PipelineSettings

    return settings_from(options, PipelineSettings(), options.parameters).prior


def _folders(path: Path) -> list[Path]:
    """The folder itself, or those of the recordings of a batch."""
    from nanorocks_ros.studies.batch.manifest_entries import BAGS

    inner = path / BAGS
    if not inner.is_dir():
        return [path]
    return sorted(folder for folder in inner.iterdir() if folder.is_dir())


def _tray(folders: list[Path], tray: int | None) -> int:
    from nanorocks_ros.studies.analysis.results.result_tables import trays_of

    numbers = sorted({number for folder in folders for number in trays_of(folder, 'cor')})
    if tray is None and len(numbers) == 1:
        return numbers[0]
    if tray in numbers:
        return tray
    listed = ', '.join(str(number) for number in numbers)
    problem = 'is needed' if tray is None else f'{tray} is not among them'
    raise ConfigurationError('--tray', f'{problem}: the results hold trays {listed}', 'name one')


def _print(values: dict[str, Any]) -> None:
    for kind in ('beads', 'walls'):
        contacts = values[kind]
        if contacts is None:
            print(f'{kind}: too few contacts')
            continue
        print(f'{kind}: constant {_text(contacts["constant"], 3)}')
        if law := contacts['law']:
            print(
                f'  law: {_text(law["impact_restitution"], 3)} at '
                f'{1e3 * law["impact_speed"]:.2f} mm/s, exponent of 1 - restitution '
                f'{_text(law["exponent"], 2)}, weighted by energy '
                f'{_text(law["energy_weighted"], 3)}; a constant one has a chance of '
                f'{law["chance_of_constant"]:.2g}'
            )


def _text(limits: dict[str, float], digits: int) -> str:
    value, lower, upper = (f'{limits[name]:.{digits}f}' for name in ('value', 'lower', 'upper'))
    return f'{value} [{lower}, {upper}]'
