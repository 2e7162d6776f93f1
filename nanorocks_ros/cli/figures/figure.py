"""``nanorocks figure KIND ...``: figures of the paper from measured or simulated data.

Tested by ``test/cli/figures/test_figure_decay.py``.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

MODULES = (
    'figure_cor',
    'figure_packing',
    'figure_dust',
    'figure_long_term',
    'figure_decay',
    'figure_impacts',
)
"""Modules of `nanorocks_ros.cli.figures` that add a kind, in the order of the help."""


def add_parser(commands: Any) -> None:
    """Add the command with all its kinds of figure."""
    parser = commands.add_parser('figure', help='draw a figure of the paper from results')
    kinds = parser.add_subparsers(dest='kind', metavar='KIND', required=True)
    for module in MODULES:
        import_module(f'{__package__}.{module}').add_parser(kinds)
