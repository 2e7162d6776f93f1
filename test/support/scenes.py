"""Small scenes for the tests: the plate as flown, in a small picture."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from nanorocks_ros.experiment.materials import known_materials
from nanorocks_ros.experiment.trays import Species, load_trays
from nanorocks_ros.settings import SceneSettings, SimulationSettings
from nanorocks_ros.simulation.plate_scene.plate_camera import SceneCamera
from nanorocks_ros.simulation.plate_scene.plate_film import without_effects

SIMULATION = SimulationSettings(width_px=960, height_px=760)
# A scale at which the plate fits into that.
SCALE = 9000.0
PLAIN = replace(without_effects(SceneSettings()), pixels_per_metre=SCALE)
TRAYS = load_trays()


def with_one(number, material='acrylic', diameter=0.002, chalk=None):
    """The plate with a single bead in one tray, and none elsewhere."""
    beads = Species(
        properties=known_materials()[material],
        diameter_low=diameter,
        diameter_high=diameter,
        count=1,
    )
    tray = TRAYS[number]
    dusty = tray.chalk if chalk is None else chalk
    return {**TRAYS, number: replace(tray, species=(beads,), chalk=dusty)}


# A picture depends on nothing that was drawn before, so cameras can be shared.
@lru_cache(maxsize=4)
def camera_with_one(number, scene=PLAIN, simulation=SIMULATION, **bead):
    """A camera over the plate with a single bead in one tray."""
    cells = with_one(number, **bead)
    radius = 0.5 * cells[number].species[0].diameter_high
    return SceneCamera(simulation, scene, cells, {number: np.array([radius])})


@lru_cache(maxsize=4)
def empty_camera(scene=PLAIN, simulation=SIMULATION):
    """A camera over the plate without beads."""
    return SceneCamera(simulation, scene, TRAYS, {})


NEAR = replace(PLAIN, trays=(1,), close_up=True, pixels_per_metre=13500.0)
NEAR_SIMULATION = SimulationSettings(width_px=304, height_px=304)


def near_camera(scene=NEAR, simulation=NEAR_SIMULATION, diameter=0.002, count=1):
    """A camera near to tray 1 with some equal beads of acrylic."""
    tray = with_one(1, diameter=diameter)[1]
    tray = replace(tray, species=(replace(tray.species[0], count=count),))
    radii = np.full(count, 0.5 * diameter)
    return SceneCamera(simulation, scene, {1: tray}, {1: radii})
