"""A bag with one cycle of the whole plate with all effects, for several benchmarks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.settings import (
    CompressionSettings,
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder

if TYPE_CHECKING:
    from pathlib import Path

SCALE = 12500.0
SECONDS = 16.0
SHAKE = 1.0
QUALITY = 85


def scenes() -> tuple[SimulationSettings, SceneSettings]:
    """Settings of the film: the default gas and plate, shaken after a second."""
    return SimulationSettings(first_shake=SHAKE), SceneSettings(trays=(1, 2, 3, 4, 5, 6, 7))


def film_scene(path: Path) -> None:
    """Write the film as a bag."""
    simulation, scene = scenes()
    recorder = SceneRecorder(simulation, scene, SECONDS)
    recorder.into_bag(path, CompressionSettings(), QUALITY, lambda done, total: None)


def settings(trays: tuple[int, ...], **speed: float | str) -> PipelineSettings:
    """Settings of its analysis."""
    names = {
        'trays': list(trays),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': SCALE,
        **{f'speed.{name}': value for name, value in speed.items()},
    }
    return with_values(PipelineSettings(), names, 'benchmark')
