"""YAML within limits: 3 kB of aliases may stand for more nodes than fit into any memory.

The events of the parser are counted before anything is built. Every reader of YAML goes through
here.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.limits import DIGITS, YAML_BYTES, YAML_DEPTH, YAML_NODES

# The C parser is ten times as fast; PyYAML may be built without it.
LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
_NUMBER = re.compile(r'[-+0-9_.:xXoOa-fA-F]+')
_NODES = (yaml.ScalarEvent, yaml.SequenceStartEvent, yaml.MappingStartEvent)


def load_yaml(name: str, text: str) -> Any:
    """The content of a YAML text, within the limits.

    Parameters
    ----------
    name : str
        Name of the file, for errors.
    text : str

    Raises
    ------
    ConfigurationError
        If it exceeds a limit, or is not YAML; in one line.
    """
    check_yaml(name, text)
    try:
        return yaml.load(text, Loader=LOADER)
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError, TypeError) as error:
        raise ConfigurationError(name, f'not YAML: {_line(error)}', 'correct it') from error


def check_yaml(name: str, text: str) -> None:
    """Raise for a YAML text that exceeds a limit; errors of the syntax are left to its reader.

    Raises
    ------
    ConfigurationError
        Names the setting that raises the limit.
    """
    YAML_BYTES.check(len(text), name, ConfigurationError)
    counter = _Counter(name)
    try:
        for event in yaml.parse(text, Loader=LOADER):
            counter.add(event)
    except yaml.YAMLError:
        return


class _Counter:
    """Counts the nodes that a text stands for, with every alias written out.

    Parameters
    ----------
    name : str
    """

    def __init__(self, name: str) -> None:
        self._name = name
        # Nodes in each open collection, with the name of its anchor; and of each closed anchor.
        self._open: list[tuple[str | None, int]] = []
        self._sizes: dict[str, int] = {}
        self._total = 0

    def add(self, event: yaml.Event) -> None:
        if isinstance(event, yaml.AliasEvent):
            self._add_alias(event)
        elif isinstance(event, _NODES):
            self._grow(1)
            if isinstance(event, yaml.ScalarEvent):
                self._check_scalar(event)
            else:
                YAML_DEPTH.check(len(self._open) + 1, self._place(event), ConfigurationError)
                self._open.append((event.anchor, self._total - 1))
        elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
            anchor, before = self._open.pop()
            if anchor is not None:
                self._sizes[anchor] = self._total - before

    def _add_alias(self, event: yaml.AliasEvent) -> None:
        if any(anchor == event.anchor for anchor, _ in self._open):
            raise ConfigurationError(
                self._place(event),
                f'the alias {str(event.anchor)[:40]!r} stands inside of what it stands for',
                'write it out',
            )
        self._grow(self._sizes.get(event.anchor or '', 1))

    def _grow(self, nodes: int) -> None:
        self._total += nodes
        if self._total > YAML_NODES.value:
            raise YAML_NODES.exceeded(None, ConfigurationError, self._name)

    def _check_scalar(self, event: yaml.ScalarEvent) -> None:
        if event.anchor is not None:
            self._sizes[event.anchor] = 1
        value = event.value
        if len(value) > DIGITS.value and not event.style and _NUMBER.fullmatch(value):
            raise DIGITS.exceeded(len(value), ConfigurationError, self._place(event))

    def _place(self, event: yaml.Event) -> str:
        mark = event.start_mark
        return self._name if mark is None else f'{self._name}:{mark.line + 1}'


def _line(error: Exception) -> str:
    return ' '.join(str(getattr(error, 'problem', None) or error).split())[:200]
