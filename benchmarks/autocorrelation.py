"""The autocorrelation: cost against scipy, sizes against the truth, systematics, controls.

Preprocessed films of the whole plate with all effects and JPEG 85, of gases that are not in the
calibration.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.signal import fftconvolve

from benchmarks.films import filmed
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.cluster_size.cluster_curve import curve_of
from nanorocks_ros.inference.cluster_size.size_from_width import INNER_LEVEL, Width
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.physics.autocorrelation import autocorrelation, level_region
from nanorocks_ros.physics.paper_clusters import paper_calibration, paper_onset
from nanorocks_ros.records import SizeStatus
from nanorocks_ros.stages.clusters.background_removal import tray_contrast
from nanorocks_ros.stages.clusters.correlation_width import correlated
from nanorocks_ros.studies.libraries.cluster_films import (
    EFFECTS,
    TIMES,
    ClusterPlan,
    ClusterRun,
    drawn_run,
    filmed_run,
)

_ALL = (1, 2, 3, 4, 5, 6, 7, 8)
_TRAYS = (1, 3, 5)
_SCALE = 12500.0
_LEVEL = 0.5
_ROUNDS = 15
_SEED = 977
_SPEEDS = (1e-3, 3e-3, 5e-3, 10.4e-3)
_RUNS = 5
_FILLINGS = (0.5, 0.75, 1.25)
_CONTROLS = 17
_CONTROL_TIMES = tuple(0.2 * k for k in range(1, 21))
_COUNTS = dict.fromkeys(_ALL, 1.0)
# Limits of the sizes for which offsets are compared, [beads]; below the first all are single.
_SIZES = (1.1, 1.5, 2.5, 5.0, 10.0, 20.0, 80.0)
_FEWEST_IMAGES = 20
_FLIGHT = dict.fromkeys(EFFECTS, 1.0)


@dataclass(frozen=True)
class _Film:
    """The task of one film."""

    trays: tuple[int, ...]
    run: int
    drawn: ClusterRun
    times: tuple[float, ...] = TIMES


def report() -> None:
    """Print the tables."""
    _cost()
    films = _films()
    samples = dict(zip(films, run_tasks(_filmed, films, Workers()), strict=True))
    _sizes(samples)
    _fillings(samples)
    _effects()
    _offsets()
    _controls(samples)


def _films() -> dict[str, _Film]:
    flight = ClusterRun(sticking_speed=0.0, strengths=_FLIGHT, counts=_COUNTS)
    sticking = {
        f'{speed} {run}': _Film(_ALL, run, replace(flight, sticking_speed=speed))
        for speed in _SPEEDS
        for run in range(_RUNS)
    }
    fillings = {
        f'{part} {speed} {run}': _Film(
            _TRAYS,
            run,
            replace(flight, sticking_speed=speed, counts=dict.fromkeys(_ALL, part)),
        )
        for part in _FILLINGS
        for speed in (1e-3, 3e-3)
        for run in range(_RUNS // 2)
    }
    controls = {
        f'control {run}': _Film(_TRAYS, 100 + run, flight, _CONTROL_TIMES)
        for run in range(_CONTROLS)
    }
    return {**sticking, **fillings, **controls}


def _filmed(film: _Film) -> np.ndarray:
    plan = ClusterPlan(cells=load_trays(), trays=film.trays, runs=1, seed=_SEED, level=_LEVEL)
    return filmed_run(plan, film.run, film.drawn, film.times).astype(np.float64)


def _milliseconds(work, images) -> float:
    best = np.inf
    for _ in range(_ROUNDS):
        start = time.process_time()
        for image in images:
            work(image)
        best = min(best, time.process_time() - start)
    return 1e3 * best


def _by_scipy(image: np.ndarray) -> np.ndarray:
    deviation = image - image.mean()
    return fftconvolve(deviation, deviation[::-1, ::-1])


def _measured(image: np.ndarray, scale: float) -> None:
    correlation = correlated(image, scale)
    correlation.width(correlation.region(_LEVEL).area)


def _cost() -> None:
    shots, _ = filmed(5e-3, effects=True, frames=25, trays=_ALL)
    images = [image.gray for image in shots[-1].images.values()]
    fine = [tray_contrast(image, halve=False) for image in images]
    half = [tray_contrast(image, halve=True) for image in images]
    scipy_fine = _milliseconds(_by_scipy, [image.astype(np.float64) for image in fine])
    rows = {
        'scipy.signal.fftconvolve, float64': scipy_fine,
        'the same, float32': _milliseconds(_by_scipy, fine),
        'ours': _milliseconds(autocorrelation, fine),
        'ours, half the resolution': _milliseconds(autocorrelation, half),
        'ours, whole stage: contrast, autocorrelation, areas, axes': _milliseconds(
            lambda image: _measured(image, _SCALE), images
        ),
        'the same without halving': _milliseconds(lambda image: _measured(image, 8000.0), images),
    }
    print(
        '| eight trays of a 1080p frame, one core | ms | fftconvolve / it |\n| --- | --- | --- |'
    )
    for name, milliseconds in rows.items():
        print(f'| {name} | {milliseconds:.2f} | {scipy_fine / milliseconds:.1f} |')
    deviations, area_ratios = [], []
    for image, small in zip(fine, half, strict=True):
        full = _by_scipy(image.astype(np.float64))
        rows_, columns = image.shape
        top, left = rows_ - 1 - rows_ // 2, columns - 1 - columns // 2
        exact = full[top : top + rows_, left : left + columns] / full[rows_ - 1, columns - 1]
        values = autocorrelation(image)
        deviations.append(np.abs(values - exact).max())
        area = level_region(values, _LEVEL).area
        area_ratios.append(4.0 * level_region(autocorrelation(small), _LEVEL).area / area)
    print(f'\nlargest difference from fftconvolve: {max(deviations):.1e}')
    print(
        'level area at half the resolution over that at all of it: '
        f'{min(area_ratios):.3f} to {max(area_ratios):.3f} '
        '(the calibration is made at half, too)\n'
    )


def _read(curve, rows: np.ndarray):
    """Estimates of rows of samples: size, lower and upper limit, status."""
    estimates = [curve.size_of(Width(*row)) for row in rows[:, 4:8]]
    sizes = np.array([[estimate.size, estimate.lower, estimate.upper] for estimate in estimates]).T
    return *sizes, np.array([estimate.status for estimate in estimates])


def _of(samples: dict[str, np.ndarray], start: str, tray: int) -> list[np.ndarray]:
    return [
        rows[rows[:, 0] == tray] for name, rows in samples.items() if name.startswith(f'{start} ')
    ]


def _sizes(samples: dict[str, np.ndarray]) -> None:
    flown = load_trays()
    print('weight-averaged cluster size, single pictures from 0.4 to 32 s after shaking\n')
    print(
        '| tray | sticking [mm/s] | true, first to last | measured | estimate / true, median '
        '(16 to 84 %) | in the interval | only a limit | no size | paper / true |'
    )
    print('| --- |' * 1 + ' --- |' * 8)
    for tray in _ALL:
        curve = curve_of(flown[tray])
        for speed in _SPEEDS:
            runs = _of(samples, f'{speed}', tray)
            rows = np.concatenate(runs)
            size, lower, upper, status = _read(curve, rows)
            paper = _by_paper(runs)
            true = rows[:, 3]
            known = np.isfinite(size)
            limited = np.isfinite(lower)
            ratio = '-'
            if known.any():
                low, middle, high = np.percentile(size[known] / true[known], (16, 50, 84))
                ratio = f'{middle:.2f} ({low:.2f} to {high:.2f})'
            covered = '-'
            if limited.any():
                inside = (lower <= true * 1.001) & (true <= upper * 1.001)
                covered = f'{inside[limited].mean():.2f}'
            first, last = (np.mean([run[k, 3] for run in runs]) for k in (0, -1))
            beyond = np.mean(status == SizeStatus.BEYOND)
            print(
                f'| {tray} | {1e3 * speed:g} | {first:.1f} to {last:.1f} | {known.mean():.2f} | '
                f'{ratio} | {covered} | {beyond:.2f} | {np.mean(~limited):.2f} | '
                f'{np.median(paper / true):.2f} ({np.percentile(paper / true, 84):.2f}) |'
            )
    print(
        '\npaper: its straight line through the last pictures and their true size; median, and '
        '84th percentile\n'
    )


def _by_paper(runs: list[np.ndarray]) -> np.ndarray:
    """Sizes by the paper's linear calibration at the end of the same runs."""
    ends = np.array([run[-1] for run in runs])
    line = paper_calibration(ends[:, 4], float(ends[:, 3].mean()))
    return line.size(np.concatenate(runs)[:, 4])


