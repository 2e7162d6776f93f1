"""Mechanism of settings: a dataclass field with range, unit and documentation."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

from nanorocks_ros.errors import ConfigurationError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

Scalar = bool | int | float | str


Value = Scalar | tuple[int, ...] | tuple[float, ...]


SettingsType = TypeVar('SettingsType')
ValueType = TypeVar('ValueType')

# What to do about a setting that does not exist, and about a value that is not allowed.
SETTINGS_LISTED = (
    '`nanorocks analyse --help-all` lists the settings of a measurement, `nanorocks simulate '
    '--help-all` those of a simulation'
)
IN_RANGE = 'give values of this type and range'


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Allowed values of a setting: a closed range of numbers, or a list of names."""

    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    whole: bool = False


def setting(
    default: Value,
    doc: str,
    unit: str = '',
    *,
    deprecated: str = '',
    everyday: bool = False,
    placeholder: str = '',
    **bounds: Any,
) -> Any:
    """A field of a settings class.

    Parameters
    ----------
    default : bool, int, float, str or tuple
    doc : str
        One sentence for the documentation, the ROS parameter and the flag.
    unit : str
        Empty for a number without unit.
    deprecated : str
        Name of this setting in the previous release, without its group. It is accepted for one
        release, with a warning.
    everyday : bool
        Whether its flag is in the short help of commands.
    placeholder : str
        What stands for the value in the help of the flag; empty: the choices, or the unit.
    **bounds
        Fields of `Bounds`.
    """
    metadata = {
        'doc': doc,
        'unit': unit,
        'deprecated': deprecated,
        'everyday': everyday,
        'placeholder': placeholder,
        'bounds': Bounds(**bounds),
    }
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingRow:
    """One setting, as the documentation, the ROS parameter and the flag need it.

    `name` and `deprecated`, the name in the previous release, include the group:
    ``tracking.max_speed``. `deprecated` is empty for a setting that was not renamed. Everyday
    settings are in the short help; the placeholder is empty where choices or unit stand for it.
    """

    name: str
    default: Value
    doc: str
    unit: str
    bounds: Bounds
    deprecated: str = ''
    everyday: bool = False
    placeholder: str = ''


def rows(settings: Any, prefix: str = '') -> Iterator[SettingRow]:
    """Every setting under a dataclass of settings, nested ones with dotted names."""
    for item in fields(settings):
        value = getattr(settings, item.name)
        if is_dataclass(value):
            yield from rows(value, f'{prefix}{item.name}.')
        else:
            deprecated = item.metadata['deprecated']
            yield SettingRow(
                name=prefix + item.name,
                default=value,
                doc=item.metadata['doc'],
                unit=item.metadata['unit'],
                bounds=item.metadata['bounds'],
                deprecated=prefix + deprecated if deprecated else '',
                everyday=item.metadata['everyday'],
                placeholder=item.metadata['placeholder'],
            )


def _number_problem(value: float, bounds: Bounds) -> str | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return f'{value!r} is not a number'
    # Integers of Python may be too large for a float.
    if isinstance(value, float) and not math.isfinite(value):
        return f'{value!r} is not finite'
    if bounds.whole and isinstance(value, float) and not value.is_integer():
        return f'{value!r} is not a whole number'
    if not bounds.low <= value <= bounds.high:
        return f'{value!r} is outside [{bounds.low:g}, {bounds.high:g}]'
    return None


def problem(row: SettingRow, value: Any) -> str | None:
    """Why a value cannot be this setting, or None when it can."""
    if isinstance(row.default, bool):
        return None if isinstance(value, bool) else f'{value!r} is neither true nor false'
    if isinstance(row.default, str):
        choices = row.bounds.choices
        if not isinstance(value, str):
            return f'{value!r} is not a text'
        if choices and value not in choices:
            return f'{value!r} is none of {", ".join(choices)}{_hint(value, choices)}'
        return None
    if isinstance(row.default, tuple):
        if isinstance(value, str):
            return f'{value!r} is not a list of numbers'
        problems = (_number_problem(item, row.bounds) for item in _as_list(value))
        return next((text for text in problems if text), None)
    if isinstance(row.default, int) and isinstance(value, float) and not value.is_integer():
        return f'{value!r} is not a whole number'
    return _number_problem(value, row.bounds)


