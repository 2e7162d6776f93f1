"""Rotation: energy of rough beads, and its effect on speeds and inferred restitutions.

Tangential restitution β, coefficient of friction μ (without μ contacts never slide); the same at
walls and between beads unless stated. ``docs/method/rotation.md`` has the conclusions.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from benchmarks import rough_gas as gas
from benchmarks import rough_sharing as energy
from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.rough_spheres import (
    SOLID_SPHERE,
    rms_spin,
    rough_temperature_ratio,
    smooth_equivalent,
    temperature_ratio_course,
)

SEEDS = range(8)
BULK = ((0.89, -0.5), (0.89, 0.0), (0.89, 0.5), (0.7, 0.0))
SHARING = {1: 120, 3: 40}
SHARING_TIMES = np.array([0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0])
STEP = 0.1
TIMES = np.arange(0.5, 30.0, STEP)
# Cycles in a mean, as in the paper.
TOGETHER = 178
RUNS = 8 * TOGETHER
NOISE = 1e-4
EDGES = np.array([1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 20.0]) * 1e-3
CASES = (gas.SMOOTH, gas.BEADS, gas.RUBBING, gas.SMOOTH_WALLS)
CYCLES = 6
# Mean projected speed and decay rate of tray 1, from T0 and tau0 of the paper.
PAPER_SPEED, PAPER_RATE = 5.25e-3, 117.0
FRICTIONS = (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.15)
RATE, PIXELS = 30.0, 12500.0
# Error of a displacement of texture between two frames.
SEEN_PX = 0.1


def report():
    """Print all tables."""
    _bulk()
    _sharing()
    _single()
    _paper_estimate()
    _local()
    _camera()
    _bias()
    _friction()


def _table(title, *head):
    print(f'\n{title}\n\n| ' + ' | '.join(head) + ' |\n' + '| --- ' * len(head) + '|')


def _row(*cells):
    print('| ' + ' | '.join(str(cell) for cell in cells) + ' |', flush=True)


def _bulk():
    _table(
        'Rotation over translation in a periodic box, 500 beads, filling factor 0.05',
        'e, β', 'after 10 collisions of each bead: simulated', 'theory', '20', 'theory', '30',
        'theory', 'in the end', 'a smooth restitution that cools alike',
    )  # fmt: skip
    for restitution, tangential in BULK:
        collisions, ratio = energy.bulk_course(restitution, tangential, SEEDS)
        cells = []
        for collision_count in (10.0, 20.0, 30.0):
            theory = temperature_ratio_course(
                np.array([collision_count]), restitution, tangential
            )[0]
            simulated = (
                np.interp(collision_count, collisions, ratio)
                if collision_count <= collisions[-1]
                else math.nan
            )
            cells += [f'{simulated:.3f}', f'{theory:.3f}']
        final = rough_temperature_ratio(restitution, tangential)
        alike = smooth_equivalent(restitution, tangential)
        _row(f'{restitution:g}, {tangential:g}', *cells, f'{final:.3f}', f'{alike:.3f}')


def _sharing():
    rows = []
    _table(
        'The same in trays 1 and 3, from no rotation; last: after a really shaken start',
        'tray, beads', 'species', *(f'{time:g} s' for time in SHARING_TIMES[1:]), 'shaken, at 0 s',
    )  # fmt: skip
    for number, runs in SHARING.items():
        for rough in gas.ROUGH:
            shares = energy.sharing(number, rough, SHARING_TIMES, runs)
            shaken = energy.sharing(number, rough, SHARING_TIMES[:1], runs, speeds='shaken')
            for k, species in enumerate(load_trays()[number].species):
                values = [*shares.ratio[k, 1:], shaken.ratio[k, 0]]
                name = f'{number}, {rough.name}'
                _row(name, species.material, *(f'{value:.2f}' for value in values))
                upright = shares.upright_flight[k, 1:], shares.upright_spin[k, 1:]
                cells = [f'{a:.1f}, {b:.2f}' for a, b in zip(*upright, strict=True)]
                rows.append((name, species.material, *cells))
    _table(
        'Mean square of velocity along z over that along x and y, and part of the rotation that '
        'is about z',
        'tray, beads', 'species', *(f'{time:g} s' for time in SHARING_TIMES[1:]),
    )  # fmt: skip
    for row in rows:
        _row(*row)


def _single():
    _table(
        'Single collisions of beads of 0.89: relative speed after over before, at any speed',
        'beads', 'rotation over translation', '2.5 %', '16 %', '84 %', '97.5 %', 'above 1',
    )  # fmt: skip
    for rough in (gas.SMOOTH, gas.BEADS, gas.RUBBING, gas.HALF):
        for ratio in (0.0, 0.3, 1.0):
            ratios = energy.single_collisions(gas.PAIRS, rough, ratio)
            quantiles = np.quantile(ratios, (0.025, 0.16, 0.84, 0.975))
            _row(
                rough.name,
                ratio,
                *(f'{quantile:.2f}' for quantile in quantiles),
                f'{np.mean(ratios > 1.0):.3f}',
            )


def estimate_cases():
    """Name, number of curves in a mean, noise of a cycle and of the mean [m/s]."""
    return (
        ('1 cycle', 1, 0.0, 0.0),
        ('1 cycle, noise', 1, NOISE, 0.0),
        (f'{TOGETHER} cycles', TOGETHER, 0.0, 0.0),
        (f'{TOGETHER} cycles, noise of each', TOGETHER, NOISE, 0.0),
        (f'{TOGETHER} cycles, noise of the mean', TOGETHER, 0.0, NOISE),
    )


def curves(speeds, cycles, noise, common, seed=1):
    """Means over groups of runs, with noise on each run and on the mean, (n_curves, n_times)."""
    random = np.random.default_rng(seed)
    noisy = speeds + noise * random.normal(size=speeds.shape)
    means = noisy.reshape(-1, cycles, speeds.shape[1]).mean(axis=1)
    return means + common * random.normal(size=means.shape)


def _paper_estimate():
    tray = load_trays()[1]
    names = [f'{1e3 * low:g} to {1e3 * high:g} mm/s' for low, high in pairwise(EDGES)]
    _table(
        "The paper's instantaneous restitution in tray 1, speeds 1 s apart, noise 0.1 mm/s: "
        'median ± half of the middle 68 % (share above 1), by collision speed',
        'beads', 'speeds', *names, '97.5 % at 1 to 2', 'width as speed to the power',
    )  # fmt: skip
    for rough in CASES:
        speeds = gas.speeds_of(1, rough, TIMES, RUNS)
        for name, cycles, noise, common in estimate_cases():
            values, speed = gas.paper_values(curves(speeds, cycles, noise, common), STEP, tray)
            median, half, above, highest, logs = gas.spread(values, speed, EDGES)
            cells = [
                f'{value:.2f} ± {half_width:.3f} ({share:.2f})' if np.isfinite(value) else ''
                for value, half_width, share in zip(median, half, above, strict=True)
            ]
            middle = np.log(EDGES[:-1] * EDGES[1:]) / 2.0
            finite = np.isfinite(logs)
            power = np.polyfit(middle[finite], np.log(logs[finite]), 1)[0]
            _row(rough.name, name, *cells, f'{highest[0]:.3g}', f'{power:+.2f}')


def _local():
    theory = confined_gas(load_trays()[1])
    _table(
        f'Ours in tray 1, mean of {TOGETHER} cycles, 0.5 to 20 s, 0.5 mm/s or faster: slope of '
        '1/v in four windows',
        'beads', 'noise of the mean', 'collision speeds [mm/s]', 'slopes [1/m] ± scatter',
        'restitutions',
    )  # fmt: skip
    for rough in CASES:
        speeds = gas.speeds_of(1, rough, TIMES, RUNS)
        # Slower speeds are below the noise.
        inside = (TIMES <= 20.0) & (speeds.mean(axis=0) > 5.0 * NOISE)
        for noise in (0.0, NOISE):
            means_of_cycles = curves(speeds[:, inside], TOGETHER, 0.0, noise)
            speed, slopes = gas.local_rates(means_of_cycles, TIMES[inside])
            means = slopes.mean(axis=0)
            slope_cells = [
                f'{a:.0f} ± {b:.1f}'
                for a, b in zip(means, slopes.std(axis=0, ddof=1), strict=True)
            ]
            speed_cells = [f'{2e3 * value:.2g}' for value in speed]
            restitutions = [_restitution(theory, mean) for mean in means]
            label = '0.1 mm/s' if noise else 'none'
            _row(
                rough.name,
                label,
                ', '.join(speed_cells),
                ', '.join(slope_cells),
                ', '.join(restitutions),
            )


def _restitution(theory, rate):
    try:
        return f'{theory.restitution(float(rate), gas.WALLS):.3f}'
    except FitError:
        return 'none'


def _camera():
    _table(
        'What a camera at 30 Hz and 12.5 px/mm sees of equipartition',
        'mean projected speed [mm/s]', 'bead [mm]', 'flies [px/frame]', 'spin [degrees/s]',
        'degrees/frame', 'surface [px/frame]', 'frames for half a turn',
    )  # fmt: skip
    for diameter in (0.002, 0.001):
        for speed in (0.010, 0.005, 0.001):
            spin = rms_spin(speed, diameter)
            turn = math.degrees(spin) / RATE
            surface = 0.5 * spin * diameter * PIXELS / RATE
            _row(
                f'{1e3 * speed:g}', f'{1e3 * diameter:g}', f'{speed * PIXELS / RATE:.2f}',
                f'{math.degrees(spin):.0f}', f'{turn:.1f}', f'{surface:.2f}', f'{180 / turn:.0f}',
            )  # fmt: skip
    error = math.degrees(SEEN_PX / (0.5 * 0.002 * PIXELS))
    alike = math.radians(error * RATE) * 1e-3 * math.sqrt(SOLID_SPHERE)
    print(
        f'\nTexture followed to {SEEN_PX:g} px tells {error:.2f} degrees between two frames of a '
        f'2 mm bead: the spin, in equipartition, of beads that fly at {1e3 * alike:.2f} mm/s.'
    )


def _bias():
    _table(
        f'What is read where beads are taken for smooth: truth 0.89 and 0.97, {CYCLES} cycles '
        'together',
        'tray, beads', 'decay rate [1/m]', 'beads, walls known', 'by decay: beads', 'walls',
        'with contacts: beads', 'walls', 'contacts alone: beads', 'walls',
        'tension: of a cycle, of all', 'rebounds, collisions in a cycle',
    )  # fmt: skip
    for number in (1, 3):
        for rough in (gas.SMOOTH, *gas.ROUGH):
            read, numbers = gas.read_cycles(number, rough, CYCLES)
            rate, tension, rebounds, collisions, *alone = numbers
            means = [read['walls known'].mean[0], *read['decay'].mean, *read['all'].mean, *alone]
            _row(
                f'{number}, {rough.name}', f'{rate:.0f}', *(f'{mean:.3f}' for mean in means),
                f'{tension:.1f}, {read["all"].tension:.1f}', f'{rebounds:.0f}, {collisions:.0f}',
            )  # fmt: skip


def _friction():
    _table(
        'Decay rate of tray 1 against friction: β 0.4, from a mean projected speed of '
        f'{1e3 * PAPER_SPEED:g} mm/s, Haff fitted from 0.5 to 20 s',
        'μ', 'decay rate [1/m], walls as rough as beads', 'smooth walls',
    )  # fmt: skip
    rates = {
        walls: [friction_rate(friction, walls) for friction in FRICTIONS]
        for walls in (True, False)
    }
    for k, friction in enumerate(FRICTIONS):
        _row(friction, f'{rates[True][k]:.0f}', f'{rates[False][k]:.0f}')
    same = np.interp(PAPER_RATE, rates[True], FRICTIONS)
    print(f"\nThe paper's {PAPER_RATE:g}/m, without anything that sticks: μ = {same:.3f}")


def friction_rate(friction, walls):
    """Decay rate of tray 1, [1/m]."""
    times = np.arange(0.5, 20.0, 0.1)
    rough = gas.Roughness(tangential=0.4, friction=friction, walls=walls)
    start = PAPER_SPEED * 4.0 / math.pi
    mean = gas.speeds_of(1, rough, times, 120, mean_speed=start).mean(axis=0)
    return gas.haff_rate(times, mean)
