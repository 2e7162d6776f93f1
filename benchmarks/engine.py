"""The event-driven engine: collisions per second, memory, cost of features, other programs."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.engine_peers import report_peers
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import Kernel
from nanorocks_ros.simulation.engine.neighbours import list_tuning
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import UniformRestitution
from nanorocks_ros.simulation.ensemble import cooling_runs

# Collisions per bead before the measurement, in which the crystal melts.
MELT = 8
SIZES = 15, 55, 100, 800, 10_000, 100_000, 1_000_000
# Collisions that take about a second and a half.
WORK = 1_000_000
SHORT = 200_000
# Number density times cubed diameter: half of a liquid, and a filling factor of 0.1.
DENSE = 0.5
DILUTE = 0.1 * 6.0 / np.pi


@dataclass(frozen=True)
class Rate:
    n: int
    collisions: float  # per second
    events: float  # per second, with collisions at walls
    bytes_per_bead: float


def crystal(n: int, density: float) -> tuple[np.ndarray, float]:
    """Positions of a face-centred crystal of n unit spheres with vacancies, and its side."""
    cells = int(np.ceil((n / 4.0) ** (1.0 / 3.0)))
    side = (n / density) ** (1.0 / 3.0)
    base = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    corners = np.array(list(np.ndindex(cells, cells, cells)))
    places = (corners[:, np.newaxis] + base).reshape(-1, 3)
    chosen = np.sort(np.random.default_rng(1).permutation(len(places))[:n])
    return places[chosen] / cells, side


def gas_of(
    n: int, density: float, *, periodic: bool, kernel: Kernel = Kernel.AUTOMATIC, **rules: object
) -> HardSphereGas:
    """Unit spheres of unit mass at temperature 1."""
    places, side = crystal(n, density)
    if not periodic:
        room = side - 1.0
        spread = places.max(axis=0)
        places = 0.5 / side + places / spread * room / side
    velocities = np.random.default_rng(2).normal(size=(n, 3))
    beads = Beads(
        radii=np.full(n, 0.5),
        masses=np.ones(n),
        positions=(places * side) % side if periodic else places * side,
        velocities=velocities - velocities.mean(axis=0),
    )
    box = CollisionRules(box=(side,) * 3, periodic=(periodic,) * 3, contact_duration=0.0, **rules)
    return HardSphereGas(beads, box, kernel)


def mean_free_time(density: float) -> float:
    """Mean free time of unit spheres at temperature 1 (Enskog, Carnahan-Starling)."""
    filling = density * np.pi / 6.0
    contact = (1.0 - 0.5 * filling) / (1.0 - filling) ** 3
    return 1.0 / (4.0 * np.sqrt(np.pi) * density * contact)


def measured(gas: HardSphereGas, density: float, work: int = WORK) -> Rate:
    """Rates of a gas, after it has melted."""
    n = gas.radii.size
    step = mean_free_time(density)
    gas.run_until(MELT * step)
    before = gas.counts
    span = step * max(2.0, 2.0 * work / n)
    start = time.process_time()
    gas.run_until(gas.now + span)
    seconds = time.process_time() - start
    after = gas.counts
    pairs = after.pair - before.pair
    walls = after.wall - before.wall
    return Rate(n, pairs / seconds, (pairs + walls) / seconds, gas.bytes_per_bead)


def report() -> None:
    """Print all tables."""
    report_sizes()
    report_kernels()
    report_shell()
    report_features()
    report_runs()
    report_search()
    report_peers(lambda n: measured(gas_of(n, DENSE, periodic=True), DENSE).collisions)


def report_sizes() -> None:
    """Print rates and memory against the number of beads, and the exponent of the cost."""
    print('unit spheres, constant restitution 1; millions of events a second, one core\n')
    print('        N   periodic, n = 0.5   six walls, phi = 0.1   bytes a bead')
    rates = []
    for n in SIZES:
        inside = measured(gas_of(n, DILUTE, periodic=False), DILUTE)
        around = measured(gas_of(n, DENSE, periodic=True), DENSE) if n > 15 else None
        periodic_rate = f'{around.events / 1e6:17.3f}' if around else ' ' * 17
        print(
            f'{n:9d}   {periodic_rate}   {inside.events / 1e6:20.3f}   '
            f'{inside.bytes_per_bead:12.0f}'
        )
        if around and n >= 100:
            rates.append((n, around.events))
    sizes, events = np.log(np.array(rates)).T
    slope = np.polyfit(sizes, -events, 1)[0]
    print(f'\ncost of an event grows as N^{slope:.2f} from N = 100 to 1000000\n')


def report_kernels() -> None:
    """Print the number of beads above which neighbour lists are faster than a scan."""
    print('        N   scan / lists, walls   periodic   (events a second, ratio)')
    for n in (15, 30, 40, 55, 80, 120):
        ratios = []
        for density, periodic in ((DILUTE, False), (DENSE, True)):
            if periodic and n < 30:
                ratios.append(np.nan)
                continue
            scan, lists = (
                measured(
                    gas_of(n, density, periodic=periodic, kernel=kernel), density, SHORT
                ).events
                for kernel in (Kernel.SCAN, Kernel.LISTS)
            )
            ratios.append(scan / lists)
        print(f'{n:9d}   {ratios[0]:19.2f}   {ratios[1]:8.2f}')
    print()


def report_features() -> None:
    """Print the cost of roughness and sticking that are on without effect."""
    print('time per event with a feature on, over the time with none (median of five pairs)\n')
    features = {
        'rough spheres': {'tangential_restitution': 1.0, 'wall_tangential_restitution': 1.0},
        'sticking, at a speed that never occurs': {
            'sticking_speed': 1e-12,
            'aggregate_motion': 'translating',
        },
        'both': {
            'tangential_restitution': 1.0,
            'sticking_speed': 1e-12,
            'aggregate_motion': 'translating',
        },
        'restitution drawn at random': {'restitution': UniformRestitution(mean=1.0, width=0.0)},
    }
    for name, rules in features.items():
        medians = []
        for n in (15, 1000):
            ratios = []
            for _ in range(5):
                plain = measured(gas_of(n, DILUTE, periodic=False), DILUTE, SHORT).events
                with_it = measured(
                    gas_of(n, DILUTE, periodic=False, **rules), DILUTE, SHORT
                ).events
                ratios.append(plain / with_it)
            medians.append(float(np.median(ratios)))
        print(f'{name:40s} N = 15: {medians[0]:.2f}   N = 1000: {medians[1]:.2f}')
    print()


def report_runs() -> None:
    """Print the time of the paper's 178 runs, and of a search over 40 x 40 points of them."""
    settings = SimulationSettings()
    tray = tray_by_number(load_trays(), 1)
    times = np.linspace(0.0, 30.0, 301)
    cooling_runs(settings, tray, times, range(2))
    seconds = []
    for _ in range(3):
        start = time.process_time()
        cooling_runs(settings, tray, times, range(178))
        seconds.append(time.process_time() - start)
    print('178 runs of tray 1, 30 s each with 301 samples, placement and speeds included:')
    print(f'{np.median(seconds):.3f} CPU s')


