"""One node of a decay library: the plan it belongs to, its settings, its simulated decays.

Tested by ``test/studies/libraries/test_decay_simulations.py``.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.inference.decay.decay_library import count_step, tray_key
from nanorocks_ros.inference.decay.friction_terms import TANGENTIAL
from nanorocks_ros.inference.decay.library_fit import distances, node_of
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.simulation.ensemble import cooling_runs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# In space, [m/s]. Arbitrary without drag and for restitutions that do not depend on speed: then
# the decay is a function of speed times time alone.
MEAN_SPEED = 0.01
# The mean projected speed of a drawn start is within these factors of the expected one.
_SLOWER, _FASTER = 0.3, 3.0
_TIMES = 150
# Rough nodes have random numbers of their own.
_FIRST_ROUGH = 1 << 20
# Smallest loss of the first pair of species, whose ratio to the others is kept.
_LEAST_LOSS = 1e-9
# Smallest speed over the first.
_REST = 1e-100


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryPlan:
    """Parameters of the simulations for a decay library.

    Parameters
    ----------
    tray : Tray
    nodes : int
        Number of points in the space of restitutions and nuisance parameters, with smooth beads.
    rough_nodes : int
        Further points, with beads that rub; 0: the library knows smooth beads alone.
    runs : int
        Runs at each node.
    seed : int
    drag : float, [1/s]
        As the setting of that name, at the mean speed of `MEAN_SPEED` at the start: what counts is
        the drag over the speed.
    law : mapping of str to values
        All `LAW_SETTINGS` of restitutions that are not constant; each node has its own value. Of
        ``restitution_pairs`` the first is that of the node, and the losses of the others keep
        their ratio to it. A uniform distribution is narrower where it would leave 0 to 1.
    """

    tray: Tray
    nodes: int
    runs: int
    rough_nodes: int = 0
    seed: int = 1
    drag: float = 0.0
    law: Mapping[str, Any] = field(default_factory=dict)

    @property
    def conditions(self) -> dict[str, Any]:
        """What is not as assumed of measured decays, see `tray_key`."""
        given = {'drag': self.drag, 'law': dict(self.law)}
        return {name: value for name, value in given.items() if value}

    def specification(self) -> str:
        """Everything that the library depends on, as a JSON object."""
        return json.dumps(
            {
                'version': __version__,
                'nodes': self.nodes,
                'rough_nodes': self.rough_nodes,
                'runs': self.runs,
                'seed': self.seed,
                'tray': json.loads(tray_key(self.tray, self.conditions)),
            }
        )


def cool_node(plan: LibraryPlan, number: int, *, rough: bool = False) -> NDArray[np.float64]:
    """Decays of the runs at one node, ln f, (n_runs, n_x).

    Parameters
    ----------
    plan : LibraryPlan
    number : int
        Of the node.
    rough : bool
        Whether it is one of the rough ones.

    Raises
    ------
    SimulationError
        When the beads do not fit, or a run has events without end.
    """
    x = distances()
    times = np.geomspace(x[0] / (_FASTER * MEAN_SPEED), x[-1] / (_SLOWER * MEAN_SPEED), _TIMES)
    settings, tray = simulated_node(plan, number, rough=rough)
    first = number + (_FIRST_ROUGH if rough else 0)
    runs = [(first << 32) + run for run in range(plan.runs)]
    speed = cooling_runs(settings, tray, np.concatenate(([0.0], times)), runs).mean_projected_speed
    start = speed[:, :1]
    # Beads that rub may come to rest, in the end of all digits.
    speed = np.maximum(speed, _REST * start)
    return np.array(
        [
            np.interp(np.log(x), np.log(times * first[0]), np.log(curve[1:] / first[0]))
            for curve, first in zip(speed, start, strict=True)
        ]
    )


def simulated_node(
    plan: LibraryPlan, number: int, *, rough: bool = False
) -> tuple[SimulationSettings, Tray]:
    """Settings and tray of a node.

    Raises
    ------
    ConfigurationError
        For a drag or a law outside its range.
    """
    node = node_of(number, rough=rough)
    tray = plan.tray
    index = max(range(len(tray.species)), key=lambda k: tray.species[k].count)
    most_frequent = tray.species[index]
    size = 1.0 + node['diameter']
    species = list(tray.species)
    species[index] = replace(
        most_frequent,
        diameter_low=size * most_frequent.diameter_low,
        diameter_high=size * most_frequent.diameter_high,
        count=max(1, most_frequent.count + round(node['count']) * count_step(tray)),
    )
    length, width, height = tray.dimensions
    wall, ends = node['wall_restitution'], node['floor_lid_restitution']
    values = {
        'seed': plan.seed,
        'restitution': node['restitution'],
        'wall_restitution': wall,
        'floor_lid_difference': ends - wall,
        'vertical_speed_factor': math.exp(node['anisotropy']),
        'speeds': 'maxwellian' if node['start'] > 0.0 else 'uniform',
        'mean_speed': MEAN_SPEED,
        'drag': plan.drag,
        **_law(plan.law, node['restitution']),
    }
    if rough:
        tangential = TANGENTIAL + node['tangential']
        friction = node['wall_friction']
        values |= {
            'tangential_restitution': tangential,
            'wall_tangential_restitution': tangential,
            'wall_friction': friction,
            'friction': friction * math.exp(node['bead_friction']),
        }
    return (
        with_values(SimulationSettings(), values, 'decay library'),
        replace(tray, species=tuple(species), dimensions=(length, width, height + node['height'])),
    )


def _law(law: Mapping[str, Any], restitution: float) -> dict[str, Any]:
    """Settings of the law at a node of some restitution."""
    values = dict(law)
    if 'restitution_width' in law:
        room = 2.0 * min(restitution, 1.0 - restitution)
        values['restitution_width'] = min(law['restitution_width'], room)
    if pairs := law.get('restitution_pairs'):
        loss = (1.0 - restitution) / max(1.0 - pairs[0], _LEAST_LOSS)
        values['restitution_pairs'] = tuple(max(1.0 - loss * (1.0 - pair), 0.0) for pair in pairs)
    return values
