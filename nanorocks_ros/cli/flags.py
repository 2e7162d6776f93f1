"""Settings as command-line flags and parameter files."""

from __future__ import annotations

import argparse
import logging
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import yaml

from nanorocks_ros.cli.imported_films import accept_films
from nanorocks_ros.cli.parsing.command_parser import offer
from nanorocks_ros.cli.parsing.tray_options import add_tray_or_file, not_a_number
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.yaml_limits import load_yaml
from nanorocks_ros.experiment.yaml_lines import read_text
from nanorocks_ros.settings import (
    PipelineSettings,
    SettingRow,
    rows,
    with_current_names,
    with_values,
)

if TYPE_CHECKING:
    from nanorocks_ros.cli.parsing.command_parser import CommandParser
    from nanorocks_ros.experiment.recorded_experiment import RecordedSettings

SettingsType = TypeVar('SettingsType')
_LOGGER = logging.getLogger(__name__)
_SWITCH = 'on', 'off'
_EMPTY = 'empty'
SHORT_FLAGS = {
    f'preprocess.{name}': f'--{name.replace("_", "-")}'
    for name in ('layout', 'pixels_per_metre', 'regions_px')
}
"""Shorter flags of settings that describe a film; those by their names do as well."""


def add_flags(
    parser: CommandParser, settings: Any, skip: set[str], title: str = 'settings'
) -> None:
    """Add a flag for each setting, in a group for each stage.

    ``speed.method`` becomes ``--speed-method``. The short help shows the everyday settings.
    """
    stages: dict[str, Any] = {}
    for row in rows(settings):
        if row.name in skip:
            continue
        stage = row.name.rpartition('.')[0]
        if stage not in stages:
            stages[stage] = parser.add_argument_group(_stage_title(settings, stage) or title)
        action = add_flag(stages[stage], row, _default_text(row))
        if not row.everyday:
            parser.leave_out(action)
        if row.deprecated:
            stages[stage].add_argument(
                flag_of(row.deprecated),
                dest=row.deprecated,
                nargs=action.nargs,
                help=argparse.SUPPRESS,
            )


def add_flag(group: Any, row: SettingRow, default: str) -> argparse.Action:
    """Add the flag of one setting."""
    unit = f' [{row.unit}]' if row.unit else ''
    # What an empty value means stands in the text already.
    told = '' if default == _EMPTY and f'{_EMPTY}: ' in row.doc else f'; default {default}'
    action: argparse.Action = group.add_argument(
        *([SHORT_FLAGS[row.name]] if row.name in SHORT_FLAGS else []),
        flag_of(row.name),
        dest=row.name,
        metavar=_placeholder(row),
        nargs='*' if isinstance(row.default, tuple) else None,
        help=f'{row.doc}{unit}{told}'.replace('%', '%%'),
    )
    words = row.bounds.choices or (_SWITCH if isinstance(row.default, bool) else ())
    # Texts without choices are files.
    if words or not isinstance(row.default, str):
        offer(action, words)
    return action


def _stage_title(settings: Any, stage: str) -> str:
    """What a group of settings is about; empty for settings of no group."""
    if not stage:
        return ''
    text = (type(attrgetter(stage)(settings)).__doc__ or '').partition('.')[0]
    return f'{stage}: {text[:1].lower()}{text[1:]}'


def _placeholder(row: SettingRow) -> str:
    """What stands for the value of a setting: M, S, PX, on|off, {auto,tracking}."""
    if row.placeholder:
        return row.placeholder
    if row.bounds.choices:
        return f'{{{",".join(row.bounds.choices)}}}'
    if isinstance(row.default, bool):
        return '|'.join(_SWITCH)
    if row.unit:
        return row.unit.upper()
    is_whole = isinstance(row.default, int) or row.bounds.whole
    return 'TEXT' if isinstance(row.default, str) else 'N' if is_whole else 'NUMBER'


def add_bag(parser: CommandParser, skip: set[str] | None = None, *, many: bool = False) -> None:
    """Add the arguments of commands that process a bag, with a flag for each setting."""
    kind = 'rosbag2 folder, .mcap file, video or folder of images'
    if many:
        parser.add_argument(
            'bags', nargs='+', metavar='BAG', help=f"{kind}; many, a folder of them, or 'bags/*'"
        )
    else:
        parser.add_argument('bag', metavar='BAG', help=kind)
    accept_films(parser, 'bags' if many else 'bag')
    parser.add_argument('--json', action='store_true', help='print one JSON object, SI units')
    parser.add_argument(
        '--image-topic',
        default='',
        metavar='TOPIC',
        help='camera topic; default: that of our nodes',
    )
    parser.add_argument(
        '--parameters', metavar='YAML', help='ROS parameter file, as for the nodes'
    )
    parser.leave_out('--image-topic', '--parameters')
    add_tray_or_file(parser)
    add_flags(parser, PipelineSettings(), skip=skip or set())


