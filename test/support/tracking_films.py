"""Simulated films of trays without lens effects, with the true position of every bead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import TrayImage
from nanorocks_ros.settings import (
    PipelineSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.initial_state import inventory
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera

SCALE = 12500.0
RATE = 30.0


@dataclass(frozen=True)
class Truth:
    """True positions [m] and velocities [m/s] of the beads in an image."""

    positions: np.ndarray
    velocities: np.ndarray
    radii: np.ndarray
    species: np.ndarray


def pipeline_settings(number, **values):
    names = {'trays': [number], 'preprocess.pixels_per_metre': SCALE, **values}
    return with_values(PipelineSettings(), names, 'test')


def tray_film(number, frames, speed=0.007, **values):
    """Images of a tray that is shaken after six frames, with the truth of each."""
    tray = load_trays()[number]
    width, height = (round(side * SCALE) for side in tray.dimensions[:2])
    settings = SimulationSettings(
        tray=number,
        mean_speed=speed,
        first_shake=0.2,
        pixels_per_metre=SCALE,
        width_px=width + 60,
        height_px=height + 60,
        frame_rate=RATE,
        **values,
    )
    shaken = ShakenTray(settings, tray)
    camera = TrayCamera(settings, tray, shaken.radii, shaken.materials)
    x, y, width, height = camera.region
    species = inventory(tray).species
    for k, moment in enumerate(shaken.moments(frames)):
        picture = camera.picture(moment.positions, k)
        color = np.ascontiguousarray(picture[y : y + height, x : x + width])
        image = TrayImage(
            stamp_ns=moment.truth.stamp_ns, tray=number, gray=color[:, :, 1].copy(), color=color
        )
        yield image, Truth(moment.positions, moment.velocities, shaken.radii, species)


def match_positions(true_positions, positions, reach):
    """Rows of true and of detected positions that match within `reach`."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    distances = cdist(true_positions, positions)
    rows, columns = linear_sum_assignment(np.minimum(distances, reach))
    is_near = distances[rows, columns] < reach
    return rows[is_near], columns[is_near]
