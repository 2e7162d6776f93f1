"""Restitutions by all cycles of all recordings together, as a DataFrame.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pandas as pd

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

if TYPE_CHECKING:
    from collections.abc import Mapping

    from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods, MeanRestitution
    from nanorocks_ros.settings import PipelineSettings


def combined_frame(
    evidence: Mapping[int, tuple[PipelineSettings, CycleLikelihoods]],
) -> pd.DataFrame:
    """A row for each tray, with errors and intervals of both restitutions.

    Parameters
    ----------
    evidence : mapping of int to PipelineSettings and CycleLikelihoods
        By tray: the settings by which its cycles were read, and what all of them say.
    """
    rows = []
    for tray, (settings, likelihoods) in sorted(evidence.items()):
        rows.append(_combined_row(tray, _mean_of(settings, tray, likelihoods)))
    frame = pd.DataFrame(rows, columns=list(_combined_row(0, None)))
    units = {name: '' if name == 'headline' else '1' for name in frame.columns}
    frame.attrs['units'] = units
    return frame


def _mean_of(
    settings: PipelineSettings, tray: int, evidence: CycleLikelihoods
) -> MeanRestitution | None:
    """The restitutions of all cycles; None where they were read by another method."""
    own = calibrated(replace(settings, trays=(tray,)))
    try:
        return RestitutionEstimator(own, trays_of(own)[tray]).mean_of(evidence)
    except FitError:
        return None


def _combined_row(tray: int, mean: MeanRestitution | None) -> dict[str, Any]:
    """Both restitutions with error and intervals; missing where they are not known."""
    row: dict[str, Any] = {'tray': tray, 'cycles': None if mean is None else mean.cycles}
    for name in ('restitution', 'wall_restitution'):
        value = None if mean is None else getattr(mean, name)
        row |= {
            name: getattr(value, 'value', None),
            f'{name}_error': getattr(value, 'error', None),
            f'{name}_lower': getattr(value, 'lower', None),
            f'{name}_upper': getattr(value, 'upper', None),
            f'{name}_lower_68': getattr(mean, f'{name}_lower_68', None),
            f'{name}_upper_68': getattr(mean, f'{name}_upper_68', None),
        }
    return {
        **row,
        'rebounds': None if mean is None else mean.rebounds,
        'collisions': None if mean is None else mean.collisions,
        'headline': None if mean is None else mean.headline.name.lower(),
    }
