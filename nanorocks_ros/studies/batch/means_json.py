"""Means over all cycles of a tray as a JSON object: None for what is not known.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.json_values import finite_or_none
from nanorocks_ros.records import (
    UNKNOWN_INTERVAL,
    UNKNOWN_MEASURED_INTERVAL,
    MeasuredInterval,
)

if TYPE_CHECKING:
    from nanorocks_ros.inference.cycle_likelihoods import MeanRestitution
    from nanorocks_ros.studies.batch.campaign_means import TrayMeans


# Less known than this nothing is: anything from 0 to 1 has a deviation of 0.29.
_LEAST_KNOWN = 0.2


def means_as_json(tray: TrayMeans) -> dict[str, Any]:
    """Results of all cycles of a tray, in SI; None where not known.

    A restitution that is hardly known has an interval, but no value.
    """
    fields_of_tray: dict[str, Any] = {'recordings': tray.recordings, 'cycles': tray.cycles}
    mean = tray.restitution
    restitution = mean.restitution if mean else UNKNOWN_MEASURED_INTERVAL
    if not restitution.error <= _LEAST_KNOWN:
        restitution = replace(restitution, value=math.nan, error=math.nan)
    wall_restitution = mean.wall_restitution if mean else UNKNOWN_MEASURED_INTERVAL
    fields_of_tray |= {
        **_interval_as_json('restitution', restitution),
        **_narrow_as_json('restitution', mean),
        **_interval_as_json('wall_restitution', wall_restitution),
        **_narrow_as_json('wall_restitution', mean),
        'cycles_read': mean.cycles if mean else 0,
        'decays_left_out': tray.left_out,
        'headline': mean.headline.name.lower() if mean else None,
        'wall_friction': finite_or_none(mean.wall_friction.value) if mean else None,
        'wall_friction_error': finite_or_none(mean.wall_friction.error) if mean else None,
        'friction_unknown': mean.friction_unknown if mean else None,
        'speed_dependent': mean.speed_dependent if mean else None,
        **_exponents_as_json(mean),
        'tension': finite_or_none(mean.tension) if mean else None,
        'rebounds': mean.rebounds if mean else 0,
        'collisions': mean.collisions if mean else 0,
    }
    sticking = tray.sticking
    fields_of_tray |= {
        'sticking_status': sticking.status.name.lower() if sticking else None,
        'sticking_speed': finite_or_none(sticking.sticking_speed) if sticking else None,
        'sticking_speed_lower': finite_or_none(sticking.lower) if sticking else None,
        'sticking_speed_upper': finite_or_none(sticking.upper) if sticking else None,
        'sticking_speed_lower_68': finite_or_none(sticking.lower_68) if sticking else None,
        'sticking_speed_upper_68': finite_or_none(sticking.upper_68) if sticking else None,
        'merges': sticking.merges if sticking else None,
    }
    for name, value in tray.means.items():
        fields_of_tray |= {
            f'mean_{name}': finite_or_none(value.mean),
            f'mean_{name}_error': finite_or_none(value.error),
            f'{name}_scatter': finite_or_none(value.scatter),
            f'{name}_cycles': value.cycles,
        }
    return fields_of_tray


def _exponents_as_json(mean: MeanRestitution | None) -> dict[str, float | None]:
    """How the restitutions depend on the impact speed."""
    values: dict[str, float | None] = {}
    for prefix in ('', 'wall_'):
        speed = getattr(mean, f'{prefix}impact_speed') if mean else math.nan
        values[f'{prefix}impact_speed'] = finite_or_none(speed)
        for name in (f'{prefix}restitution_exponent', f'{prefix}impact_restitution'):
            interval = getattr(mean, name) if mean else UNKNOWN_INTERVAL
            values |= {
                name: finite_or_none(interval.value),
                f'{name}_lower': finite_or_none(interval.lower),
                f'{name}_upper': finite_or_none(interval.upper),
            }
        values |= _narrow_as_json(f'{prefix}restitution_exponent', mean)
    return values


def _narrow_as_json(name: str, mean: MeanRestitution | None) -> dict[str, float | None]:
    """Ends of the interval of 68 %."""
    names = f'{name}_lower_68', f'{name}_upper_68'
    return {end: finite_or_none(getattr(mean, end)) if mean else None for end in names}


def _interval_as_json(name: str, quantity: MeasuredInterval) -> dict[str, float | None]:
    return {
        name: finite_or_none(float(quantity.value)),
        f'{name}_error': finite_or_none(float(quantity.error)),
        f'{name}_lower': finite_or_none(float(quantity.lower)),
        f'{name}_upper': finite_or_none(float(quantity.upper)),
    }
