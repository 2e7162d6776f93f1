"""Results of an analysis as tables and a results bag."""

from __future__ import annotations

import heapq
import itertools
import os
import re
import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.errors import RecordingError, UnwritableError
from nanorocks_ros.experiment.recorded_experiment import metadata_of_settings
from nanorocks_ros.outputs.atomic_files import check_new_folder
from nanorocks_ros.outputs.tables.table_files import PACKAGE, write_package, write_table
from nanorocks_ros.outputs.unfinished_files import (
    delete_unfinished_folders,
    exchange_folder,
    unfinished_folder,
)
from nanorocks_ros.recordings.bag.find_bags import RESULTS_MARK
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import float_array_message, time_message
from nanorocks_ros.settings import rows
from nanorocks_ros.studies.results.record_columns import columns_of, record_arrays
from nanorocks_ros.studies.results.results_provenance import (
    BAG_NAME,
    provenance_of,
    read_provenance,
)
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout, to_array
from nanorocks_ros.wire.products import MEASURED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import ArrayRecord
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.analysis.offline_analysis import Analysis

# Beside the tables in a batch.
SUMMARY, EVIDENCE, STATISTICS = 'bag.json', 'evidence.npz', 'statistics.json'

FORMATS = ('csv', 'parquet')
"""Forms of the tables of results; the first unless another is asked for."""

# Rows of a table that are put together in memory.
_PIECE = 1000
_NEVER_NS = np.iinfo(np.int64).max


def check_results_folder(folder: Path) -> Path:
    """Check, before hours of work, that a folder can take results.

    What a killed process left of it is deleted, and earlier results are put back in their place.

    Returns
    -------
    Path
        The folder nearest to it that there is, on the same disk.

    Raises
    ------
    RecordingError
        When it holds something else.
    """
    if folder.name in ('', '..'):
        raise RecordingError(
            str(folder), 'is named by its place alone', f'pass --output {folder.resolve()}'
        )
    try:
        check_new_folder(folder)
    except RecordingError as error:
        raise RecordingError(str(folder), error.what, 'pass a writable --output') from error
    with suppress(OSError):
        delete_unfinished_folders(folder.parent, folder.name)
    if folder.exists() and not (folder / RESULTS_MARK).is_file():
        raise RecordingError(
            str(folder), 'exists and holds no results of ours', 'pass another --output'
        )
    return next(parent for parent in folder.absolute().parents if parent.is_dir())


def trays_file_of(folder: Path) -> str:
    """Content of the trays file of some results; empty where the trays flew, or it is unknown."""
    provenance = read_provenance(folder)
    return provenance.trays_file if provenance is not None and provenance.own_trays else ''


def write_results(
    analysis: Analysis,
    folder: Path,
    source: Path,
    settings: PipelineSettings,
    form: str = FORMATS[0],
    more: Callable[[Path], None] | None = None,
) -> None:
    """Tables and a results bag in a folder of their own, complete or not at all.

    Earlier results in the same folder are replaced, once the new ones are complete; what else
    lies there stays.

    Parameters
    ----------
    analysis : Analysis
    folder : Path
    source : Path
        The bag that was analysed, for the provenance.
    settings : PipelineSettings
    form : str
        Of the tables, one of `FORMATS`.
    more : callable, optional
        Called with the folder when the rest is in it, to add to it.

    Raises
    ------
    ConfigurationError
        When pyarrow, which writes Parquet, is not installed.
    RecordingError
        When the folder cannot be written, or holds something else.
    """
    check_results_folder(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with unfinished_folder(folder) as part:
            fresh = part / 'fresh'
            fresh.mkdir()
            (fresh / RESULTS_MARK).touch()
            _write_tables(analysis, fresh, source, settings, form)
            carried = _bag_provenance(source, settings) | _truth(analysis)
            _write_bag(analysis, fresh / BAG_NAME, carried)
            if more is not None:
                more(fresh)
            if folder.exists():
                _keep_others(folder, fresh)
            exchange_folder(folder, fresh, part)
    except OSError as error:
        raise UnwritableError(
            str(folder), f'cannot be written: {error.strerror}', 'pass a writable --output'
        ) from error
    except RecordingError as error:
        # Not the hidden file that was written.
        raise UnwritableError(str(folder), error.what, error.do) from error


def _keep_others(folder: Path, fresh: Path) -> None:
    """Keep files that a user put beside earlier results: a figure, notes."""
    # Files of an earlier analysis, also of a batch, do not belong to the new results.
    table_names = '|'.join(product.name for product in MEASURED)
    tables = rf'tray_\d+_({table_names})\.({"|".join(FORMATS)})'
    names = map(re.escape, (RESULTS_MARK, BAG_NAME, PACKAGE, SUMMARY, EVIDENCE, STATISTICS))
    ours = re.compile('|'.join([tables, r'tray_\d+_statistics\.png', *names]))
    for path in folder.iterdir():
        if ours.fullmatch(path.name) or (fresh / path.name).exists():
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.copytree(path, fresh / path.name, symlinks=True, copy_function=_linked)
        else:
            _linked(path, fresh / path.name)


def _linked(source: str | Path, target: str | Path) -> None:
    """A second name of a file, or a copy of it where there can be none."""
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, target, follow_symlinks=False)


