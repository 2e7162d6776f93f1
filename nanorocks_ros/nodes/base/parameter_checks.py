"""Checks of the names of parameters, and of strings that YAML reads as something else."""

from __future__ import annotations

import inspect
import itertools
import sys
from typing import TYPE_CHECKING

from nanorocks_ros import settings
from nanorocks_ros.errors import ConfigurationError, did_you_mean
from nanorocks_ros.nodes.base.communication.qos_overrides import PREFIX as OVERRIDES

if TYPE_CHECKING:
    from collections.abc import Iterable

_PREFIXES = ('', 'simulation.', 'scene.', 'dashboard_')
_FLAGS = ('-p', '--param')


def unknown_parameters(given: Iterable[str], declared: Iterable[str]) -> list[str]:
    """Describe the parameters that were given to a node and that nobody reads.

    Parameters
    ----------
    given : iterable of str
        Names that were given to the node and that it does not have.
    declared : iterable of str
        Names that it has.

    Returns
    -------
    list of str
        A sentence for each unknown name. In a file, a name is known if any node has it; on the
        command line, if this node has it. QoS overrides are known.
    """
    of_any_node = _parameters_of_all_nodes()
    on_command_line = command_line_parameters()
    unknown = [
        name
        for name in sorted(given)
        if not name.startswith(OVERRIDES) and (name in on_command_line or name not in of_any_node)
    ]
    return [_describe(name, declared) for name in unknown]


def _describe(name: str, declared: Iterable[str]) -> str:
    hint = did_you_mean(name, list(declared))
    suggestion = f' ({hint})' if hint else ''
    return f'no parameter {name!r}{suggestion}'


def _parameters_of_all_nodes() -> set[str]:
    groups = [group for _, group in inspect.getmembers(settings, inspect.isclass)]
    names = {
        name
        for group in groups
        if group.__module__.startswith(settings.__name__) and group.__name__.endswith('Settings')
        for row in settings.rows(group())
        for name in (row.name, row.deprecated)
        if name
    }
    return {prefix + name for prefix in _PREFIXES for name in names} | {'use_sim_time'}


def command_line_parameters() -> dict[str, str]:
    """Values as typed in ``-p NAME:=VALUE`` or ``-p NODE:NAME:=VALUE``, by name."""
    pairs = itertools.pairwise(sys.argv)
    rules = (rule.partition(':=') for flag, rule in pairs if flag in _FLAGS)
    return {name.rsplit(':', 1)[-1]: value for name, _, value in rules}


def require_string(name: str, value: object) -> None:
    """Refuse a value of a string parameter that YAML has read as another type.

    Parameters
    ----------
    name : str
        Of the parameter.
    value : object
        As read from YAML.

    Raises
    ------
    ConfigurationError
        With the quotes that the value needs.
    """
    if isinstance(value, str):
        return
    typed = command_line_parameters()
    if name in typed:
        remedy = f'quote it twice: -p "{name}:=\'{typed[name]}\'"'
    else:
        remedy = f"quote it: {name}: '{value}'"
    raise ConfigurationError(f'parameter {name}', f'{value!r} is not a string', remedy)
