"""Simulation-based calibration: ranks of true restitutions in their posteriors.

Truths are drawn from the priors of the inference: beads 0 to 1, walls 0.5 to 1, tray, floor and
lid, initial speeds, scale and bias of the speeds; each gives one cycle of 20 s. In a right
posterior the rank of the truth, the probability below it, is uniform from 0 to 1
(Talts et al. 2018, arXiv:1804.06788). "Decay": true mean speeds with errors of 2 %. "All": with
contacts in true tracks with the errors of tracking. Results are kept (`kept_results.folder`)
under a key of the source code: a command that was interrupted continues. The decays have a key of
the code that simulates, so that after a change of the inference only that is repeated.
"""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from benchmarks.contacts import contacts_of, true_tracks
from benchmarks.drawn import varied
from benchmarks.kept_results import folder
from benchmarks.source_key import key_of
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_library import LOWEST_WALL
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.posterior import Posterior, posterior_of
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.records import NS
from nanorocks_ros.settings import PriorSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.ensemble import cooling_runs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

_TRAYS = (1, 3, 5)
_CONTACT_TRAYS = (1, 3)
_DECAYS, _CYCLES = 2000, 300
_CHUNK = {'decay': 100, 'all': 10}
_TIMES = np.arange(1.75, 20.0, 0.25)
_ERROR = 0.02
_RATE = 30.0
# Mean projected over mean speed of an isotropic gas.
_PROJECTED = 0.25 * math.pi
_BINS = 20
_SHARES = (0.68, 0.95)
# The walls have the prior of the decay: no others were simulated for the library.
_PRIOR = PriorSettings(min_wall_restitution=LOWEST_WALL)
# Folders with the code that simulates.
_SIMULATING = ('experiment', 'numerics', 'settings', 'simulation')


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """A drawn truth and its decay.

    Parameters
    ----------
    tray : Tray
        With drawn sides and beads.
    simulation : SimulationSettings
        With the true restitutions.
    speed : ndarray (n_times,), [m/s]
        Mean projected speeds with the errors that the inference assumes.
    """

    tray: Tray
    simulation: SimulationSettings
    speed: NDArray[np.float64]


def report() -> None:
    """Print the table."""
    print('| tray | from | truths | of | mean rank | χ² p | KS p | covered 68 % | 95 % |')
    print('| --- ' * 9 + '|')
    for kind, trays, number in (
        ('decay', _TRAYS, _DECAYS),
        ('all', _CONTACT_TRAYS, _CYCLES),
    ):
        for tray in trays:
            ranks = _all_ranks(kind, tray, number)
            for name, column in zip(('beads', 'walls'), ranks.T, strict=True):
                print(f'| {tray} | {kind} | {number} | {name} | {judged(column)} |', flush=True)


def judged(ranks: NDArray[np.float64]) -> str:
    """Mean rank, p of two tests for uniform ranks, and coverage with binomial errors."""
    counts, _ = np.histogram(ranks, _BINS, (0.0, 1.0))
    cells = [
        f'{ranks.mean():.3f} ± {math.sqrt(1.0 / 12.0 / ranks.size):.3f}',
        f'{stats.chisquare(counts).pvalue:.2g}',
        f'{stats.kstest(ranks, "uniform").pvalue:.2g}',
    ]
    for share in _SHARES:
        covered = float(np.mean(np.abs(ranks - 0.5) <= 0.5 * share))
        error = math.sqrt(share * (1.0 - share) / ranks.size)
        cells.append(f'{covered:.3f} ± {error:.3f}')
    return ' | '.join(cells)


def _ranks_of_decays(tray_number: int, numbers: range) -> NDArray[np.float64]:
    return np.array([ranks_of(tray_number, cycle) for cycle in _cycles(tray_number, numbers)])


def _ranks_with_contacts(tray_number: int, numbers: range) -> NDArray[np.float64]:
    ranks = []
    for number, cycle in zip(numbers, _cycles(tray_number, numbers), strict=True):
        frames = round(_TIMES[-1] * _RATE)
        tracks = true_tracks(cycle.tray, cycle.simulation, number, frames)
        contacts = contacts_of(load_trays()[tray_number], tracks)
        terms = ContactTerms.of(
            [contact for contact in contacts if contact.stamp_ns >= _TIMES[0] * NS]
        )
        ranks.append(ranks_of(tray_number, cycle, terms))
    return np.array(ranks)


def _cycles(tray_number: int, numbers: range) -> list[Cycle]:
    """Simulated cycles, from a file where there is one."""
    path = (
        folder()
        / f'decays_{_simulation_key()}'
        / f'{tray_number}_{numbers.start}_{numbers.stop}.pickle'
    )
    if path.exists():
        cycles: list[Cycle] = pickle.loads(path.read_bytes())
        return cycles
    cycles = [drawn_cycle(tray_number, number) for number in numbers]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, pickle.dumps(cycles))
    return cycles