def _write_tables(
    analysis: Analysis, folder: Path, source: Path, settings: PipelineSettings, form: str
) -> None:
    """The tables of all trays, and what describes them."""
    provenance = provenance_of(
        settings, source=source.name, epoch_ns=analysis.epoch_ns, recorded=analysis.metadata
    ).as_json()
    tables = {}
    for number, results in analysis.trays.items():
        for product in MEASURED:
            if records := results.of(product.record):
                path = folder / f'tray_{number}_{product.name}.{form}'
                columns = tables[path.name] = columns_of(product.record)
                pieces = _pieces(product.record, records, analysis.epoch_ns)
                write_table(path, columns, pieces, provenance, described=False)
    write_package(folder, tables, provenance)


def _pieces(
    record_type: type[ArrayRecord], records: Sequence[ArrayRecord], epoch_ns: int
) -> Iterator[dict[str, NDArray[Any]]]:
    rest = iter(records)
    while piece := [*itertools.islice(rest, _PIECE)]:
        yield record_arrays(record_type, piece, epoch_ns)


def _bag_provenance(source: Path, settings: PipelineSettings) -> dict[str, str]:
    return {
        'nanorocks_ros': __version__,
        'source': source.name,
        **{row.name: str(row.default) for row in rows(settings)},
        **metadata_of_settings(settings),
    }


def truth_keys(tray: int) -> tuple[str, str]:
    """Keys of the true restitutions of a tray, of beads and of walls, in the results bag."""
    return f'truth.tray_{tray}.restitution', f'truth.tray_{tray}.wall_restitution'


def _truth(analysis: Analysis) -> dict[str, str]:
    """The true restitutions of simulated trays, which figures show beside those measured."""
    known: dict[str, str] = {}
    for number, results in analysis.trays.items():
        if results.truth:
            last = results.truth[-1]
            values = f'{last.restitution:g}', f'{last.wall_restitution:g}'
            known |= dict(zip(truth_keys(number), values, strict=True))
    return known


def _write_bag(analysis: Analysis, path: Path, provenance: dict[str, str]) -> None:
    epoch_topic = topics.EPOCH.absolute()
    table = {epoch_topic: offered_topic(topics.EPOCH)}
    streams: list[Iterator[tuple[str, ArrayRecord]]] = []
    for number, results in analysis.trays.items():
        for product in MEASURED:
            name = product.topic.absolute(number)
            table[name] = offered_topic(product.topic)
            streams.append(zip(itertools.repeat(name), _in_order(results.of(product.record))))
    with BagWriter(path, table, metadata=provenance) as bag:
        bag.write(epoch_topic, analysis.epoch_ns, time_message(analysis.epoch_ns))
        for name, record in heapq.merge(*streams, key=lambda item: item[1].stamp_ns):
            values = to_array(record, analysis.epoch_ns)
            labels = layout(type(record)).labels
            bag.write(name, record.stamp_ns, float_array_message(labels, values))


def _in_order(records: Sequence[ArrayRecord]) -> Iterator[ArrayRecord]:
    """The records sorted by stamp; only records ahead of earlier ones are held in memory."""
    stamps = np.fromiter((record.stamp_ns for record in records), np.int64, len(records))
    # The earliest of those that come later.
    to_come = np.minimum.accumulate(np.append(stamps, _NEVER_NS)[::-1])[::-1][1:]
    waiting: list[tuple[int, int, ArrayRecord]] = []
    for number, (record, earliest) in enumerate(zip(records, to_come, strict=True)):
        heapq.heappush(waiting, (record.stamp_ns, number, record))
        while waiting and waiting[0][0] <= earliest:
            yield heapq.heappop(waiting)[2]
