"""YAML reader whose errors name the line, for the files of trays and calibrations.

Tested by ``test/experiment/test_trays.py``.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from nanorocks_ros.errors import ConfigurationError, did_you_mean_file
from nanorocks_ros.experiment.yaml_limits import LOADER, check_yaml
from nanorocks_ros.limits import YAML_BYTES, require_regular_file


def parse_yaml(name: str, text: str) -> yaml.Node | None:
    """The node tree of a YAML text, with line numbers; None for an empty text.

    Parameters
    ----------
    name : str
        Name of the file, for errors.
    text : str

    Raises
    ------
    ConfigurationError
        When it is not YAML or exceeds a limit; names the line.
    """
    check_yaml(name, text)
    try:
        return yaml.compose(text, Loader=LOADER)
    except RecursionError as error:
        raise ConfigurationError(
            name, 'not YAML: nested too deeply', 'write it without such nesting'
        ) from error
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = mark.line + 1 if mark else 1
        reason = getattr(error, 'problem', None) or getattr(error, 'reason', 'cannot be read')
        raise ConfigurationError(
            f'{name}:{line}', f'not YAML: {reason}', 'correct this line'
        ) from error


def is_content(source: str | Path) -> bool:
    """Whether a setting is the content of a file, as a recording keeps it, and not its path."""
    return isinstance(source, str) and '\n' in source


def shown_name(source: str | Path, kind: str) -> str:
    """Name of a file in errors: its path, or what it is when a recording keeps its content."""
    return f'{kind} in the recording' if is_content(source) else str(source)


def file_content(source: str | Path, expected: str) -> str:
    """The content of a file, by its path or by itself.

    Parameters
    ----------
    source : str or Path
        A path; or, with a line break in it, the content.
    expected : str
        Kind of file that is expected, for the error.

    Raises
    ------
    ConfigurationError
        When it cannot be read.
    """
    return str(source) if is_content(source) else read_text(Path(source), expected)


def read_text(path: Path, expected: str) -> str:
    """The text of a file.

    Parameters
    ----------
    path : Path
    wanted : str
        Kind of file that is expected, for the error.

    Raises
    ------
    ConfigurationError
        When it cannot be read.
    """
    require_regular_file(path, ConfigurationError)
    try:
        YAML_BYTES.check(path.stat().st_size, str(path), ConfigurationError)
        return path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or 'is not UTF-8 text'
        near = did_you_mean_file(path) if isinstance(error, FileNotFoundError) else ''
        raise ConfigurationError(str(path), reason, near or f'name {expected}') from error


@lru_cache(maxsize=1000)
def _parsed(text: str) -> Any:
    """The value of plain text. To parse the words of the trays that flew takes most of a load."""
    return yaml.safe_load(text)


class YamlLines:
    """Reads YAML nodes; every error names the file and the line.

    Parameters
    ----------
    file : str
        Name of the file.
    """

    def __init__(self, file: str) -> None:
        self.file = file

    def error(self, node: yaml.Node | None, what: str, do: str) -> ConfigurationError:
        """An error about a node, or about the whole file."""
        return ConfigurationError(self.place(node), what, do)

    def place(self, node: yaml.Node | None) -> str:
        """File and line of a node."""
        return self.file if node is None else f'{self.file}:{node.start_mark.line + 1}'

    def pairs(self, node: yaml.Node | None) -> list[tuple[object, yaml.Node]]:
        """Keys and values; a duplicate key is refused."""
        if not isinstance(node, yaml.MappingNode):
            raise self.error(node, 'expected "name: value" entries', 'correct this line')
        keys: set[object] = set()
        pairs = []
        for key_node, value in node.value:
            key = self.scalar(key_node)
            if key in keys:
                raise self.error(key_node, f'{key!r} stands twice', 'remove one')
            keys.add(key)
            pairs.append((key, value))
        return pairs

    def mapping(
        self, node: yaml.Node | None, needed: set[str], allowed: set[str]
    ) -> dict[str, yaml.Node]:
        """Entries of a mapping; missing and unknown ones are refused."""
        entry = {str(key): value for key, value in self.pairs(node)}
        missing = sorted(needed - set(entry))
        unknown = sorted(set(entry) - needed - allowed)
        if missing:
            raise self.error(node, f'lacks {", ".join(missing)}', 'add it')
        if unknown:
            names = ', '.join(sorted(needed | allowed))
            raise self.error(entry[unknown[0]], f'unknown entry {unknown[0]!r}', f'use {names}')
        return entry

    def scalar(self, node: yaml.Node) -> Any:
        """A scalar, parsed as YAML."""
        if not isinstance(node, yaml.ScalarNode):
            raise self.error(node, 'expected a single value', 'correct this line')
        try:
            # Of plain text the compiled parser gives an empty style.
            value = node.value if node.style else _parsed(node.value)
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            raise self.error(node, f'{node.value[:40]!r} cannot be read', 'correct it') from error
        if isinstance(value, dict | list | set):
            raise self.error(node, 'expected a single value', 'correct this line')
        return value

    def number(self, node: yaml.Node, what: str = 'finite number') -> float:
        """A number that is finite."""
        value = self.scalar(node)
        usable = isinstance(value, int | float) and not isinstance(value, bool)
        if not usable or not math.isfinite(value):
            raise self.error(node, f'{value!r} is no {what}', 'correct this value')
        return float(value)

    def positive(self, node: yaml.Node) -> float:
        """A number above 0."""
        value = self.number(node, 'positive number')
        if value <= 0.0:
            raise self.error(
                node, f'{self.scalar(node)!r} is no positive number', 'correct this value'
            )
        return value

    def listed(self, node: yaml.Node) -> list[yaml.Node]:
        """The items of a list; a scalar counts as a list of one."""
        return list(node.value) if isinstance(node, yaml.SequenceNode) else [node]
