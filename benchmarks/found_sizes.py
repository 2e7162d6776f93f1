"""Sizes of two species that nobody told, in drawn films: their errors, and who is mistaken.

Told is that there are two species that look alike, or of drawn cameras their colours, too. Beads
are detected with the sizes found; a bead is mistaken when a disc on it is taken for the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.drawn_scenes import SCENES, draw
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.plate_scene.drawn_camera import drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.stages.tracking.scene.scene_detector import SceneDetector
from nanorocks_ros.studies.measure.species_sizes import SpeciesLook, species_sizes

_LOOKS = (
    'dark on gray',
    'bright on dark',
    'same lightness, other colour',
    'dark shadows',
    'stained floor, rail, holes',
    'crowded',
    'clear',
)
_RADII = ((4.0, 6.0), (7.0, 10.5), (9.0, 11.0), (10.0, 10.5), (14.0, 21.0))
# Beads, or part of the picture that a crowd covers.
_COUNT, _CROWD, _FRAMES = 20, 0.35, 48
# Every so many frames the detection is compared with the truth; places agree within [px].
_EVERY, _NEAR = 6, 0.5
_CAMERAS = 10
_SECONDS = 3.0
_SCALE = 1000.0
_DRAWN_TRAY = """\
trays:
  1:
    dimensions_mm: [20, 15, 3]
    place_mm: [6, 5]
    species:
      - {material: acrylic, diameter_mm: 2, count: 12}
      - {material: copper, diameter_mm: 1.4, count: 16}
"""


def report() -> None:
    """Print a row for the films of discs of each look, and tables of drawn cameras."""
    radii = ', '.join(f'{small:g} and {large:g}' for small, large in _RADII)
    print(f'radii [px]: {radii}\n')
    print('| film | found | found - true [px] | rms [px] | seen | mistaken |')
    print('| --- ' * 6 + '|')
    refused = []
    for name in _LOOKS:
        errors, shares = [], []
        for pair in _RADII:
            scene = replace(SCENES[name], sizes=pair, count=_COUNT, frames=_FRAMES)
            if name == 'crowded':
                bead = np.pi * np.mean(np.square(pair))
                scene = replace(scene, count=int(_CROWD * np.prod(scene.size) / bead))
            frames, truth = draw(scene)
            found = species_sizes(frames[::2], [SpeciesLook(), SpeciesLook()])
            if isinstance(found, str):
                refused.append(f'{name}, {pair[0]:g} and {pair[1]:g} px: {found}')
                continue
            diameters = np.array([size.diameter for size in found])
            errors.append(diameters - 2.0 * np.array(pair))
            shares.append(_seen(frames, truth, diameters, scene.size, np.array(pair)))
        off = np.concatenate(errors)
        rms = np.sqrt(np.mean(np.square(off)))
        seen, mistaken = np.array(shares).T
        print(
            f'| {name} | {len(errors)} of {len(_RADII)} | {off.min():+.2f} to {off.max():+.2f} '
            f'| {rms:.2f} | {seen.min():.3f} or more | {mistaken.max():.3f} or less |',
            flush=True,
        )
    print(*(f'\nrefused: {reason}' for reason in refused), '\n')
    _report_cameras()


def _seen(frames, truth, diameters, size, radii):
    """Share of the beads that are seen, and of these that are taken for the other species."""
    rows = ''.join(f'      - {{diameter_mm: {one}, look: auto}}\n' for one in diameters)
    sides = f'[{size[0]}, {size[1]}]'
    text = f'trays:\n  1:\n    dimensions_mm: {sides}\n    species:\n{rows}'
    detector = SceneDetector(load_trays(text)[1], _SCALE)
    detector.learn(frames[::2])
    beads = seen = mistaken = 0
    for number in range(0, len(frames), _EVERY):
        places = cKDTree(truth[number][:, :2])
        beads += len(truth[number])
        for k, discs in enumerate(detector.detect(frames[number])):
            if len(discs.radii):
                away, nearest = places.query(discs.positions - 0.5)
                on_bead = away < _NEAR * truth[number][nearest, 2]
                seen += on_bead.sum()
                mistaken += (truth[number][nearest[on_bead], 2] != radii[k]).sum()
    return seen / beads, mistaken / max(seen, 1)


def _report_cameras() -> None:
    """Print how sizes are found in films of drawn cameras, with and without colours told."""
    (cell,) = load_trays(_DRAWN_TRAY).values()
    true = np.array([species.diameter for species in cell.species])
    told = {
        'two species': [SpeciesLook(), SpeciesLook()],
        'their colours': [SpeciesLook(colour=kind.properties.color) for kind in cell.species],
    }
    ratios: dict[str, list[np.ndarray]] = {name: [] for name in told}
    refused: dict[str, list[str]] = {name: [] for name in told}
    for seed in range(_CAMERAS):
        gas = SimulationSettings(seed=seed, first_shake=0.0, mean_speed=0.01)
        camera = drawn_camera(seed, cell, gas)
        film = SceneFilm(camera.simulation, camera.scene, {1: cell})
        last = _SECONDS * camera.simulation.frame_rate
        frames = [film.at(round(n), 0).frame.image for n in np.linspace(1.0, last, 25)]
        for name, looks in told.items():
            found = species_sizes(frames, looks)
            if isinstance(found, str):
                refused[name].append(found)
                continue
            # The smaller of two that look alike is the first.
            sizes = np.array([size.diameter for size in found])
            order = slice(None, None, -1 if looks[0] == looks[1] else 1)
            ratios[name].append(sizes[order] / camera.scene.pixels_per_metre / true)
    print('| told | films | found | 2 mm: found / true | 1.4 mm: found / true |')
    print('| --- ' * 5 + '|')
    for name, rows in ratios.items():
        middle, low, high = np.quantile(np.array(rows), [0.5, 0.1, 0.9], axis=0)
        shown = ' | '.join(
            f'{m:.3f}, {a:.3f} to {b:.3f}' for m, a, b in zip(middle, low, high, strict=True)
        )
        print(f'| {name} | {_CAMERAS} | {len(rows)} | {shown} |')
    for name, reasons in refused.items():
        for reason in reasons:
            print(f'{name}: refused: {reason}')


if __name__ == '__main__':
    report()
