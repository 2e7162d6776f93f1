"""Decays that no smooth function follows are refused in words."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.decay_library import NUISANCES
from nanorocks_ros.inference.decay.friction_terms import FRICTION
from nanorocks_ros.inference.decay.library_fit import (
    Decays,
    distances,
    fewest_nodes,
    fit_library,
    node_of,
)


def decays(log_speed):
    """The same decay in two runs at each node."""
    nodes = [node_of(number) for number in range(fewest_nodes())]

    def column(name):
        return np.array([node[name] for node in nodes])

    return Decays(
        restitution=column('restitution'),
        wall_restitution=column('wall_restitution'),
        floor_lid_restitution=column('floor_lid_restitution'),
        nuisances=np.column_stack([column(name) for name in NUISANCES]),
        friction=np.column_stack([column(name) for name in FRICTION]),
        log_speed=np.full((len(nodes), 2, distances().size), log_speed),
    )


@pytest.mark.parametrize('log_speed', [0.0, np.nan, -np.inf])
def test_beads_that_never_collide_give_one_line_and_no_error_of_linear_algebra(log_speed):
    with (
        np.errstate(all='ignore'),
        pytest.raises(FitError, match='nanorocks measure'),
    ):
        fit_library(load_trays()[1], decays(log_speed), 'test')
