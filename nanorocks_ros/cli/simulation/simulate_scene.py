"""``nanorocks simulate --scene``: a film of the plate with all its trays."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.flags import flag_of, settings_from
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.settings import SceneFilmSettings, SimulationSettings, rows

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder
    from nanorocks_ros.studies.synthetic.film_video import VideoQuality

# Flags of the simulation of one tray, and the flags of the scene that replace some of them.
_TRAY_FLAGS = 'tray', 'trajectory', 'events', 'times', 'workers', 'noise', 'pixels_per_metre'
_SCENE_FLAGS = {
    'tray': '--scene-trays',
    'noise': '--scene-noise',
    'pixels_per_metre': '--scene-pixels-per-metre',
}


def check_no_scene_flags(options: argparse.Namespace) -> None:
    """Reject flags of the scene in the simulation of one tray.

    Raises
    ------
    ConfigurationError
        For the first such flag, or for effects of the plate alone.
    """
    if options.effects == 'drawn':
        raise ConfigurationError(
            '--effects', 'drawn is a camera over the plate', 'add --scene --scene-trays 1'
        )
    for row in rows(SceneFilmSettings()):
        if getattr(options, row.name) is not None:
            raise ConfigurationError(
                flag_of(row.name),
                'is a setting of the whole plate',
                'add --scene, or leave it out',
            )


def film_scene(options: argparse.Namespace) -> int:
    """Film, write and print, and return the exit code."""
    files = _files(options)
    recorder, filmed, settings = _recorder(options)
    written: list[str] = []

    def complete() -> str:
        return f'complete: {", ".join(written)}' if written else 'nothing is complete'

    with interruption_says(complete):
        if 'picture' in files:
            recorder.into_picture(files['picture'])
            written.append(str(files['picture']))
        if 'video' in files:
            with Progress('filming the video') as bar:
                recorder.into_video(files['video'], bar.count, _video_quality(options, filmed))
            written.append(str(files['video']))
        if 'bag' in files:
            with Progress('filming the bag') as bar:
                recorder.into_bag(files['bag'], filmed.compression, options.quality, bar.count)
            written.append(str(files['bag']))
    _print(options, recorder, files, {**asdict(filmed), 'simulation': asdict(settings)})
    return 0


def _files(options: argparse.Namespace) -> dict[str, Path]:
    from nanorocks_ros.outputs.atomic_files import check_outputs
    from nanorocks_ros.outputs.photographs import PHOTOGRAPHS
    from nanorocks_ros.studies.synthetic.film_video import VIDEOS, check_video

    for name in _TRAY_FLAGS:
        if getattr(options, name) is not None:
            remedy = (
                f'use {_SCENE_FLAGS[name]}' if name in _SCENE_FLAGS else 'leave out one of them'
            )
            raise ConfigurationError(flag_of(name), 'is a setting of one tray', remedy)
    if options.runs != 1:
        raise ConfigurationError('--runs', 'is a setting of one tray', 'change --seed instead')
    names = 'picture', 'video', 'bag'
    files = {name: Path(getattr(options, name)) for name in names if getattr(options, name)}
    if not files:
        raise ConfigurationError('--scene', 'has no output', 'name a --bag, --video or --picture')
    check_outputs(
        {f'--{name}': path for name, path in files.items()},
        {'--picture': PHOTOGRAPHS, '--video': VIDEOS},
        force=options.force,
    )
    if 'video' in files:
        check_video(files['video'])
    return files


def _recorder(
    options: argparse.Namespace,
) -> tuple[SceneRecorder, SceneFilmSettings, SimulationSettings]:
    from dataclasses import replace

    from nanorocks_ros.experiment.trays import load_trays
    from nanorocks_ros.simulation.plate_scene.plate_film import without_effects
    from nanorocks_ros.simulation.plate_scene.scene_checks import check_scene
    from nanorocks_ros.simulation.shaken_tray import check_settings
    from nanorocks_ros.studies.synthetic.film_bag import check_quality
    from nanorocks_ros.studies.synthetic.film_compression import check_codec
    from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder

    trays = load_trays(options.trays_file)
    defaults, simulation = SceneFilmSettings(), SimulationSettings()
    if options.effects == 'drawn':
        defaults, simulation = _drawn(options, trays)
    if options.effects == 'none':
        defaults = replace(defaults, scene=without_effects(defaults.scene))
    filmed = settings_from(options, defaults)
    settings = settings_from(options, simulation)
    check_settings(settings)
    check_scene(filmed.scene)
    check_codec(filmed.compression)
    check_quality(options.quality)
    recorder = SceneRecorder(
        settings, filmed.scene, options.duration, trays, options.trays_file or ''
    )
    return recorder, filmed, settings


def _drawn(
    options: argparse.Namespace, trays: Mapping[int, Tray]
) -> tuple[SceneFilmSettings, SimulationSettings]:
    """Settings of a camera drawn by the seed, which flags replace."""
    from nanorocks_ros.experiment.trays import tray_by_number
    from nanorocks_ros.simulation.plate_scene.drawn_camera import drawn_camera

    chosen = settings_from(options, SceneFilmSettings()).scene.trays
    if len(chosen) != 1:
        raise ConfigurationError(
            '--effects',
            f'drawn is a camera over one tray, not over {len(chosen)}',
            'add --scene-trays 1',
        )
    simulation = settings_from(options, SimulationSettings())
    camera = drawn_camera(simulation.seed, tray_by_number(trays, chosen[0]), simulation)
    if options.quality is None:
        options.quality = camera.quality
    settings = SceneFilmSettings(scene=camera.scene, compression=camera.compression)
    return settings, camera.simulation


def _video_quality(options: argparse.Namespace, filmed: SceneFilmSettings) -> VideoQuality:
    from nanorocks_ros.studies.synthetic.film_video import VideoQuality

    jpeg = options.quality if options.effects == 'drawn' else None
    return VideoQuality(crf=filmed.compression.crf, jpeg=jpeg)


def _print(
    options: argparse.Namespace,
    recorder: SceneRecorder,
    files: dict[str, Path],
    settings: dict[str, Any],
) -> None:
    summary = recorder.summary
    if options.json:
        bag = {'bag': options.bag} if options.bag else {}
        paths = {name: str(path) for name, path in files.items()}
        print(json.dumps({**summary, **bag, 'settings': settings, 'files': paths}))
        return
    print(f'{"trays":17}{", ".join(str(number) for number in summary["trays"])}')
    print(f'{"film":17}{summary["frames"]} frames, {summary["duration"]:g} s')
    print(f'{"seed":17}{summary["seed"]}')
    print(f'{"written":17}{", ".join(str(path) for path in files.values())}')