def _hint(word: str, known: Iterable[str] | Mapping[str, str]) -> str:
    hint = did_you_mean(word, known)
    return f', {hint}' if hint else ''


def _as_list(value: Any) -> list[Any]:
    """A list of the values; a single number becomes a list of one."""
    return list(value) if hasattr(value, '__iter__') else [value]


def coerced(row: SettingRow, value: Any) -> Value:
    """A value without a `problem` in the type of the setting: 15 as 15.0, a list as a tuple."""
    if isinstance(row.default, tuple):
        return tuple(int(item) if row.bounds.whole else float(item) for item in _as_list(value))
    kind = type(row.default)
    return kind(value)


def with_current_names(
    settings: Any, values: Mapping[str, ValueType], where: str, prefix: str = ''
) -> tuple[dict[str, ValueType], tuple[str, ...]]:
    """Values under the current names of their settings, and a warning for each deprecated name.

    Parameters
    ----------
    settings : dataclass of settings
    values : mapping
        Setting name, current or deprecated, to value. Other names are passed on.
    where : str
        Source of the values, for the messages: a file, a node, the command line.
    prefix : str
        Text before each name in `values`.

    Returns
    -------
    values : dict
        Current setting name to value, in the order given.
    messages : tuple of str
        One sentence for each deprecated name.

    Raises
    ------
    ConfigurationError
        When a setting is given under its current and its deprecated name.
    """
    renamed = {
        prefix + row.deprecated: prefix + row.name for row in rows(settings) if row.deprecated
    }
    deprecated = [name for name in values if name in renamed]
    for name in deprecated:
        if renamed[name] in values:
            raise ConfigurationError(
                where,
                f'{name!r} and {renamed[name]!r} are the same setting',
                f'give {renamed[name]!r} alone',
            )
    messages = tuple(
        f'{where}: {name!r} is now called {renamed[name]!r}; the old name will be removed in the '
        'next release'
        for name in deprecated
    )
    return {renamed.get(name, name): value for name, value in values.items()}, messages


def with_values(settings: SettingsType, values: Mapping[str, Any], where: str) -> SettingsType:
    """The settings with some values replaced, all of them checked.

    Parameters
    ----------
    settings : dataclass of settings
    values : mapping
        Setting name with its group, ``tracking.max_speed``, to new value. A deprecated name is
        accepted with a FutureWarning.
    where : str
        Source of the values, for the messages: a file, a node, the command line.

    Raises
    ------
    ConfigurationError
        For an unknown name or a value outside its range; every problem is listed. Also for a
        setting given under its current and its deprecated name.
    """
    values, messages = with_current_names(settings, values, where)
    for message in messages:
        warnings.warn(message, FutureWarning, stacklevel=2)
    known = {row.name: row for row in rows(settings)}
    # The group may be left out.
    near = {name.rpartition('.')[2]: name for name in known} | {name: name for name in known}
    unknown = [name for name in values if name not in known]
    problems = [f'no setting {name!r}{_hint(name, near)}' for name in unknown]
    for name, value in values.items():
        text = problem(known[name], value) if name in known else None
        if text:
            problems.append(f'{name}: {text}')
    if problems:
        remedy = SETTINGS_LISTED if unknown else IN_RANGE
        raise ConfigurationError(where, '; '.join(problems), remedy)
    changed: SettingsType = _replaced(
        settings, {name: coerced(known[name], value) for name, value in values.items()}
    )
    return changed


def _replaced(settings: Any, values: Mapping[str, Value]) -> Any:
    own = {name: value for name, value in values.items() if '.' not in name}
    for group in {name.split('.', 1)[0] for name in values if '.' in name}:
        inner = {
            name.split('.', 1)[1]: value
            for name, value in values.items()
            if name.startswith(f'{group}.')
        }
        own[group] = _replaced(getattr(settings, group), inner)
    return replace(settings, **own)
