"""Tracks against the truth: detected beads, links against trackpy, and cost.

Films of the whole plate through the lens with all effects (JPEG 85), or of single trays without
effects. A link joins a bead in one frame to a bead in the next. Errors of positions are stated
about a shift that all beads of a species share: scatter is that about the median error.
"""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from benchmarks.films import RATE, SCALE, Shot, filmed
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import BeadsTruth, Tracks
from nanorocks_ros.settings import PipelineSettings, TrackingSettings, with_values
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector, Detections
from nanorocks_ros.stages.tracking.linking.flight_deviations import FlightDeviations
from nanorocks_ros.stages.tracking.linking.track_linker import Linker
from nanorocks_ros.stages.tracking.tracker import Tracker

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm

_TRAYS = (1, 2, 3, 4, 5, 6, 7)
_WARM_UP = 45
_FRAMES = 150
# Gray levels added by a reflection, above which a position lies in the glare.
_GLARE_LEVEL = 60.0


def _tracked(shots: list[Shot], tray: int) -> Iterator[tuple[Tracks, BeadsTruth]]:
    settings = with_values(PipelineSettings(), {'preprocess.pixels_per_metre': SCALE}, 'benchmark')
    tracker = Tracker(settings, load_trays()[tray])
    for shot in shots:
        if tray in shot.images:
            for tracks in tracker.push(shot.images[tray]):
                yield tracks, shot.truth[tray]


