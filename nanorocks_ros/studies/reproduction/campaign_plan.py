"""The plan of a simulated campaign: its cycles, their seeds, and the settings of their analysis.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.experiment.paper_values import PAPER_PEAK_SPEED
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values

if TYPE_CHECKING:
    from pathlib import Path

SCALE = 12500.0
"""Scale of the image of the plate at a width of 1920 pixels, [px/m]."""

PROJECTED = 0.25 * math.pi
"""Mean projected speed over mean speed of beads that fly in all directions alike."""

BOUNCING, STICKING = 'bouncing', 'sticking'
FIRST_SHAKE = 1.0
"""Time of the shaking event in a film, [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignPlan:
    """The gas and the number of cycles of a campaign.

    Parameters
    ----------
    cycles : int, > 0
        Cycles of each kind, without and with sticking.
    seconds : float, [s]
        Length of the film of a cycle.
    seed : int
    mean_speed : float, [m/s]
        Mean three-dimensional speed of the beads after a shaking event.
    restitution, wall_restitution : float, 0 to 1
    sticking_speed : float, [m/s]
        Speed below which beads stick, in the cycles with sticking.
    """

    cycles: int = 1
    seconds: float = 34.0
    seed: int = 1
    mean_speed: float = round(PAPER_PEAK_SPEED / PROJECTED, 5)
    restitution: float = 0.89
    wall_restitution: float = 0.97
    sticking_speed: float = 3e-3

    def tasks(self, folder: Path) -> dict[str, CycleTask]:
        """The task of each cycle, by the name of its folder."""
        return {
            f'{kind}_{number:03d}': CycleTask(
                plan=self, folder=folder / f'{kind}_{number:03d}', kind=kind, number=number
            )
            for number in range(1, self.cycles + 1)
            for kind in (BOUNCING, STICKING)
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleTask:
    """One cycle to film and analyse."""

    plan: CampaignPlan
    folder: Path
    kind: str
    number: int

    @property
    def simulation(self) -> SimulationSettings:
        """Settings of gas and camera of the cycle."""
        plan = self.plan
        return SimulationSettings(
            seed=10_000 * plan.seed + 2 * self.number + int(self.kind == STICKING),
            mean_speed=plan.mean_speed,
            restitution=plan.restitution,
            wall_restitution=plan.wall_restitution,
            sticking_speed=plan.sticking_speed if self.kind == STICKING else 0.0,
            first_shake=FIRST_SHAKE,
        )


def plate_settings(**values: object) -> PipelineSettings:
    """Settings of the analysis of films of the plate; further settings by name."""
    settings = {
        'trays': sorted(load_trays()),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': SCALE,
        **values,
    }
    return with_values(PipelineSettings(), settings, 'campaign')


def paper_settings() -> PipelineSettings:
    """`plate_settings` with the methods of the paper: binarised area, its closed form.

    The area by its Taylor expansion ([B19] eq. 2); the time step is that of the averages that are
    compared, ten frames, where the paper writes one frame. A calibration takes either up.
    """
    return plate_settings(
        **{
            'speed.method': 'binarised_area',
            'speed.geometry': 'taylor',
            'cooling.relation': 'paper',
            'cooling.delay': 0.0,
        }
    )
