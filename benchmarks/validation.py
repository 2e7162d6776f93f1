"""Validation report of camera, tracking and speed, written to docs/validation/validation.md.

Goals, results on one cycle of the simulated plate with all effects, and deviations from the goals;
with the numbers of the paper where they exist.
"""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from benchmarks import area_calibration
from benchmarks.scene_bag import QUALITY, SCALE, SECONDS, SHAKE, film_scene, scenes, settings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.analysis.bag_tracks import track_bag
from nanorocks_ros.studies.inspection.speed_comparison import AUTO, METHODS, compare_speeds
from nanorocks_ros.wire.bead_truth import beads_from_array

if TYPE_CHECKING:
    from nanorocks_ros.records import BeadsTruth, Tracks
    from nanorocks_ros.studies.inspection.speed_comparison import ComparedSpeeds

_ROOT = Path(__file__).parents[1]
_PAGE = _ROOT / 'docs' / 'validation' / 'validation.md'
_TEXT = Path(__file__).with_name('validation.md')
_PAPER = _ROOT / 'test' / 'paper_values.json'
_TRAYS = (1, 2, 3, 4, 5, 6, 7)
# Time after the shaking event in which the tracker learns floor and beads, [s].
_SETTLED = 0.5
# Largest distance of a position from its bead, over the smallest radius.
_REACH = 0.6
# Gray levels added by a reflection, above which a position lies in the glare.
_GLARE_LEVEL = 60.0
# Goals: share of the beads seen, by tray and material; tray 4 outside the glare.
_COUNTS = {
    (1, 'acrylic'): (0.95, 1.05),
    (2, 'acrylic'): (0.95, 1.05),
    (2, 'glass'): (0.95, 1.05),
    (3, 'acrylic'): (0.95, 1.05),
    (3, 'glass'): (0.95, 1.05),
    (4, 'glass'): (0.90, 1.10),
    (4, 'copper'): (0.90, 1.10),
    (5, 'glass'): (0.95, 1.05),
    (5, 'copper'): (0.95, 1.05),
    (6, 'glass'): (0.95, 1.05),
    (7, 'acrylic'): (0.95, 1.05),
}
# Goals: relative error of the speed, by tray.
_SPEEDS = {1: 0.05, 3: 0.05, 5: 0.10, 7: 0.10}
_FAR_OFF = 0.2
_NS = 1e9


@dataclass
class _Counts:
    """Numbers of positions of the beads of one species, over all frames."""

    true: int = 0
    true_outside: int = 0
    seen: int = 0
    seen_outside: int = 0
    right_outside: int = 0