def _pairs(
    references: NDArray[np.float64], positions: NDArray[np.float64], reach: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    apart = cdist(references, positions)
    rows, columns = linear_sum_assignment(np.minimum(apart, reach))
    near = apart[rows, columns] < reach
    return rows[near], columns[near]


def _in_glare(film: SceneFilm, tray: int, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    levels = film.camera.glare
    if levels is None:
        return np.zeros(len(places), dtype=bool)
    geometry = film.camera.geometry
    region = geometry.regions[tray]
    points = geometry.camera.distorted(places * SCALE + (region.x, region.y))
    columns, rows = points.astype(np.int64).T
    return levels[rows, columns] > _GLARE_LEVEL


def _report_counts(shots: list[Shot], film: SceneFilm) -> None:
    """Print [B19] table 2, tracked over true particles, and errors of the positions."""
    print('\nTracked / true beads, all effects, 7 mm/s; "outside" is outside the glare\n')
    print(
        '| tray | species | true | seen | seen, outside | followed | found and right, outside | '
        'rms error [px] | scatter [px] | scatter / stated error |'
    )
    print('| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |')
    for number in _TRAYS:
        tray = load_trays()[number]
        records = list(_tracked(shots, number))[_WARM_UP:]
        for index, species in enumerate(tray.species):
            print(_count_row(records, film, number, index, species.material))


def _count_row(
    records: list[tuple[Tracks, BeadsTruth]], film: SceneFilm, number: int, index: int, name: str
) -> str:
    seen, seen_outside, followed, right, true, outside = [], [], [], [], [], []
    errors, stated = [np.empty((0, 2))], [np.empty(0)]
    for tracks, truth in records:
        selected = truth.species == index
        places = truth.positions[selected, :2]
        clear = ~_in_glare(film, number, places)
        ours = tracks.seen & (tracks.species == index)
        positions = tracks.positions[ours]
        rows, columns = _pairs(places, positions, 0.6 * float(truth.radii[selected].min()))
        true.append(selected.sum())
        outside.append(clear.sum())
        seen.append(ours.sum())
        seen_outside.append((~_in_glare(film, number, positions)).sum())
        followed.append((tracks.species == index).sum())
        right.append(clear[rows].sum())
        errors.append((positions[columns] - places[rows]) * SCALE)
        stated.append(tracks.position_errors[ours][columns] * SCALE)
    error = np.concatenate(errors)
    if not error.size:
        return f'| {number} | {name} | {np.mean(true):.0f} | not followed | | | | | | |'
    scatter = error - np.median(error, axis=0)
    pull = scatter / np.concatenate(stated)[:, np.newaxis]
    return (
        f'| {number} | {name} | {np.mean(true):.0f} | {np.sum(seen) / np.sum(true):.1%} | '
        f'{np.sum(seen_outside) / np.sum(outside):.1%} | {np.sum(followed) / np.sum(true):.1%} | '
        f'{np.sum(right) / np.sum(outside):.1%} | {np.sqrt(np.mean(error**2)):.2f} | '
        f'{np.sqrt(np.mean(scatter**2)):.2f} | {np.median(np.abs(pull)) / 0.6745:.1f} |'
    )


def _report_links() -> None:
    """Print our linker and trackpy on the same detections, in one run."""
    print('\nLinks, no effects; the same detections for both, made without knowledge of tracks\n')
    print(
        '| tray, species, v | linker | right / possible links | wrong / made links | '
        'identity switches per bead and minute | ms per frame |'
    )
    print('| --- | --- | --- | --- | --- | --- |')
    for number, index, speed in ((1, 0, 7e-3), (3, 0, 15e-3), (3, 1, 7e-3), (5, 0, 15e-3),
                                 (5, 1, 15e-3), (7, 1, 7e-3)):  # fmt: skip
        shots, _ = filmed(speed, effects=False, frames=_FRAMES, trays=(number,))
        detections, beads = _detections(shots, number, index)
        name = f'{number}, {load_trays()[number].species[index].material}, {1e3 * speed:g} mm/s'
        for linker, link in (
            ('ours', _link_ours),
            *_trackpy_linkers(detections, beads, number, index),
        ):
            link(detections, number, index)
            start = time.process_time()
            numbers = link(detections, number, index)
            cost = (time.process_time() - start) / len(detections)
            right, wrong, switches = _judge(numbers, beads)
            print(f'| {name} | {linker} | {right:.2%} | {wrong:.3%} | {switches:.2f} | '
                  f'{1e3 * cost:.2f} |', flush=True)  # fmt: skip


def _trackpy_linkers(
    detections: list[Detections], beads: list[NDArray[np.int64]], number: int, index: int
) -> list[tuple[str, Callable[..., list[NDArray[np.int64]]]]]:
    """trackpy with its nearest-velocity prediction, at the search range with most right links."""
    try:
        import trackpy
    except ImportError:
        print('| | trackpy is not installed: `make venv`, or pip install trackpy | | | | |')
        return []
    best: tuple[float, float] | None = None
    for diameters in (0.5, 0.75, 1.0, 1.5):
        try:
            numbers = _link_trackpy(detections, number, index, diameters)
        except trackpy.linking.SubnetOversizeException:
            break
        right = _judge(numbers, beads)[0]
        if best is None or right > best[0]:
            best = right, diameters
    if best is None:
        print(f'| {number}, {index} | trackpy | refuses: too crowded | | | |')
        return []
    link = partial(_link_trackpy, diameters=best[1])
    return [(f'trackpy, range {best[1]:g} d', link)]


def _detections(
    shots: list[Shot], number: int, index: int
) -> tuple[list[Detections], list[NDArray[np.int64]]]:
    """Detections in each frame, and the index of the bead of each; -1 for none."""
    tray = load_trays()[number]
    detector = BeadDetector(TrackingSettings(), tray, SCALE)
    detections, beads = [], []
    for shot in shots:
        if number not in shot.images:
            # Without noise, frames of resting beads are identical, and duplicates are dropped.
            continue
        detected = detector.detect(shot.images[number].color)[index]
        truth = shot.truth[number]
        bead_indices = np.flatnonzero(truth.species == index)
        rows, columns = _pairs(
            truth.positions[bead_indices, :2],
            detected.positions / SCALE,
            0.6 * float(truth.radii[bead_indices].min()),
        )
        bead = np.full(detected.radii.size, -1)
        bead[columns] = bead_indices[rows]
        detections.append(detected)
        beads.append(bead)
    return detections[_WARM_UP // 3 :], beads[_WARM_UP // 3 :]


def _link_ours(detections: list[Detections], number: int, index: int) -> list[NDArray[np.int64]]:
    tray, settings = load_trays()[number], TrackingSettings()
    size = (tray.dimensions[0] * SCALE, tray.dimensions[1] * SCALE)
    linker = Linker(
        tray.species[index].count,
        size,
        settings.max_speed * SCALE,
        settings.memory,
        settings.window,
        FlightDeviations(0.5 * tray.species[index].diameter * SCALE),
    )
    first, numbers = 0, []
    for k, frame_detections in enumerate(detections):
        first += linker.push(k / RATE, frame_detections, np.zeros(2), first)
        places, _ = linker.positions()
        current = linker.last_seen == k / RATE
        identities = np.full(frame_detections.radii.size, -1)
        apart = cdist(frame_detections.positions, places[current])
        nearest = apart.argmin(axis=1)
        same = apart[np.arange(apart.shape[0]), nearest] == 0.0
        identities[same] = linker.ids[current][nearest[same]]
        numbers.append(identities)
    return numbers


def _link_trackpy(
    detections: list[Detections], number: int, index: int, diameters: float
) -> list[NDArray[np.int64]]:
    import pandas as pd
    import trackpy

    trackpy.quiet()
    tray = load_trays()[number]
    reach = diameters * tray.species[index].diameter * SCALE
    frames = np.repeat(
        np.arange(len(detections)),
        [frame_detections.radii.size for frame_detections in detections],
    )
    places = np.concatenate([frame_detections.positions for frame_detections in detections])
    table = pd.DataFrame({'frame': frames, 'x': places[:, 0], 'y': places[:, 1]})
    predictor = trackpy.predict.NearestVelocityPredict()
    linked = predictor.link_df(table, search_range=reach, memory=int(RATE))
    numbers = linked.sort_index()['particle'].to_numpy()
    return np.split(
        numbers, np.cumsum([frame_detections.radii.size for frame_detections in detections])[:-1]
    )


def _judge(
    numbers: list[NDArray[np.int64]], beads: list[NDArray[np.int64]]
) -> tuple[float, float, float]:
    """Right over possible links, wrong over made links, switches per bead and minute."""
    links_possible = right = links_made = switches = 0
    last_number: dict[int, int] = {}
    before: tuple[dict[int, int], dict[int, int]] = ({}, {})
    for row, bead in zip(numbers, beads, strict=True):
        of_bead = {int(b): int(n) for n, b in zip(row, bead, strict=True) if b >= 0}
        of_number = {int(n): int(b) for n, b in zip(row, bead, strict=True) if n >= 0}
        links_possible += len(of_bead.keys() & before[0].keys())
        right += sum(
            before[0].get(b) == n and n >= 0 for b, n in of_bead.items() if b in before[0]
        )
        links_made += len(of_number.keys() & before[1].keys())
        switches += sum(last_number.get(b, n) != n for b, n in of_bead.items() if n >= 0)
        last_number.update({b: n for b, n in of_bead.items() if n >= 0})
        before = of_bead, of_number
    minutes = len(last_number) * len(numbers) / RATE / 60.0
    return right / links_possible, 1.0 - right / max(links_made, 1), switches / minutes


def _report_cost(shots: list[Shot]) -> None:
    """Print CPU time of the trackers, against decoding the same frames."""
    start = time.process_time()
    image = None
    for shot in shots:
        # Kept until the next frame: allocating its memory again takes as long as decoding.
        image = cv2.imdecode(shot.jpeg, cv2.IMREAD_COLOR)
    del image
    decoding = (time.process_time() - start) / len(shots)
    print('\n| tray | ms per frame | / decoding the JPEG of the frame |')
    print('| --- | --- | --- |')
    total = 0.0
    for number in _TRAYS:
        settings = with_values(
            PipelineSettings(), {'preprocess.pixels_per_metre': SCALE}, 'benchmark'
        )
        tracker = Tracker(settings, load_trays()[number])
        images = [shot.images[number] for shot in shots if number in shot.images]
        for image in images[:_WARM_UP]:
            tracker.push(image)
        start = time.process_time()
        for image in images[_WARM_UP:]:
            tracker.push(image)
        cost = (time.process_time() - start) / (len(images) - _WARM_UP)
        total += cost
        print(f'| {number} | {1e3 * cost:.2f} | {cost / decoding:.2f} |')
    print(f'| all | {1e3 * total:.2f} | {total / decoding:.2f} |')


def report() -> None:
    """Print the tables."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        shots, film = filmed(7e-3, effects=True, frames=_FRAMES)
        _report_counts(shots, film)
        _report_cost(shots)
        _report_links()
    finally:
        cv2.setNumThreads(threads)
