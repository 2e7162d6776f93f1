"""Grains that hide each other, and that collide within a fraction of their diameter."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.crowded_grains import (
    displacement_of_path,
    layers_of,
    path_of_displacement,
    persistence_length,
    picture_correlation,
    shared_outline,
)
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray

SIZE, RADIUS, LAYERS = 256, 6.0, 1.5
RATE = 100.0


def test_short_paths_lose_a_sixth_of_themselves_over_the_persistence_length():
    assert displacement_of_path(0.01, 1.0) == pytest.approx(0.01 * (1.0 - 0.01 / 6.0), rel=1e-3)


def test_long_paths_are_diffusion():
    assert displacement_of_path(1000.0, 1.0) == pytest.approx(np.sqrt(2.0 * 1000.0), rel=2e-3)


def test_path_and_displacement_are_inverse():
    for path in (0.0, 0.003, 0.2, 3.0, 40.0):
        displacement = displacement_of_path(path, 0.7)
        assert path_of_displacement(displacement, 0.7) == pytest.approx(path, rel=1e-3)


@pytest.mark.parametrize('number', [6, 8])
def test_grains_of_a_simulated_tray_lose_as_much_path_as_the_theory_says(number):
    tray = load_trays()[number]
    settings = SimulationSettings(
        first_shake=0.0, restitution=1.0, wall_restitution=1.0, speeds='maxwellian'
    )
    shaken = ShakenTray(settings, tray)
    # The arrangement at the start is not that of a gas.
    frames = [shaken.at(0.5 + frame / RATE) for frame in range(21)]
    away = np.linalg.norm((frames[-1][0] - frames[0][0])[:, :2], axis=1).mean()
    speeds = [np.linalg.norm(velocities[:, :2], axis=1).mean() for _, velocities in frames]
    path = float(np.mean(speeds)) * (len(frames) - 1) / RATE
    assert away < 0.8 * path
    assert displacement_of_path(path, persistence_length(tray)) == pytest.approx(away, rel=0.1)


def test_outlines_and_pictures_are_inverse():
    shared = np.linspace(0.0, 1.0, 11)
    assert shared_outline(picture_correlation(shared, 1.3), 1.3) == pytest.approx(shared)


def picture(places, levels, order):
    """Opaque discs on a torus, the later in the order the higher; each has its own level."""
    image = np.zeros((SIZE, SIZE))
    down, across = np.mgrid[:SIZE, :SIZE]
    reach = int(RADIUS) + 1
    window = np.arange(-reach, reach + 1)
    for k in order:
        rows = (int(places[k, 0]) + window) % SIZE
        columns = (int(places[k, 1]) + window) % SIZE
        far_down = (down[rows, 0] - places[k, 0] + SIZE / 2) % SIZE - SIZE / 2
        far_across = (across[0, columns] - places[k, 1] + SIZE / 2) % SIZE - SIZE / 2
        inside = far_down[:, np.newaxis] ** 2 + far_across**2 < RADIUS**2
        block = image[np.ix_(rows, columns)]
        block[inside] = levels[k]
        image[np.ix_(rows, columns)] = block
    return image


def changed_and_predicted(seed):
    """Change of a picture whose grains move singly, by shared outlines, and as a whole."""
    rng = np.random.default_rng(seed)
    count = round(LAYERS * SIZE**2 / (np.pi * RADIUS**2))
    places, levels = SIZE * rng.random((count, 2)), rng.choice([80.0, 120.0], count)
    steps = 0.8 * RADIUS * rng.normal(size=(count, 2))
    first = picture(places, levels, range(count))
    singly = picture(places + steps, levels, range(count))
    together = np.array(
        [
            np.mean([np.mean((np.roll(first, k, axis=axis) - first) ** 2) for axis in (0, 1)])
            for k in range(2 * int(RADIUS) + 2)
        ]
    )
    scale = 0.5 / first.var()
    distances = np.hypot(*steps.T)
    response = np.interp(distances, np.arange(together.size), scale * together)
    shared = shared_outline(np.clip(1.0 - scale * together, 0.0, 1.0), LAYERS)
    mean_share = np.interp(distances, np.arange(together.size), shared).mean()
    return (
        scale * np.mean((singly - first) ** 2),
        1.0 - picture_correlation(mean_share, LAYERS),
        response.mean(),
    )


def test_grains_that_move_singly_change_a_picture_as_their_shared_outlines_say():
    """More than the mean of pictures that move as a whole."""
    results = np.mean([changed_and_predicted(seed) for seed in range(8)], axis=0)
    changed, predicted, as_a_whole = results
    assert changed == pytest.approx(predicted, rel=0.025)
    assert as_a_whole < 0.96 * changed


def test_the_layers_of_the_trays_follow_from_their_grains():
    assert layers_of(load_trays()[8]) == pytest.approx(799 * np.pi / 4 * 0.5833 / 225.0, rel=1e-3)