def _fillings(samples: dict[str, np.ndarray]) -> None:
    flown = load_trays()
    print(
        'with another number of beads than the calibration: share of pictures with a size, median '
        'of estimate / true\n'
    )
    print('| tray | ' + ' | '.join(f'{part:g} of the beads' for part in _FILLINGS) + ' |')
    print('| --- |' + ' --- |' * len(_FILLINGS))
    for tray in _TRAYS:
        curve = curve_of(flown[tray])
        cells = []
        for part in _FILLINGS:
            rows = np.concatenate(
                [
                    samples_of_run
                    for speed in (1e-3, 3e-3)
                    for samples_of_run in _of(samples, f'{part} {speed}', tray)
                ]
            )
            size, lower, upper, _ = _read(curve, rows)
            measured = np.isfinite(size)
            limited = np.isfinite(lower)
            inside = ((lower <= rows[:, 3]) & (rows[:, 3] <= upper))[limited]
            inside = inside if limited.any() else np.array([np.nan])
            ratio = np.median(size[measured] / rows[measured, 3]) if measured.any() else np.nan
            cells.append(
                f'{measured.mean():.2f} measured, {ratio:.2f}, in the interval {inside.mean():.2f}'
            )
        print(f'| {tray} | ' + ' | '.join(cells) + ' |')
    print()


