"""The page of the public Python interface, from ``nanorocks_ros.__all__`` and its docstrings.

Tested by ``test/interface/test_python_page.py``.
"""

from __future__ import annotations

import inspect
from typing import Any

import nanorocks_ros

_HEAD = """# The public Python interface

Made by `make docs` from `nanorocks_ros.__all__`; [python](../use/python.md) shows its use. These
names are stable: a change is announced one release before, and the old name works until then.

"""


def python_page() -> str:
    """Functions with their keywords, results with their tables, exceptions."""
    public = {name: getattr(nanorocks_ros, name) for name in nanorocks_ros.__all__}
    functions = {name: value for name, value in public.items() if inspect.isfunction(value)}
    classes = {name: value for name, value in public.items() if inspect.isclass(value)}
    errors = {name: value for name, value in classes.items() if issubclass(value, Exception)}
    text = _HEAD + _table(
        ('function', 'what it does', 'result'),
        [
            (f'`{name}`', _sentence(value), f'`{_returned(value)}`')
            for name, value in functions.items()
        ],
    )
    for name, value in functions.items():
        text += f'## {name}\n\n```text\n{_call(name, value)}\n```\n\n'
        text += _table(('keyword', 'meaning'), _parameters(value))
    for name, value in classes.items():
        if issubclass(value, dict):
            text += f'## {name}\n\n{_sentence(value)}\n\n'
            text += _table(('keyword', 'meaning'), _parameters(value))
        elif name not in errors:
            text += f'## {name}\n\n{_sentence(value)}\n\n'
            text += _table(('attribute', 'meaning'), _attributes(value))
    text += '## Exceptions\n\nEach says `.where`, `.what` and what to `.do`.\n\n'
    return (
        text
        + _table(
            ('exception', 'meaning'),
            [(f'`{name}`', _sentence(value)) for name, value in errors.items()],
        ).rstrip('\n')
        + '\n'
    )


def _sentence(value: Any) -> str:
    """First paragraph of the docstring, on a line."""
    first = (inspect.getdoc(value) or '').partition('\n\n')[0]
    return ' '.join(first.replace('``', '`').split())


def _returned(function: Any) -> str:
    return str(function.__annotations__['return'])


def _call(name: str, function: Any) -> str:
    signature = inspect.signature(function)
    bare = [own.replace(annotation=own.empty) for own in signature.parameters.values()]
    empty = signature.empty
    return f'{name}{signature.replace(parameters=bare, return_annotation=empty)}'


def _parameters(function: Any) -> list[tuple[str, str]]:
    """Names and meanings in the section on parameters of a numpy docstring."""
    doc = inspect.getdoc(function) or ''
    section = doc.partition('Parameters\n----------\n')[2].partition('\n\nReturns\n')[0]
    rows: list[tuple[str, str]] = []
    for line in section.splitlines():
        if line and not line.startswith(' '):
            rows.append((f'`{line}`', ''))
        elif line:
            name, meaning = rows[-1]
            rows[-1] = name, f'{meaning} {line.strip()}'.strip()
    return [(name, meaning.replace('``', '`')) for name, meaning in rows]


def _attributes(kind: Any) -> list[tuple[str, str]]:
    """Properties and methods of a class, its own before those of all results."""
    names = [
        name
        for base in kind.__mro__[:-1]
        for name, value in vars(base).items()
        if not name.startswith('_') and (isinstance(value, property) or callable(value))
    ]
    rows = []
    for name in dict.fromkeys(names):
        value = inspect.getattr_static(kind, name)
        shown = name if isinstance(value, property) else _call(name, value).replace('self, ', '')
        rows.append((f'`.{shown.replace("(self)", "()")}`', _sentence(value)))
    return rows


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [f'| {" | ".join(head)} |', '| ' + ' | '.join('---' for _ in head) + ' |']
    lines += ['| ' + ' | '.join(cell.replace('|', '\\|') for cell in row) + ' |' for row in rows]
    return '\n'.join(lines) + '\n\n'