def flag_of(name: str) -> str:
    """The flag of a setting."""
    return '--' + name.replace('.', '-').replace('_', '-')


def _default_text(row: SettingRow) -> str:
    if isinstance(row.default, tuple):
        return ' '.join(str(value) for value in row.default) or _EMPTY
    if isinstance(row.default, bool):
        return _SWITCH[0] if row.default else _SWITCH[1]
    return str(row.default) if row.default != '' else _EMPTY


def settings_from(
    options: argparse.Namespace, settings: SettingsType, parameters: str | None = None
) -> SettingsType:
    """The settings with the values of a parameter file and of flags; flags take precedence.

    Raises
    ------
    ConfigurationError
        For an unreadable file, an unknown name or an invalid value.
    """
    if parameters:
        settings = _replaced(settings, _from_file(Path(parameters)), parameters)
    return _replaced(settings, _given(options, settings), 'command line')


def told_settings(options: argparse.Namespace, parameters: str | None = None) -> frozenset[str]:
    """Names of the settings of the pipeline that the user told, by a flag or in the file."""
    settings = PipelineSettings()
    values = _from_file(Path(parameters)) if parameters else {}
    names, _ = with_current_names(settings, {**values, **_given(options, settings)}, '')
    return frozenset(names)


def bag_settings(options: argparse.Namespace, bag: str | Path) -> RecordedSettings:
    """Settings of the pipeline for a bag: what is told, else what the bag says, else defaults.

    Raises
    ------
    ConfigurationError
        As `settings_from`.
    RecordingError
        When the bag cannot be read, or what it says of itself cannot be used.
    """
    from nanorocks_ros.experiment.recorded_experiment import recorded_settings
    from nanorocks_ros.experiment.unknown_diameters import unknown_diameters
    from nanorocks_ros.recordings.bag.bag_folder import read_metadata

    settings = settings_from(options, PipelineSettings(), options.parameters)
    told = told_settings(options, options.parameters)
    notices: tuple[str, ...] = ()
    if unknown_diameters(settings.trays_file):
        from nanorocks_ros.studies.measure.found_diameters import with_found_diameters

        settings, notices = with_found_diameters(settings, told, Path(bag), options.image_topic)
    recorded = recorded_settings(settings, told, read_metadata(bag), str(bag))
    return recorded._replace(notices=(*notices, *recorded.notices))


def _given(options: argparse.Namespace, settings: Any) -> dict[str, Any]:
    """Values of the flags that were given."""
    return {
        name: _parsed(row, getattr(options, name))
        for row in rows(settings)
        for name in (row.name, row.deprecated)
        if getattr(options, name, None) is not None
    }


def _replaced(settings: SettingsType, values: dict[str, Any], where: str) -> SettingsType:
    values, messages = with_current_names(settings, values, where)
    for message in messages:
        _LOGGER.warning(message)
    return with_values(settings, values, where)


def _parsed(row: SettingRow, text: Any) -> Any:
    if isinstance(row.default, str):
        return text
    try:
        if isinstance(row.default, bool):
            return yaml.safe_load(text)
        numbers = [_number(word) for word in _words(text)]
        return numbers if isinstance(row.default, tuple) else numbers[0]
    except (yaml.YAMLError, ValueError) as error:
        where, shown = flag_of(row.name), ' '.join(_words(text))
        if row.name in ('tray', 'trays'):
            raise ConfigurationError(where, *not_a_number(shown)) from error
        raise ConfigurationError(where, f'{shown!r} cannot be read', 'give a number') from error


def _number(text: str) -> int | float:
    if text.lstrip('+-').isdigit():
        return int(text)
    # YAML writes .nan
    return float(text.removeprefix('.') if text.endswith('nan') else text)


def _words(text: str | list[str]) -> list[str]:
    """The words of one value, or of a list, which commas may separate as well."""
    if isinstance(text, str):
        return [text]
    return [part for word in text for part in word.split(',') if part]


def _from_file(path: Path) -> dict[str, Any]:
    """Values of a ROS parameter file: every ``ros__parameters`` block, nested or dotted."""
    content = load_yaml(str(path), read_text(path, 'a ROS parameter file'))
    values: dict[str, Any] = {}
    for node in content.values() if isinstance(content, dict) else ():
        if isinstance(node, dict) and isinstance(node.get('ros__parameters'), dict):
            values.update(_flattened(node['ros__parameters']))
    if not values:
        raise ConfigurationError(
            str(path), 'holds no ros__parameters', 'use the form of config/parameters.yaml'
        )
    return values


def _flattened(block: dict[str, Any], prefix: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in block.items():
        if isinstance(value, dict):
            flat.update(_flattened(value, f'{prefix}{name}.'))
        else:
            flat[f'{prefix}{name}'] = value
    return flat