def _effects() -> None:
    """Print the effect of the strengths on the width, from the samples of the calibration."""
    flown = load_trays()
    print('reading of the calibration, in its own scatter, for each effect from none to flight')
    print('(ln(breadth) + weight ln(area)); beside it the same for ln(area) alone\n')
    print('| tray | ' + ' | '.join(EFFECTS) + ' | 5 % more beads | scatter between runs |')
    print('| --- |' * 1 + ' --- |' * (len(EFFECTS) + 2))
    for tray in (1, 3, 5, 7):
        curve = curve_of(flown[tray])
        rows = curve.samples.astype(np.float64)
        runs = rows[:, 0].astype(int)
        plan = ClusterPlan(cells=flown, trays=_ALL, runs=int(runs.max()) + 1)
        drawn = [drawn_run(plan, run) for run in range(plan.runs)]
        strengths = np.array(
            [
                [run.strengths[name] for name in EFFECTS] + [20.0 * run.counts[tray]]
                for run in drawn
            ]
        )
        area = np.log(rows[:, 3])
        cells, shares = [], []
        for read in (np.log(rows[:, 3] / rows[:, 4]) + curve.weight * area, area):
            slopes, share = _slopes(np.log(rows[:, 2]), read, strengths[runs], runs)
            cells.append(slopes)
            shares.append(share)
        pairs = ' | '.join(
            f'{slope:+.2f}, {area_slope:+.2f}' for slope, area_slope in zip(*cells, strict=True)
        )
        print(f'| {tray} | {pairs} | {shares[0]:.2f}, {shares[1]:.2f} |')
    print()


def _slopes(log_size, read, strengths, runs):
    """Slopes against strengths in units of the scatter, and the scatter between runs."""
    terms = np.polynomial.polynomial.polyvander(log_size, 4)
    residual = read - terms @ np.linalg.lstsq(terms, read, rcond=None)[0]
    sd = residual.std()
    centred = strengths - strengths.mean(axis=0)
    slopes = np.linalg.lstsq(centred, residual, rcond=None)[0] / sd
    means = np.array([residual[runs == run].mean() for run in np.unique(runs)])
    return slopes, means.std() / sd


def _offsets() -> None:
    """Print what the offset of single beads tells of clusters, from the calibration's samples."""
    print('readings about the curve, before and after the mean offset of single beads of the same')
    print('film is subtracted, standard deviation, and the part of the offset that they share\n')
    bins = ' | '.join(f'{low:g} to {high:g} beads' for low, high in pairwise(_SIZES))
    print(f'| tray | films | {bins} |\n| --- | --- |' + ' --- |' * (len(_SIZES) - 1))
    shares = []
    for tray in (1, 3, 5, 7):
        curve = curve_of(load_trays()[tray])
        rows = curve.samples.astype(np.float64)
        runs, size = rows[:, 0].astype(int), rows[:, 2]
        read = np.log(rows[:, 3] / rows[:, 4]) + curve.weight * np.log(rows[:, 3])
        residual = read - np.interp(np.log(size), curve.log_size, curve.reading)
        single = size < _SIZES[0]
        offsets = {run: residual[single & (runs == run)].mean() for run in set(runs[single])}
        offset = np.array([offsets.get(run, np.nan) for run in runs])
        cells = []
        for low, high in pairwise(_SIZES):
            chosen = (low <= size) & (size < high) & np.isfinite(offset)
            if chosen.sum() < _FEWEST_IMAGES:
                cells.append('-')
                continue
            other, known = residual[chosen], offset[chosen]
            share = known @ (other - other.mean()) / (known @ known)
            shares.append(share)
            cells.append(f'{other.std():.3f}, {(other - known).std():.3f}, {share:.2f}')
        print(f'| {tray} | {len(offsets)} | ' + ' | '.join(cells) + ' |')
    print(f'\nshare: mean {np.mean(shares):.2f}, scatter {np.std(shares, ddof=1):.2f}\n')


def _controls(samples: dict[str, np.ndarray]) -> None:
    flown = load_trays()
    print('controls, in which nothing sticks: 4 s after shaking, five pictures a second\n')
    print(
        "| tray | runs | the paper's onset fires | at, median [s] | pictures read as more than 2 "
        'beads, lower limit |\n| --- | --- | --- | --- | --- |'
    )
    for tray in _TRAYS:
        runs = _of(samples, 'control', tray)
        onsets = np.array([paper_onset(run[:, 2], run[:, 4]) for run in runs])
        _, lower, _, _ = _read(curve_of(flown[tray]), np.concatenate(runs))
        fired = np.isfinite(onsets)
        print(
            f'| {tray} | {len(runs)} | {fired.sum()} of {len(runs)} | '
            f'{np.median(onsets[fired]):.1f} | {np.mean(lower > 2.0):.3f} |'
        )
    print(f'\ninner level of the breadth: {INNER_LEVEL:g}')
