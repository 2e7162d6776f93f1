"""Fields of the restitution of a cycle that decay and contacts determine, each and together.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.inference.restitution_sources import RestitutionSources, intervals_of
from nanorocks_ros.records import ONE_SIGMA

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.restitution.cycle_restitution import CycleRestitution

# Largest standard deviation of a restitution that is given: a uniform one from 0 to 1 has 0.29.
_LARGEST_DEVIATION = 0.2


def ends_of(probability: float) -> NDArray[np.float64]:
    """Probabilities of lower end, value and upper end of an interval."""
    return np.array([0.5 - 0.5 * probability, 0.5, 0.5 + 0.5 * probability])


NARROW = ends_of(ONE_SIGMA)
"""Probabilities of lower end, value and upper end of an interval of 68 %."""


def determined(
    result: CycleRestitution, sources: RestitutionSources, ends: NDArray[np.float64]
) -> CycleRestitution:
    """The result with the restitutions that the source of the headline determines."""
    restitution, wall_restitution = sources.intervals(ends)
    narrow, narrow_walls = sources.intervals(NARROW)
    walls: dict[str, Any] = {
        'wall_restitution': wall_restitution,
        'wall_restitution_lower_68': narrow_walls.lower,
        'wall_restitution_upper_68': narrow_walls.upper,
    }
    if sources.means[0].error <= _LARGEST_DEVIATION:
        return replace(
            result,
            determined=True,
            restitution=restitution,
            restitution_lower_68=narrow.lower,
            restitution_upper_68=narrow.upper,
            correlation=sources.correlation,
            **walls,
        )
    if result.rebounds:
        # Rebounds determine the walls even where nothing is known of the beads.
        return replace(result, **walls)
    return result


def by_source(
    sources: RestitutionSources, ends: NDArray[np.float64], *, has_decay: bool
) -> dict[str, Any]:
    """The fields of a `CycleRestitution` that say what each source makes of the cycle."""
    contacts, contact_walls = sources.contact_intervals(ends)
    fields = {
        'headline': sources.headline,
        'contact_restitution': contacts,
        'contact_wall_restitution': contact_walls,
        'wall_friction': sources.wall_friction,
    }
    if not has_decay:
        return fields
    joint, joint_walls = intervals_of(sources.joint, ends)
    decay, decay_walls = intervals_of(sources.decay, ends)
    return {
        **fields,
        'tension': sources.joint.tension,
        'joint_restitution': joint,
        'joint_wall_restitution': joint_walls,
        'decay_restitution': decay,
        'decay_wall_restitution': decay_walls,
    }
