"""Which parameters there are, and which of those given nobody reads."""

from __future__ import annotations

import difflib
import inspect
import itertools
import sys

from nanorocks_ros import settings
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes._overrides import PREFIX as OVERRIDES

_PREFIXES = ('', 'simulation.', 'scene.', 'dashboard_')
_FLAGS = ('-p', '--param')


def unknown_parameters(given, declared):
    """What is wrong with the names of parameters that a node did not declare.

    Parameters
    ----------
    given : iterable of str
        Names that were given to it and that it does not have.
    declared : iterable of str
        Names that it has.

    Returns
    -------
    list of str
        A sentence for each name that is not known; a name in a file is known if any node has it,
        one on the command line if this node has it. Overrides of a quality of service are known.
    """
    anywhere = _of_all_nodes()
    direct = on_the_command_line()
    wrong = [
        name
        for name in sorted(given)
        if not name.startswith(OVERRIDES) and (name in direct or name not in anywhere)
    ]
    return [_sentence(name, declared) for name in wrong]


def _sentence(name, declared):
    near = difflib.get_close_matches(name, list(declared), n=1)
    guess = f' (did you mean {near[0]!r}?)' if near else ''
    return f'no parameter {name!r}{guess}'


def _of_all_nodes():
    groups = [one for _, one in inspect.getmembers(settings, inspect.isclass)]
    names = {
        name
        for group in groups
        if group.__module__.startswith(settings.__name__) and group.__name__.endswith('Settings')
        for row in settings.rows(group())
        for name in (row.name, row.deprecated)
        if name
    }
    return {prefix + name for prefix in _PREFIXES for name in names} | {'use_sim_time'}


def on_the_command_line():
    """Texts of parameters set by ``-p NAME:=TEXT`` or ``-p NODE:NAME:=TEXT``, by name."""
    after = itertools.pairwise(sys.argv)
    rules = (rule.partition(':=') for flag, rule in after if flag in _FLAGS)
    return {name.rsplit(':', 1)[-1]: text for name, _, text in rules}


def require_text(name, value):
    """Refuse what YAML, in which parameters are written, took for something other than a text.

    Parameters
    ----------
    name : str
        Of the parameter.
    value : object
        What it was taken for.

    Raises
    ------
    ConfigurationError
        With how to quote it.
    """
    if isinstance(value, str):
        return
    texts = on_the_command_line()
    if name in texts:
        remedy = f'quote it twice: -p "{name}:=\'{texts[name]}\'"'
    else:
        remedy = f"quote it: {name}: '{value}'"
    raise ConfigurationError(f'parameter {name}', f'{value!r} is not a text', remedy)
