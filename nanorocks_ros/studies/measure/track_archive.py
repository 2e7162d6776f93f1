"""Tracks of a recording in a file, so that a second run need not track again."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.outputs.npz_archive import read_archive, write_archive
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.recordings.bag.fingerprint import file_states
from nanorocks_ros.records import BEAD_FIELDS, Quality, Tracks
from nanorocks_ros.records.result_words import FlagWords
from nanorocks_ros.settings import rows
from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
from nanorocks_ros.studies.analysis.recognition_verdicts import Verdict, verdict_as_json

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.settings import PipelineSettings

_OF_FRAMES = 'stamp_ns', 'displacement', 'quality', 'cycle'
_KEY = 'made_by'


def tracking_key(bag: Path, settings: PipelineSettings, image_topic: str) -> str:
    """What tracks follow from: the recording, the settings, the version."""
    parts = [
        __version__,
        image_topic,
        json.dumps(file_states(bag)),
        *(f'{row.name}={row.default}' for row in rows(settings)),
    ]
    return hashlib.blake2b('\n'.join(parts).encode(), digest_size=16).hexdigest()


def save_tracks(path: Path, tracked: TrackedBag, key: str) -> None:
    """Write the tracks of all trays.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    arrays: dict[str, NDArray[Any]] = {
        _KEY: np.array(key),
        'frames': np.array(tracked.frames),
        'epoch_ns': np.array(tracked.epoch_ns),
        'notices': np.array(tracked.notices, dtype=np.str_),
        'verdicts': np.array(
            json.dumps(
                [verdict_as_json(row) for told in tracked.verdicts.values() for row in told]
            )
        ),
    }
    for number, records in tracked.tracks.items():
        prefix = f'tray_{number}.'
        arrays[f'{prefix}region'] = np.array(tracked.regions[number])
        arrays[f'{prefix}numbers'] = np.array(tracked.numbers[number], dtype=np.int64)
        arrays[f'{prefix}counts'] = np.array([record.ids.size for record in records])
        for name in _OF_FRAMES:
            column = [np.asarray(getattr(record, name)) for record in records]
            arrays[f'{prefix}{name}'] = np.array(column)
        for name in BEAD_FIELDS:
            arrays[f'{prefix}{name}'] = np.concatenate(
                [getattr(record, name) for record in records]
            )
    write_archive(path, arrays)


def saved_tracks(path: Path, settings: PipelineSettings, key: str) -> TrackedBag | None:
    """The tracks of a file; None unless it was made with this key.

    Pictures are not among them.
    """
    try:
        arrays = read_archive(path)
        if str(arrays[_KEY]) != key:
            return None
        trays = trays_of(settings)
        return TrackedBag(
            epoch_ns=int(arrays['epoch_ns']),
            pixels_per_metre=settings.preprocess.pixels_per_metre,
            trays=trays,
            tracks={
                number: _tracks(arrays, number, [species.count for species in tray.species])
                for number, tray in trays.items()
            },
            numbers={number: arrays[f'tray_{number}.numbers'].tolist() for number in trays},
            frames=int(arrays['frames']),
            notices=arrays['notices'].tolist(),
            regions={
                number: Region(*arrays[f'tray_{number}.region'].tolist()) for number in trays
            },
            film=film_section(settings.trays_file),
            verdicts=_verdicts(str(arrays['verdicts']), list(trays)),
        )
    except (RecordingError, LookupError, ValueError, TypeError, AttributeError, RecursionError):
        # A file that is missing, damaged, or of another version is made again.
        return None


def _verdicts(text: str, trays: list[int]) -> dict[int, tuple[Verdict, ...]]:
    """Verdicts by tray, as `verdict_as_json` tells them."""
    told = [
        Verdict(**{**values, 'flags': tuple(FlagWords(**flag) for flag in values['flags'])})
        for values in json.loads(text)
    ]
    return {number: tuple(row for row in told if row.tray == number) for number in trays}


def _tracks(arrays: dict[str, NDArray[Any]], number: int, counts: list[int]) -> list[Tracks]:
    prefix = f'tray_{number}.'
    ends = np.cumsum(arrays[f'{prefix}counts'])
    expected = np.array(counts, dtype=np.int32)
    pieces = {name: np.split(arrays[f'{prefix}{name}'], ends[:-1]) for name in BEAD_FIELDS}
    frames = {name: arrays[f'{prefix}{name}'] for name in _OF_FRAMES}
    return [
        Tracks(
            stamp_ns=int(frames['stamp_ns'][k]),
            tray=number,
            displacement=frames['displacement'][k],
            quality=Quality(int(frames['quality'][k])),
            cycle=int(frames['cycle'][k]),
            expected=expected,
            **{name: columns[k] for name, columns in pieces.items()},
        )
        for k in range(len(ends))
    ]
