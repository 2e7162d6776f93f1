"""What differs between recordings whose cycles stand in one mean, in words.

Tested by ``test/studies/batch/test_mixed_recordings.py``.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from nanorocks_ros.experiment.recorded_experiment import EXPERIMENT_SETTINGS, experiment_key
from nanorocks_ros.outputs.safe_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.studies.batch.batch_analysis import BagResults

# Longer values, such as the content of a file, are not printed.
_LONGEST = 40
# Recordings of different trays do not meet in a mean.
_TRAYS = 'trays'


def mixed_recordings(results: Sequence[BagResults]) -> list[str]:
    """A sentence for each tray whose truths differ, and for each setting that differs.

    Parameters
    ----------
    results : sequence of BagResults
        Of the recordings that count in the means.

    Returns
    -------
    list of str
        Empty where all recordings are of one kind.
    """
    return [*_mixed_truths(results), *_mixed_settings(results)]


def _mixed_truths(results: Sequence[BagResults]) -> list[str]:
    trays = sorted({number for result in results for number in result.summary['trays']}, key=int)
    lines = []
    for number in trays:
        truths = Counter(
            _truth_text(result.summary['trays'][number].get('truth'))
            for result in results
            if number in result.summary['trays']
        )
        if len(truths) > 1:
            lines.append(
                f'Mixed in the means of tray {number}: recordings with different true '
                f'restitutions, {_counts(truths)}.'
            )
    return lines


def _truth_text(truth: dict[str, Any] | None) -> str:
    if truth is None:
        return 'not known'
    return f'{truth["restitution"]:g} (walls {truth["wall_restitution"]:g})'


def _mixed_settings(results: Sequence[BagResults]) -> list[str]:
    lines = []
    for name in (each for each in EXPERIMENT_SETTINGS if each != _TRAYS):
        key = experiment_key(name)
        values = Counter(
            str(result.summary['metadata'].get(key, 'not stated')) for result in results
        )
        if len(values) < 2:
            continue
        short = all(len(value) <= _LONGEST for value in values)
        kinds = _counts(values) if short else f'{len(values)} different ones'
        lines.append(f'Mixed in one mean: recordings with different {name}, {kinds}.')
    return lines


def _counts(values: Counter[str]) -> str:
    parts = (f'{value} in {counted(count, "recording")}' for value, count in values.items())
    return ', '.join(parts)
