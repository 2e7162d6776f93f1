"""``nanorocks figure KIND ...``: figures of measured and simulated gases, as in the paper."""

from __future__ import annotations

from importlib import import_module
from typing import Any

MODULES = (
    'figure_cor',
    'figure_packing',
    'figure_dust',
    'figure_long_term',
    'figure_decay',
)
"""Modules of `nanorocks_ros.cli.figures` that add their kinds, in the order of the help."""


def add_parser(commands: Any) -> None:
    """Add the command with all its kinds."""
    parser = commands.add_parser('figure', help='draw what was measured as the paper does')
    kinds = parser.add_subparsers(dest='kind', metavar='KIND', required=True)
    for module in MODULES:
        import_module(f'{__package__}.{module}').add_parser(kinds)
