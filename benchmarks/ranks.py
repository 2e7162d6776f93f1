"""Simulation-based calibration: ranks of true restitutions in their posteriors.

Truths are drawn from the priors of the inference: beads 0 to 1, walls 0.78 to 1, tray, floor and
lid, initial speeds, scale and bias of the speeds; each gives one cycle of 20 s. In a right
posterior the rank of the truth, the probability below it, is uniform from 0 to 1
(Talts et al. 2018, arXiv:1804.06788). "Decay": true mean speeds with errors of 2 %. "All": with
contacts in true tracks with the errors of tracking. Results are kept (`filmed_cycles.folder`)
under a key of the source code: a command that was interrupted continues.
"""

from __future__ import annotations

import hashlib
import math
import pickle
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from benchmarks.contacts import contacts_of, true_tracks
from benchmarks.drawn import varied
from benchmarks.filmed_cycles import folder
from nanorocks_ros.cli.progress import Progress
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
# Mean projected speed at the start, [m/s]: median, and standard deviation of its logarithm.
_START, _START_SPREAD = 0.007, 0.7
_SHARES = (0.68, 0.95)
# The walls have the prior of the decay: no others were simulated for the library.
_PRIOR = PriorSettings(min_wall_restitution=LOWEST_WALL)


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


def ranks_of_decays(tray_number: int, numbers: range) -> NDArray[np.float64]:
    """Ranks of beads and walls in posteriors of the decay alone, (n, 2).

    Parameters
    ----------
    tray_number : int
    numbers : range
        Of the drawn truths.
    """
    return np.array([_rank(tray_number, number, with_contacts=False) for number in numbers])


def _ranks_with_contacts(tray_number: int, numbers: range) -> NDArray[np.float64]:
    return np.array([_rank(tray_number, number, with_contacts=True) for number in numbers])


def _rank(tray_number: int, number: int, *, with_contacts: bool) -> tuple[float, float]:
    tray = load_trays()[tray_number]
    random = np.random.default_rng([2026, tray_number, number])
    beads = random.uniform()
    walls = random.uniform(_PRIOR.min_wall_restitution, _PRIOR.max_wall_restitution)
    drawn, values = varied(tray, walls, _PRIOR, random)
    start = _START * math.exp(_START_SPREAD * random.standard_normal())
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
    speed = _measured(true, random)
    library = library_of(tray)
    tables = tables_of(library, tray, _PRIOR)
    camera = math.hypot(_PRIOR.scale_error, library.misfit), _PRIOR.speed_bias
    decay = decay_likelihood(tables, _TIMES, speed, _ERROR * speed, camera).integrated()
    terms = ContactTerms.of(())
    if with_contacts:
        frames = round(_TIMES[-1] * _RATE)
        contacts = contacts_of(tray, true_tracks(drawn, simulation, number, frames))
        terms = ContactTerms.of(
            [contact for contact in contacts if contact.stamp_ns >= _TIMES[0] * NS]
        )
    posterior = posterior_of(
        tables,
        decay,
        (_PRIOR.min_wall_restitution, _PRIOR.max_wall_restitution),
        bead_likelihood=terms.bead_likelihood(_PRIOR.collision_bias),
        wall_likelihood=terms.wall_likelihood(_PRIOR.rebound_bias),
    )
    return _below(posterior, beads, walls)


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
    ranks = ranks_of_decays if kind == 'decay' else _ranks_with_contacts
    path = _file(f'{kind}_{tray}_{numbers.start}')
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, pickle.dumps(ranks(tray, numbers)))


def _file(name: str) -> Path:
    return folder() / f'ranks_{_code_key()}' / f'{name}.pickle'


@cache
def _code_key() -> str:
    """Key of the code that simulates and infers, and of the libraries."""
    here = Path(__file__).resolve().parent
    files = sorted((here.parent / 'nanorocks_ros').rglob('*.py'))
    files += sorted((here.parent / 'nanorocks_ros').rglob('*.npz'))
    files += [here / name for name in ('ranks.py', 'drawn.py', 'contacts.py')]
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