def report_search() -> None:
    """Print the time of the paper's search for the two restitutions, on all cores."""
    grid = ['--restitution', '0.6:0.98:40', '--wall-restitution', '0.6:0.99:40']
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder, 'search.npz')
        code = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'
        command = [sys.executable, '-c', code, 'sweep', *grid]
        start = time.perf_counter()
        subprocess.run(
            [*command, '--runs', '178', '--times', '0:30:31', '-o', str(output)], check=True
        )
        seconds = time.perf_counter() - start
    cores = len(os.sched_getaffinity(0))
    print(f'search, 40 x 40 restitutions x 178 runs of 30 s: {seconds:.0f} s on {cores} cores\n')


def report_shell() -> None:
    """Print the effect of a shell centre ahead of the bead."""
    print('centre of a new shell ahead of its bead, in radii of the shell; N = 1000\n')
    default = list_tuning.AHEAD_OF_BEAD
    for density in (DILUTE, DENSE):
        results = []
        for ahead in (0.0, 0.4, default):
            list_tuning.AHEAD_OF_BEAD = ahead
            gas = gas_of(1000, density, periodic=True)
            rate = measured(gas, density, SHORT * 3).collisions
            results.append((ahead, rate, gas.counts.renewed / gas.counts.pair))
        list_tuning.AHEAD_OF_BEAD = default
        text = ', '.join(
            f'{ahead:.1f}: {renewed:.2f} renewals a collision, rate x {rate / results[0][1]:.2f}'
            for ahead, rate, renewed in results
        )
        print(f'n d^3 = {density:.2f}   {text}')
    print()
