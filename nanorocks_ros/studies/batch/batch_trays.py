"""The trays of a batch: each recording by what it says, and the same beads in all of them.

Tested by ``test/cli/test_bag_settings.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.pipeline.composition import trays_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.batch.batch_analysis import BagResults


def settings_by_tray(
    results: Sequence[BagResults], settings: PipelineSettings
) -> dict[int, PipelineSettings]:
    """Of each tray, the settings by which its first recording was analysed."""
    if not results:
        return dict.fromkeys(settings.trays, settings)
    by_tray: dict[int, PipelineSettings] = {}
    for result in results:
        own_settings = _settings_of(result, settings)
        for number in own_settings.trays:
            by_tray.setdefault(number, own_settings)
    return by_tray


def _settings_of(result: BagResults, settings: PipelineSettings) -> PipelineSettings:
    experiment = result.summary.get('experiment', {})
    return recorded_settings(settings, (), experiment, result.name).settings


def of_these_trays(
    result: BagResults,
    settings: PipelineSettings,
    of_results: Mapping[int, PipelineSettings],
    notices: list[str],
) -> BagResults:
    """The results without trays that hold other beads than in the recordings before."""
    kept = dict(result.summary['trays'])
    for number, tray in trays_of(_settings_of(result, settings)).items():
        if trays_of(of_results[number])[number] != tray:
            kept.pop(str(number), None)
            notices.append(
                f'{result.name}: its tray {number} holds other beads or has other sides than in '
                'the recordings before, and is left out of the means; analyse it by itself'
            )
    return replace(result, summary={**result.summary, 'trays': kept})
