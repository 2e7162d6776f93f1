"""What a recording says of its own experiment: trays, beads, scale and place in the picture.

Each entry of the metadata is ``experiment.`` and the name of a setting without its group. Files
are kept with their content, so that a recording needs nothing beside it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.calibration_file import load_calibration
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.yaml_lines import file_content
from nanorocks_ros.settings import PipelineSettings, problem, rows, with_values

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

_PREFIX = 'experiment.'
_TRAYS, _TRAYS_FILE = 'trays', 'trays_file'
_LAYOUT, _REGIONS = 'preprocess.layout', 'preprocess.regions_px'
_SCALE, _CALIBRATION = 'preprocess.pixels_per_metre', 'preprocess.calibration'
EXPERIMENT_SETTINGS = (_TRAYS, _TRAYS_FILE, _LAYOUT, _REGIONS, _SCALE, _CALIBRATION)
"""Names of the settings that a recording can hold."""

# A trays file of eight trays has 3 kB, a calibration file 1 kB; more is no such file.
_LONGEST_FILE, _LONGEST_VALUE = 1 << 16, 1 << 10
# What is told replaces what is stored: a calibration holds scale and regions, a layout gives them.
_REPLACED = {
    _CALIBRATION: {_CALIBRATION, _LAYOUT, _REGIONS, _SCALE},
    _REGIONS: {_REGIONS, _LAYOUT, _CALIBRATION},
    _LAYOUT: {_REGIONS, _LAYOUT, _CALIBRATION},
    _SCALE: {_SCALE, _CALIBRATION},
    _TRAYS: {_TRAYS},
    _TRAYS_FILE: {_TRAYS_FILE},
}


class RecordedSettings(NamedTuple):
    """Settings completed by a recording, and what the user should know of that.

    Parameters
    ----------
    settings : PipelineSettings
    notices : tuple of str
        An assumption, or a contradiction; one line each.
    trays_known : bool
        Whether the trays are told or recorded, and not assumed.
    """

    settings: PipelineSettings
    notices: tuple[str, ...]
    trays_known: bool = True


def experiment_metadata(values: Mapping[str, Any]) -> dict[str, str]:
    """Metadata of a recording from settings by their names; empty values are left out.

    Parameters
    ----------
    values : mapping of str to value
        Of `EXPERIMENT_SETTINGS`; other names are ignored. A file may be a path or a text.

    Raises
    ------
    ConfigurationError
        When a file cannot be read.
    """
    known = {name: values[name] for name in EXPERIMENT_SETTINGS if values.get(name)}
    if _CALIBRATION in known:
        # It holds scale and regions, and replaces what is told of them.
        known = {name: known[name] for name in known if name not in (_LAYOUT, _REGIONS, _SCALE)}
        known.setdefault(_TRAYS, sorted(load_calibration(known[_CALIBRATION]).regions))
    if _REGIONS in known:
        known.pop(_LAYOUT, None)
    return {experiment_key(name): _as_text(name, value) for name, value in known.items()}


def metadata_of_settings(settings: PipelineSettings) -> dict[str, str]:
    """Metadata of a recording that is made, or was analysed, with these settings.

    Raises
    ------
    ConfigurationError
        When a file cannot be read.
    """
    return experiment_metadata({row.name: row.default for row in rows(settings)})


def recorded_settings(
    settings: PipelineSettings, told: Collection[str], metadata: Mapping[str, str], place: str
) -> RecordedSettings:
    """The settings, completed by what a recording says of itself.

    Parameters
    ----------
    settings : PipelineSettings
        Defaults, and what the user told.
    told : collection of str
        Names of the settings that the user told; they win.
    metadata : mapping of str to str
        Of the recording.
    place : str
        Name of the recording, for errors and notices.

    Raises
    ------
    RecordingError
        When an entry that is needed cannot be used; the remedy is to tell it.
    ConfigurationError
        When a file that the user named cannot be used.
    """
    stored = _stored(metadata, set(told), place)
    given = {row.name: row.default for row in rows(settings)}
    notices = _contradictions(given, set(told), stored, place)
    replaced: set[str] = set().union(*(_REPLACED.get(name, set()) for name in told))
    values = {name: value for name, value in stored.items() if name not in replaced}
    own = values.get(_TRAYS_FILE, given[_TRAYS_FILE])
    of_single_tray = _of_single_tray(own) if _TRAYS not in {*told, *stored} else {}
    values |= of_single_tray
    trays_known = bool(of_single_tray) or _TRAYS in told or _TRAYS in stored
    if not trays_known:
        notices.append(
            f'{place}: does not say which trays it shows; '
            f'{_trays_text(settings.trays)} assumed; '
            'set trays, as in --trays 3'
        )
    if _REGIONS in values:
        regions = _regions(settings.trays if _TRAYS in told else stored[_TRAYS], stored)
        values.pop(_REGIONS)
        values |= {_REGIONS: regions} if regions else {}
    # A file that was made for the film says more of it than the recording.
    values |= {
        name: value for name, value in _of_film(own).items() if name not in {*replaced, *told}
    }
    return RecordedSettings(with_values(settings, values, place), tuple(notices), trays_known)


def _of_single_tray(trays_file: str) -> dict[str, Any]:
    """The number of the tray where a file describes a single one; else nothing."""
    numbers = sorted(load_trays(trays_file)) if trays_file else []
    return {_TRAYS: numbers} if len(numbers) == 1 else {}


def _of_film(trays_file: str) -> dict[str, Any]:
    """What a trays file says of its film."""
    section = film_section(trays_file)
    return {} if section is None else section.settings()


def experiment_key(name: str) -> str:
    """Key of a setting in the metadata of a recording."""
    return _PREFIX + name.rpartition('.')[2]


def _as_text(name: str, value: Any) -> str:
    if name in (_TRAYS_FILE, _CALIBRATION):
        return file_content(value, 'a readable YAML file')
    return ' '.join(f'{number}' for number in value) if _is_list(value) else f'{value}'


def _is_list(value: Any) -> bool:
    return isinstance(value, tuple | list)


def _stored(metadata: Mapping[str, str], told: set[str], place: str) -> dict[str, Any]:
    """Settings that the recording holds and that are not told."""
    keys = {name: experiment_key(name) for name in EXPERIMENT_SETTINGS}
    texts = {name: metadata[key] for name, key in keys.items() if key in metadata}
    if not texts:
        return _stored_before(metadata)
    by_name = {row.name: row for row in rows(PipelineSettings())}
    stored: dict[str, Any] = {}
    for name, text in texts.items():
        try:
            value = _value(name, text)
            fault = problem(by_name[name], value)
            if fault is None and name in (_TRAYS_FILE, _CALIBRATION):
                _ = load_trays(value) if name == _TRAYS_FILE else load_calibration(value)
        except (ValueError, ConfigurationError) as error:
            fault = str(error)
        if fault is None:
            stored[name] = value
        elif name not in told:
            raise RecordingError(
                f'{place}: {keys[name]}', _shortened(fault), f'set {name}, which replaces it'
            )
    if _REGIONS in stored and len(stored[_REGIONS]) != 4 * len(stored.get(_TRAYS, ())):
        if not told & {_REGIONS, _LAYOUT, _CALIBRATION}:
            raise RecordingError(
                f'{place}: {keys[_REGIONS]}',
                'holds not four numbers for each tray',
                f'set {_REGIONS}, which replaces it',
            )
        del stored[_REGIONS]
    return stored


def _shortened(text: str) -> str:
    """One line of a text from a recording, which may be anything."""
    line = ' '.join(text.split())
    return line if len(line) <= 200 else f'{line[:200]} ...'


def _value(name: str, text: str) -> Any:
    is_file = name in (_TRAYS_FILE, _CALIBRATION)
    longest = _LONGEST_FILE if is_file else _LONGEST_VALUE
    if len(text) > longest:
        raise ValueError(f'holds {len(text)} characters, more than {longest}')
    if is_file:
        # A text with a line break is content, not a path.
        return text if '\n' in text else f'{text}\n'
    if name == _LAYOUT:
        return text
    try:
        if name == _SCALE:
            return float(text)
        numbers = [int(word) for word in text.split()]
    except ValueError:
        raise ValueError(f'{text!r} is not a number') from None
    if not numbers:
        raise ValueError('is empty')
    if name == _TRAYS and len(set(numbers)) < len(numbers):
        raise ValueError(f'{text!r} names a tray twice')
    return numbers


def _stored_before(metadata: Mapping[str, str]) -> dict[str, Any]:
    """What recordings of version 0.1.0 say by their settings; nothing of unknown ones."""
    if 'nanorocks_ros' not in metadata or 'import' in metadata or metadata.get('trays_file'):
        return {}
    if 'scene.trays' in metadata:
        texts = {_TRAYS: 'scene.trays', _SCALE: 'scene.pixels_per_metre'}
        stored: dict[str, Any] = {_LAYOUT: 'plate'}
    elif 'tray' in metadata and 'trays' not in metadata:
        texts, stored = {_TRAYS: 'tray', _SCALE: 'pixels_per_metre'}, {}
    else:
        return {}
    by_name = {row.name: row for row in rows(PipelineSettings())}
    for name, key in texts.items():
        try:
            value = _value(name, re.sub(r'[(),]', ' ', metadata.get(key, '')))
        except ValueError:
            return {}
        if problem(by_name[name], value):
            return {}
        stored[name] = value
    return stored


def _regions(trays: Collection[int], stored: Mapping[str, Any]) -> list[int]:
    """The stored regions of these trays; none if one of them has none."""
    flat = stored[_REGIONS]
    by_tray = {tray: flat[4 * k : 4 * k + 4] for k, tray in enumerate(stored[_TRAYS])}
    if not set(trays) <= set(by_tray):
        return []
    return [value for tray in trays for value in by_tray[tray]]


def _contradictions(
    given: Mapping[str, Any], told: set[str], stored: Mapping[str, Any], place: str
) -> list[str]:
    """A line on what is told and what is stored, where they differ."""
    pairs: list[tuple[str, str, str]] = []
    for name in EXPERIMENT_SETTINGS:
        if name in told and name in stored:
            own, other = given[name], stored[name]
            if name == _TRAYS_FILE:
                differs = load_trays(own) != load_trays(other)
                texts = own or 'those of the flight', 'other trays'
            elif name == _CALIBRATION:
                differs = bool(own) and _as_text(name, own) != other
                texts = own, 'another'
            elif name == _TRAYS:
                # Some of the trays are a choice.
                differs = not set(own) <= set(other)
                texts = _as_text(name, own), _as_text(name, other)
            else:
                same_trays = list(given[_TRAYS]) == list(stored.get(_TRAYS, ()))
                comparable = name != _REGIONS or _TRAYS not in told or same_trays
                differs = comparable and _as_text(name, own) != _as_text(name, other)
                texts = _as_text(name, own), _as_text(name, other)
            if differs:
                pairs.append((name, *texts))
    if not pairs:
        return []
    own_text = ', '.join(f'{name} {own}' for name, own, _ in pairs)
    other_text = ', '.join(f'{name} {other}' for name, _, other in pairs)
    return [f'{place}: says {other_text}; {own_text} is given and used']


def _trays_text(trays: Collection[int]) -> str:
    numbers = ', '.join(str(tray) for tray in trays)
    return f'tray {numbers} is' if len(trays) == 1 else f'trays {numbers} are'
