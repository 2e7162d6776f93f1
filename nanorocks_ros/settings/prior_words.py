"""The priors in words: the one line that terminal, report and live page show.

Tested by ``test/settings/test_prior_words.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nanorocks_ros.settings.restitution_settings import PriorSettings

_MM, _MS = 1e3, 1e3


def priors_in_words(prior: PriorSettings) -> str:
    """The priors of restitutions, drag, friction and start, and of the larger common errors.

    Parameters
    ----------
    prior : PriorSettings

    Returns
    -------
    str
        One line, without the word "priors" in front.
    """
    low, high = prior.min_wall_restitution, prior.max_wall_restitution
    walls = f'{low:g} to {high:g}' if low < high else f'{low:g}, known'
    drag_error = f' +- {prior.drag_error:g} /s' if prior.drag_error > 0.0 else ' /s, known'
    # The prior of the friction is a Cauchy distribution, which has no standard deviation.
    friction_error = (
        f', as likely as not within {prior.friction_error:g}'
        if prior.friction_error > 0.0
        else ', known'
    )
    return (
        f'beads 0 to 1, walls {walls}; common errors: scale {prior.scale_error:g}, collisions '
        f'{prior.collision_bias:g}, rebounds {prior.rebound_bias:g}, diameter '
        f'{prior.diameter_error:g}, height {_MM * prior.height_error:g} mm; readout of a side '
        f'{_MS * prior.readout:g} ms; drag {prior.drag:g}{drag_error}; friction '
        f'{prior.friction:g}{friction_error}; mean speed at the start '
        f'{_MM * prior.initial_speed:g} mm/s within a factor of '
        f'{math.exp(prior.initial_speed_spread):.2g}'
    )