def drawn_cycle(tray_number: int, number: int) -> Cycle:
    """Draw a truth from the priors and simulate its decay.

    Parameters
    ----------
    tray_number : int
    number : int
        Of the truth.
    """
    tray = load_trays()[tray_number]
    random = np.random.default_rng([2026, tray_number, number])
    beads = random.uniform()
    walls = random.uniform(_PRIOR.min_wall_restitution, _PRIOR.max_wall_restitution)
    drawn, values = varied(tray, walls, _PRIOR, random)
    start = _PRIOR.initial_speed * math.exp(_PRIOR.initial_speed_spread * random.standard_normal())
    simulation = with_values(
        SimulationSettings(seed=4343, first_shake=0.0, frame_rate=_RATE),
        {
            'restitution': beads,
            'wall_restitution': walls,
            'mean_speed': start / _PROJECTED,
            **values,
        },
        'benchmark',
    )
    (true,) = cooling_runs(simulation, drawn, _TIMES, [number]).mean_projected_speed
    return Cycle(tray=drawn, simulation=simulation, speed=_measured(true, random))


def ranks_of(
    tray_number: int, cycle: Cycle, terms: ContactTerms | None = None
) -> tuple[float, float]:
    """Ranks of beads and walls in the posterior of one cycle.

    Parameters
    ----------
    tray_number : int
        Of the listed tray, which the inference assumes.
    cycle : Cycle
    terms : ContactTerms, optional
        Of its contacts; without them the decay alone is used.
    """
    tray = load_trays()[tray_number]
    library = library_of(tray)
    tables = tables_of(library, tray, _PRIOR)
    camera = math.hypot(_PRIOR.scale_error, library.misfit), _PRIOR.speed_bias
    terms = terms or ContactTerms.of(())
    decay = decay_likelihood(
        tables, _TIMES, cycle.speed, _ERROR * cycle.speed, camera, highest_friction=0.0
    )
    posterior = posterior_of(
        tables,
        decay.integrated(),
        (_PRIOR.min_wall_restitution, _PRIOR.max_wall_restitution),
        bead_likelihood=terms.bead_likelihood(_PRIOR.collision_bias),
        wall_likelihood=terms.wall_likelihood(_PRIOR.rebound_bias),
    )
    truth = cycle.simulation
    return _below(posterior, truth.restitution, truth.wall_restitution)


def _measured(true: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Speeds with the errors that the inference assumes."""
    log_speed = np.log(true)
    scale, bias = random.standard_normal(2)
    log_speed = log_speed + _PRIOR.scale_error * scale
    log_speed += _PRIOR.speed_bias * bias * (log_speed - log_speed.mean())
    return np.asarray(np.exp(log_speed + _ERROR * random.standard_normal(true.size)))


def _below(posterior: Posterior, beads: float, walls: float) -> tuple[float, float]:
    """Probability below the truth, of beads and of walls."""
    fine = np.linspace(0.0, 1.0, 2001)
    return (
        float(np.interp(beads, posterior.quantiles(fine), fine)),
        float(np.interp(walls, posterior.wall_quantiles(fine), fine)),
    )


def _all_ranks(kind: str, tray: int, number: int) -> NDArray[np.float64]:
    chunk = _CHUNK[kind]
    parts = {
        f'{kind}_{tray}_{first}': (kind, tray, range(first, min(first + chunk, number)))
        for first in range(0, number, chunk)
    }
    missing = {name: part for name, part in parts.items() if not _file(name).exists()}
    with Progress(f'ranks of tray {tray}, {kind}') as progress:
        run_tasks(_make, missing, Workers(), progress.count)
    return np.concatenate([pickle.loads(_file(name).read_bytes()) for name in parts])


def _make(part: tuple[str, int, range]) -> None:
    kind, tray, numbers = part
    ranks = _ranks_of_decays if kind == 'decay' else _ranks_with_contacts
    path = _file(f'{kind}_{tray}_{numbers.start}')
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, pickle.dumps(ranks(tray, numbers)))


def _file(name: str) -> Path:
    return folder() / f'ranks_{_code_key()}' / f'{name}.pickle'


@cache
def _code_key() -> str:
    """Key of the code that simulates and infers, and of the libraries."""
    here = Path(__file__).resolve().parent
    package = here.parent / 'nanorocks_ros'
    files = [*sorted(package.rglob('*.py')), *sorted(package.rglob('*.npz'))]
    return key_of([*files, *(here / name for name in ('ranks.py', 'drawn.py', 'contacts.py'))])


@cache
def _simulation_key() -> str:
    here = Path(__file__).resolve().parent
    files = [
        file
        for name in _SIMULATING
        for file in sorted((here.parent / 'nanorocks_ros' / name).rglob('*.py'))
    ]
    return key_of([*files, here / 'ranks.py', here / 'drawn.py'])