class _Glare:
    """The glare of the LEDs on the plate."""

    def __init__(self) -> None:
        camera = SceneFilm(*scenes()).camera
        self._levels, self._geometry = camera.glare, camera.geometry

    def hides(self, tray: int, positions: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        if self._levels is None:
            return np.zeros(len(positions), dtype=bool)
        region = self._geometry.regions[tray]
        straight = (positions + displacement) * SCALE + np.array([region.x, region.y])
        columns, rows = self._geometry.camera.distorted(straight).astype(np.int64).T
        return self._levels[rows, columns] > _GLARE_LEVEL


def _counts(bag: Path) -> dict[tuple[int, str], _Counts]:
    bag_tracks = track_bag(bag, settings(_TRAYS))
    glare, counts = _Glare(), defaultdict(_Counts)
    for number, tray in bag_tracks.trays.items():
        truth = _beads(bag, number, bag_tracks.epoch_ns)
        for tracks, frame in zip(
            bag_tracks.tracks[number], bag_tracks.numbers[number], strict=True
        ):
            if (tracks.stamp_ns - bag_tracks.epoch_ns) / _NS < SHAKE + _SETTLED:
                continue
            for index, species in enumerate(tray.species):
                _add(counts[number, species.material], tracks, truth[frame], index, glare)
    return counts


def _beads(bag: Path, number: int, epoch_ns: int) -> list[BeadsTruth]:
    frames = BagFrames(bag)
    topic = f'/nanorocks/tray_{number}/beads'
    return [
        beads_from_array(
            frames.reader.deserialize(message).data, tray=number, epoch_ns=epoch_ns, where=topic
        )
        for message in frames.reader.messages([topic])
    ]


def _add(count: _Counts, tracks: Tracks, truth: BeadsTruth, index: int, glare: _Glare) -> None:
    selected = truth.species == index
    places = truth.positions[selected, :2]
    clear = ~glare.hides(tracks.tray, places, truth.displacement)
    ours = tracks.positions[tracks.seen & (tracks.species == index)]
    reach = _REACH * float(truth.radii[selected].min())
    apart = cdist(places, ours)
    rows, columns = linear_sum_assignment(np.minimum(apart, reach))
    right = rows[apart[rows, columns] < reach]
    count.true += len(places)
    count.true_outside += int(clear.sum())
    count.seen += len(ours)
    count.seen_outside += int((~glare.hides(tracks.tray, ours, tracks.displacement)).sum())
    count.right_outside += int(clear[right].sum())


def _table_2(bag: Path) -> list[str]:
    paper = json.loads(_PAPER.read_text(encoding='utf-8'))['table2_percent_tracked']
    paper_shares = {
        number: f'{share:.0f} ({spread:.0f})'
        for number, share, spread in zip(
            paper['tray'], paper['percent'], paper['mean_abs_dev'], strict=True
        )
    }
    counts = _counts(bag)
    lines = [
        '| tray | species | true | paper [%] | seen [%] | seen, outside [%] | '
        'right, outside [%] | goal [%] | seen: missed by | right: missed by |',
        '| --- |' + ' --- |' * 9,
    ]
    trays = load_trays()
    for (number, material), species_counts in counts.items():
        true = next(s.count for s in trays[number].species if s.material == material)
        if not species_counts.seen:
            lines.append(f'| {number} | {material} | {true} | | not followed | | | | | |')
            continue
        low, high = _COUNTS.get((number, material), (None, None))
        right = species_counts.right_outside / species_counts.true_outside
        counted = (
            species_counts.seen_outside / species_counts.true_outside
            if number == 4
            else species_counts.seen / species_counts.true
        )
        cells = [
            str(number),
            material,
            str(true),
            '' if low is None else paper_shares[number],
            _percent(species_counts.seen, species_counts.true),
            _percent(species_counts.seen_outside, species_counts.true_outside),
            _percent(species_counts.right_outside, species_counts.true_outside),
            _goal(counted, right, low, high),
        ]
        lines.append(f'| {" | ".join(cells)} |')
    return lines


def _percent(part: int, total: int) -> str:
    return f'{100.0 * part / max(total, 1):.1f}'


def _goal(share: float, right: float, low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return 'none | |'
    missed = _missed(max(low - share, share - high, 0.0))
    return f'{100 * low:.0f} to {100 * high:.0f} | {missed} | {_missed(max(low - right, 0.0))}'


def _missed(share: float) -> str:
    return f'**{100 * share:.1f}**' if round(share, 3) > 0.0 else '0'


def _speeds(bag: Path) -> list[str]:
    speeds = compare_speeds(bag, settings(_TRAYS))
    lines = [
        '| tray | tracking | structure function | binarised area | chosen from the data | '
        'goal | missed by | off by over 20 % and not flagged |',
        '| --- |' + ' --- |' * 7,
    ]
    for number, tray in speeds.trays.items():
        cells = [_ratio(tray, method) for method in (*METHODS, AUTO)]
        shares = tray.chosen(1).items()
        taken = ', '.join(f'{100 * share:.0f} % {name[0]}' for name, share in shares if share)
        goal = _SPEEDS.get(number)
        off = abs(float(np.mean(tray.ratios(AUTO, 1))) - 1.0)
        judged = f'{100 * goal:.0f} % | {_missed(max(0.0, off - goal))}' if goal else 'none |'
        lines.append(
            f'| {number} | {" | ".join(cells)}: {taken} | {judged} | {_silent(tray):.1%} |'
        )
    return lines


def _ratio(tray: ComparedSpeeds, method: str) -> str:
    ratios = tray.ratios(method, 1)
    return f'{ratios.mean():.2f} ({ratios.std():.2f})' if ratios.size else 'unknown'


def _silent(tray: ComparedSpeeds) -> float:
    """Share of the speeds chosen from the data with a large error and no flag."""
    estimates = [speed for speed in tray.speeds[AUTO] if speed.cycle == 1]
    ratios = np.array(
        [estimate.mean_projected_speed.value for estimate in estimates]
    ) / tray.true_speeds(estimates)
    flagged = np.array([bool(estimate.quality) for estimate in estimates])
    return float(np.mean((np.abs(ratios - 1.0) > _FAR_OFF) & ~flagged))


def page(bag: Path) -> str:
    """The page for a bag of `film_scene`."""
    return _TEXT.read_text(encoding='utf-8').format(
        quality=QUALITY,
        seconds=SECONDS,
        table_2='\n'.join(_table_2(bag)),
        speeds='\n'.join(_speeds(bag)),
        area='\n'.join(area_calibration.table(bag)),
    )


def report() -> None:
    """Write the page, and print it."""
    with TemporaryDirectory() as folder:
        bag = Path(folder) / 'scene'
        film_scene(bag)
        text = page(bag)
    _PAGE.write_text(text, encoding='utf-8')
    print(text)
