"""Results of an analysis, read back from their folder as they were in memory.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods
from nanorocks_ros.outputs.npz_archive import read_archive
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults
from nanorocks_ros.studies.analysis.results.results_folder import EVIDENCE
from nanorocks_ros.studies.results.results_provenance import BAG_NAME, read_provenance
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array
from nanorocks_ros.wire.products import MEASURED

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from nanorocks_ros.records import ArrayRecord
    from nanorocks_ros.settings import PipelineSettings


class ReadAnalysis(NamedTuple):
    """An analysis that was read.

    Parameters
    ----------
    source : str
        Name of the recording.
    analysis : Analysis
        Without the stamps of frames and what is only known during the analysis. There is evidence
        of the cycles where a batch has kept it.
    settings : PipelineSettings
    run : dict
        Command, date and versions of the analysis, as of `run_provenance`.
    """

    source: str
    analysis: Analysis
    settings: PipelineSettings
    run: dict[str, Any]


def read_analysis(folder: Path) -> ReadAnalysis:
    """Read a folder of results of `nanorocks analyse`, or one of those of a batch.

    Raises
    ------
    RecordingError
        When it cannot be read.
    FrameError
        When a record in it is of another version.
    """
    path = folder / BAG_NAME
    provenance = read_provenance(folder)
    if provenance is None:
        raise RecordingError(str(folder), 'holds no results', 'name a folder of results')
    settings = provenance.settings
    bag = open_bag(path)
    epoch_topic = topics.EPOCH.absolute()
    # Results of earlier versions tell it in the recording alone.
    epoch_ns = next(
        (message.log_time_ns for message in bag.messages([epoch_topic])), provenance.epoch_ns
    )
    trays = {number: TrayResults() for number in settings.trays}
    kinds = {
        product.topic.absolute(number): (product.record, number)
        for product in MEASURED
        for number in trays
    }
    known = [name for name in bag.topics if name in kinds]
    for message in bag.messages(known) if known else ():
        kind, number = kinds[message.topic]
        values = bag.deserialize(message).data
        where = f'{path}: {message.topic}'
        record: ArrayRecord = from_array(kind, values, tray=number, epoch_ns=epoch_ns, where=where)
        # In the array the time has single precision.
        trays[number].add(replace(record, stamp_ns=message.log_time_ns))
    for number, evidence in _evidence(folder, trays).items():
        trays[number].evidence = evidence
    analysis = Analysis(
        epoch_ns=epoch_ns,
        trays=trays,
        notices=list(bag.notices),
        metadata=dict(bag.metadata),
        include_inconsistent=settings.cooling.include_inconsistent,
        prior=settings.prior,
    )
    return ReadAnalysis(provenance.source or folder.name, analysis, settings, provenance.run)


def _evidence(folder: Path, trays: Mapping[int, object]) -> dict[int, CycleLikelihoods]:
    """What the cycles of each tray say together, where a batch has written it."""
    path = folder / EVIDENCE
    if not path.is_file():
        return {}
    arrays = read_archive(path)
    evidence: dict[int, CycleLikelihoods] = {}
    for number in trays:
        prefix = f'{number}/cor/'
        own = {
            name.removeprefix(prefix): values
            for name, values in arrays.items()
            if name.startswith(prefix)
        }
        if own:
            try:
                evidence[number] = CycleLikelihoods.from_arrays(own, str(path))
            except FitError as error:
                raise RecordingError(error.where, error.what, error.do) from error
    return evidence
