"""Trays and initial speeds drawn from the priors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PriorSettings


def varied(
    tray: Tray, wall: float, prior: PriorSettings, random: np.random.Generator
) -> tuple[Tray, dict[str, float | str]]:
    """A tray drawn from the priors, and settings of its gas.

    Parameters
    ----------
    tray : Tray
    wall : float
        Restitution of its side walls.
    prior : PriorSettings
    random : Generator
    """
    species = list(tray.species)
    main = max(range(len(species)), key=lambda k: species[k].count)
    size = 1.0 + prior.diameter_error * random.standard_normal()
    count = species[main].count + round(prior.count_error * random.standard_normal())
    species[main] = replace(
        species[main],
        diameter_low=size * species[main].diameter_low,
        diameter_high=size * species[main].diameter_high,
        count=count,
    )
    length, width, height = tray.dimensions
    height += prior.height_error * random.standard_normal()
    # Floor and lid cannot lose more than everything.
    loss = min((1.0 - wall) * math.exp(prior.floor_lid_spread * random.standard_normal()), 1.0)
    values: dict[str, float | str] = {
        'vertical_speed_factor': math.exp(prior.anisotropy_spread * random.standard_normal()),
        'speeds': 'maxwellian' if random.random() < 0.5 else 'uniform',
        'floor_lid_difference': (1.0 - loss) - wall,
    }
    return replace(tray, species=tuple(species), dimensions=(length, width, height)), values
