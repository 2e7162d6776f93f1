"""What results carry: their trays, scale, settings and versions; written once, read by all.

Figures, reports and Python take them from here, so that nothing is drawn for another tray than
the one that was analysed.

Tested by ``test/studies/results/test_results_provenance.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.recorded_experiment import (
    EXPERIMENT_SETTINGS,
    experiment_key,
    metadata_of_settings,
)
from nanorocks_ros.experiment.trays import load_trays, trays_text
from nanorocks_ros.outputs.json_values import json_values, read_object
from nanorocks_ros.outputs.tables.table_files import PACKAGE
from nanorocks_ros.recordings.bag.bag_folder import read_metadata
from nanorocks_ros.settings import PipelineSettings, rows, with_values
from nanorocks_ros.studies.results.run_provenance import run_provenance

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from nanorocks_ros.experiment.trays import Tray

BAG_NAME = 'results_bag'
"""The recording in a folder of results."""

_TRAYS_FILE, _CALIBRATION = 'trays_file', 'preprocess.calibration'
_SCALE = 'preprocess.pixels_per_metre'
_DAMAGED = 'analyse the recording again'


class Scale(NamedTuple):
    """The scale of the pictures.

    Attributes
    ----------
    pixels_per_metre : float, [px/m]
    source : str
        Where it was from: ``calibration``, ``trays file``, ``recording``, ``settings`` (told) or
        ``default``.
    """

    pixels_per_metre: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultsProvenance:
    """What results follow from.

    Parameters
    ----------
    trays_file : str
        Content of the trays file, that of the flight where none was told.
    own_trays : bool
        Whether it was told, or recorded, and is not that of the flight.
    scale : Scale
    settings : PipelineSettings
        Complete: files are in them with their content.
    source : str
        Name of the recording.
    epoch_ns : int, [ns]
        What times count from.
    run : dict
        Command, date and versions, as of `run_provenance`.
    """

    trays_file: str
    own_trays: bool
    scale: Scale
    settings: PipelineSettings
    source: str = ''
    epoch_ns: int = 0
    run: dict[str, Any] = field(default_factory=dict)

    @property
    def trays(self) -> dict[int, Tray]:
        """The trays that were analysed, by number."""
        trays = load_trays(self.trays_file)
        return {number: trays[number] for number in self.settings.trays if number in trays}

    @property
    def versions(self) -> dict[str, str]:
        """Version of each library."""
        versions: dict[str, str] = self.run.get('versions', {})
        return versions

    def as_json(self) -> dict[str, Any]:
        """Values for JSON, of which `read_provenance` makes the same again."""
        settings = {row.name: row.default for row in rows(self.settings)}
        del settings[_TRAYS_FILE]
        plain: dict[str, Any] = json_values(
            {
                'source': self.source,
                **self.run,
                'epoch_ns': self.epoch_ns,
                'scale': self.scale._asdict(),
                'own_trays': self.own_trays,
                _TRAYS_FILE: self.trays_file,
                'settings': settings,
            }
        )
        return plain


def provenance_of(
    settings: PipelineSettings,
    *,
    source: str,
    epoch_ns: int,
    recorded: Mapping[str, str],
) -> ResultsProvenance:
    """The provenance of results that are made now.

    Parameters
    ----------
    settings : PipelineSettings
        Those that were used, completed by the recording.
    source : str
        Name of the recording.
    epoch_ns : int, [ns]
    recorded : mapping of str to str
        What the recording says of itself.

    Raises
    ------
    ConfigurationError
        When a file of the settings cannot be read.
    """
    contents = metadata_of_settings(settings)
    files = {name: contents.get(experiment_key(name), '') for name in (_TRAYS_FILE, _CALIBRATION)}
    told = with_values(settings, files, 'results')
    return ResultsProvenance(
        trays_file=trays_text(told.trays_file),
        own_trays=bool(told.trays_file),
        scale=_scale_of(told, recorded),
        settings=told,
        source=source,
        epoch_ns=epoch_ns,
        run=run_provenance(),
    )


def _scale_of(settings: PipelineSettings, recorded: Mapping[str, str]) -> Scale:
    used = calibrated(settings).preprocess.pixels_per_metre
    section = film_section(settings.trays_file)
    source = 'settings'
    if settings.preprocess.calibration:
        source = 'calibration'
    elif section is not None and section.pixels_per_metre == used:
        source = 'trays file'
    elif recorded.get(experiment_key(_SCALE)) == f'{used}':
        source = 'recording'
    elif used == PipelineSettings().preprocess.pixels_per_metre:
        source = 'default'
    return Scale(used, source)


def read_provenance(folder: Path) -> ResultsProvenance | None:
    """What the results in a folder follow from.

    Parameters
    ----------
    folder : Path
        Results of `nanorocks analyse`, or of a recording in a batch, also of earlier versions.

    Returns
    -------
    ResultsProvenance or None
        None where nothing is told: tables of somebody else.

    Raises
    ------
    RecordingError
        When the description of the results is damaged.
    """
    path = folder / PACKAGE
    if not path.is_file():
        return _of_earlier_version(folder)
    try:
        values = read_object(path).get('provenance', {})
        if _TRAYS_FILE not in values:
            return _of_earlier_version(folder)
        return _from_json(values)
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RecordingError(str(path), 'is no description of results', _DAMAGED) from error
    except ConfigurationError as error:
        raise RecordingError(str(path), f'cannot be used ({error})', _DAMAGED) from error


def _from_json(values: Mapping[str, Any]) -> ResultsProvenance:
    own = bool(values['own_trays'])
    trays_file = str(values[_TRAYS_FILE])
    names = {row.name for row in rows(PipelineSettings())}
    # A setting of another version says nothing here.
    told = {name: value for name, value in values['settings'].items() if name in names}
    if own:
        told[_TRAYS_FILE] = trays_file
    scale = values['scale']
    return ResultsProvenance(
        trays_file=trays_file,
        own_trays=own,
        scale=Scale(float(scale['pixels_per_metre']), str(scale['source'])),
        settings=with_values(PipelineSettings(), told, PACKAGE),
        source=str(values['source']),
        epoch_ns=int(values['epoch_ns']),
        run={name: values[name] for name in ('created', 'command', 'versions')},
    )


def _of_earlier_version(folder: Path) -> ResultsProvenance | None:
    """What the recording among the results says: trays, and settings that place the picture."""
    try:
        metadata = read_metadata(folder / BAG_NAME)
    except RecordingError:
        return None
    settings = _settings_of(metadata)
    return ResultsProvenance(
        trays_file=trays_text(settings.trays_file),
        own_trays=bool(settings.trays_file),
        scale=_scale_of(settings, {}),
        settings=settings,
        source=metadata.get('source', ''),
        run={
            'created': '',
            'command': '',
            'versions': {name: metadata[name] for name in ('nanorocks_ros',) if name in metadata},
        },
    )


def _settings_of(metadata: Mapping[str, str]) -> PipelineSettings:
    told: dict[str, Any] = {}
    for name in EXPERIMENT_SETTINGS:
        text = metadata.get(experiment_key(name))
        if text is None:
            continue
        if name in (_TRAYS_FILE, _CALIBRATION):
            # A text with a line break is content, not a path.
            told[name] = text if '\n' in text else f'{text}\n'
        elif name in ('trays', 'preprocess.regions_px'):
            told[name] = [int(word) for word in text.split()]
        else:
            told[name] = float(text) if name == _SCALE else text
    return with_values(PipelineSettings(), told, BAG_NAME)


def trays_of_results(folder: Path, told: str = '') -> dict[int, Tray]:
    """The trays of some results, which no other may replace.

    Parameters
    ----------
    folder : Path
        Results, or any folder with tables.
    told : str
        A trays file that the user names, if any.

    Returns
    -------
    dict of int to Tray
        Those of the results; of tables that carry none those of `told`, or of the flight.

    Raises
    ------
    ConfigurationError
        When `told` describes a tray otherwise than the results; names both.
    RecordingError
        When the description of the results is damaged.
    """
    provenance = read_provenance(folder)
    if provenance is None:
        return load_trays(told)
    if told:
        own, other = provenance.trays, load_trays(told)
        differ = [number for number, tray in own.items() if other.get(number) != tray]
        if differ:
            numbers = ', '.join(str(number) for number in differ)
            carried = (
                'a trays file of their own' if provenance.own_trays else 'those of the flight'
            )
            raise ConfigurationError(
                str(told),
                f'describes tray {numbers} otherwise than {folder}, which carries {carried}',
                'leave it out, or analyse the recording again with it',
            )
    return provenance.trays
