"""Which films work: drawn films through `nanorocks track`, with its verdicts, in one picture.

Told is a diameter in pixels alone; of rods their number, too. The picture is
docs/pictures/films.jpg, on docs/use/films.md.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.drawn_scenes import SCENES, DrawnScene, draw
from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.analysis.bag_tracks import track_bag
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films
from nanorocks_ros.studies.inspection.track_overlay import overlay
from nanorocks_ros.studies.measure.film_tray import FilmedBeads, FilmedTray, described_tray

PICTURE = Path(__file__).resolve().parent.parent / 'docs/pictures/films.jpg'
RATE = 30
_WORKS = (
    'dark on gray',
    'bright on dark',
    'same lightness, other colour',
    'clear',
    'dark shadows',
    'stained floor, rail, holes',
)
_COLUMNS, _LINES = 3, 3


def scenes():
    """Scenes by name: those that work, and three that do not."""
    fast = DrawnScene(count=40, speed=30.0)
    return {
        **{name: SCENES[name] for name in _WORKS},
        'rods': DrawnScene(count=25, speed=1.0),
        'far too fast for its frame rate': fast,
        'beads of 3 px in noise': DrawnScene(radii=(1.5, 1.5), count=60, noise=14.0),
    }


def rods(scene):
    """Frames of rods that drift: four times as long as wide."""
    frames, _ = draw(replace(scene, count=0))
    rng = np.random.default_rng(7)
    columns, rows = scene.size
    places = rng.uniform([20, 20], [columns - 20, rows - 20], (scene.count, 2))
    angles = rng.uniform(0.0, 180.0, scene.count)
    drift = rng.normal(0.0, 0.6, (scene.count, 2))
    for number, frame in enumerate(frames):
        for place, angle, speed in zip(places, angles, drift, strict=True):
            centre = tuple((place + number * speed).tolist())
            box = (centre, (36.0, 9.0), float(angle + number))
            cv2.fillPoly(frame, [np.intp(cv2.boxPoints(box))], (60, 60, 60), lineType=cv2.LINE_AA)
    return frames


def measured(name, scene, folder):
    """The tracked bag of a drawn film."""
    frames = rods(scene) if name == 'rods' else draw(scene)[0]
    pictures = folder / 'pictures'
    pictures.mkdir()
    for number, frame in enumerate(frames):
        cv2.imwrite(str(pictures / f'{number:03d}.png'), frame)
    settings = ImportSettings(rate=RATE, start_ns=10**18)
    bag = import_films([pictures], folder / 'bag', settings, lambda done: None).bag
    count = scene.count if name == 'rods' else None
    beads = FilmedBeads(diameter_px=sum(scene.radii), count=count)
    tray = described_tray(FilmedTray(beads=(beads,)), scene.size)
    told = with_values(PipelineSettings(), {'trays_file': tray.text}, 'film')
    return track_bag(bag, recorded_settings(told, {'trays_file'}, {}, 'film').settings)


def judgement(verdict):
    """Whether the beads can be used, and why not."""
    flags = ', '.join(flag.name.replace('_', ' ') for flag in verdict.flags)
    return 'usable' if verdict.usable else f'not usable: {flags}'


def panel(name, tracked):
    """The last frame with rings and paths, and below it the verdict."""
    (verdict,) = tracked.verdicts[1]
    picture = overlay(
        tracked.pictures[1], tracked.tracks[1], tracked.pixels_per_metre, magnification=1
    )
    words = [
        name,
        verdict.text.partition(': ')[2],
        judgement(verdict),
    ]
    label = np.full((18 * _LINES + 8, picture.shape[1], 3), 255, dtype=np.uint8)
    colour = (0, 110, 0) if verdict.usable else (0, 0, 190)
    for line, text in enumerate(words):
        ink = (0, 0, 0) if line < 2 else colour
        place = (4, 18 * (line + 1))
        cv2.putText(label, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, ink, 1, cv2.LINE_AA)
    return np.vstack([picture, label])


def main():
    """Draw, track, print and write the picture."""
    panels = []
    print('| film | seen | verdict |\n| --- | --- | --- |')
    for name, scene in scenes().items():
        with tempfile.TemporaryDirectory() as folder:
            tracked = measured(name, scene, Path(folder))
        (verdict,) = tracked.verdicts[1]
        drawn = scene.count
        seen = np.mean([record.seen.sum() for record in tracked.tracks[1]])
        print(f'| {name} | {seen:.1f} of {drawn} | {judgement(verdict)} |', flush=True)
        panels.append(panel(name, tracked))
    grid = [
        np.hstack([np.pad(part, ((4, 4), (4, 4), (0, 0)), constant_values=255) for part in row])
        for row in (panels[k : k + _COLUMNS] for k in range(0, len(panels), _COLUMNS))
    ]
    cv2.imwrite(str(PICTURE), np.vstack(grid), [cv2.IMWRITE_JPEG_QUALITY, 80])
    print(f'\n{PICTURE.name} written')


if __name__ == '__main__':
    main()
