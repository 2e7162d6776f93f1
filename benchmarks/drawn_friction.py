"""Walls and beads of drawn gases with drag and friction, from true tracks.

Trays, gases and their starts are drawn as for `drawn_films`, at 15 to 60 frames/s and with errors
of places of 0.05 to 0.2 px beside shared ones: what is wrong here is physics, what is wrong in
films alone is recognition. The second table tells friction and drag as they are, and reads the
walls with shares of what hits of floor and lid take off: their mean error over the stated one is
0 where the share is right. Its last column is the share of friction that the rebounds of a row
together show, with its 68 % interval.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.contacts import METRE_PX, contacts_of, true_tracks
from benchmarks.coverage import coverage
from benchmarks.cycle_estimates import estimate_of_tracks
from benchmarks.drawn_films import drawn_gas
from benchmarks.friction_films import ROWS
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_likelihood import marginal
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.contacts.rubbed_rebounds import ROLLING, rubbed_table
from nanorocks_ros.inference.decay.friction_weights import shown_at_most
from nanorocks_ros.inference.likelihood_1d import Likelihood1D, Posterior1D
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.records import NS, Headline, Interval, PairCollision, Rebound
from nanorocks_ros.settings import PriorSettings, SimulationSettings, with_values

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CYCLES = {1: 80, 3: 40}
_SECONDS, _FIRST = 25.0, 1.75
_RATES, _JITTERS = (15.0, 24.0, 30.0, 60.0), (0.05, 0.1, 0.2)
_ENDS = np.array([0.025, 0.5, 0.975])
_MIDDLE = np.array([0.16, 0.5, 0.84])
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of what a hit takes off a bead that slides."""
SHOWN = np.linspace(0.0, 1.5, 301)
"""Shares of `shown_at_most`."""
_WALLS = np.linspace(0.5, 1.0, 251)
_FEWEST = 5
_PRIOR = PriorSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnCycle:
    """What one cycle tells.

    Parameters
    ----------
    beads, walls : Interval
        Headlines less the truth.
    drag : float, [1/s]
        What is found, less the truth.
    from_contacts : bool
    pulls : tuple of float
        Error of the walls over the stated one for each of `SHARES`, with friction and drag known.
    known : float
        Half of the 95 % interval of the walls by rebounds, with friction and drag known.
    shown : ndarray (n,)
        Log likelihood of `SHOWN` by the tangential speeds of the rebounds; NaN without friction or
        rebounds.
    """

    beads: Interval
    walls: Interval
    drag: float
    from_contacts: bool
    pulls: tuple[float, ...]
    known: float
    shown: NDArray[np.float64]


def report() -> None:
    """Print both tables."""
    cases = {
        (number, *row): [(number, run, *row) for run in range(cycles)]
        for number, cycles in _CYCLES.items()
        for row in ROWS
    }
    tasks = {str(task): task for same in cases.values() for task in same}
    with Progress('true tracks') as progress:
        cycles = dict(
            zip(tasks, run_tasks(_cycle_of, tasks, Workers(), progress.count), strict=True)
        )
    by_case = {case: [cycles[str(task)] for task in same] for case, same in cases.items()}
    print(
        '\n| tray | drag [1/s] | friction | cycles | drag found - true, sd of a cycle | from '
        'contacts | beads: holds | half-width | median error | walls: holds | half-width | median '
        'error |\n' + '| --- ' * 12 + '|'
    )
    for (number, drag, friction), read in by_case.items():
        share = np.mean([cycle.from_contacts for cycle in read])
        off = np.array([cycle.drag for cycle in read])
        cells = [
            f'{number} | {drag:g} | {friction:g} | {len(read)} | '
            f'{np.nanmean(off):+.4f}, {np.nanstd(off):.4f} | {share:.2f}'
        ]
        for name in ('beads', 'walls'):
            seen = coverage([getattr(cycle, name) for cycle in read], 0.0)
            cells.append(f'{seen.holds:.2f} | {seen.half_width:.4f} | {seen.median_error:+.4f}')
        print(f'| {" | ".join(cells)} |')
    print('\n| tray | drag [1/s] | friction | known | over ideal |', end='')
    print(
        ''.join(f' share {share:g} |' for share in SHARES)
        + ' friction shown |\n'
        + '| --- ' * (6 + len(SHARES))
        + '|'
    )
    for (number, drag, friction), read in by_case.items():
        known, ideal = (
            np.nanmedian([cycle.known for cycle in same])
            for same in (read, by_case[(number, *ROWS[0])])
        )
        pulls = np.nanmean([cycle.pulls for cycle in read], axis=0)
        cells = ' | '.join(f'{pull:+.2f}' for pull in pulls)
        print(
            f'| {number} | {drag:g} | {friction:g} | {known:.4f} | {known / ideal:.2f} | {cells} '
            f'| {_share_text(read)} |'
        )


def _share_text(cycles: list[DrawnCycle]) -> str:
    logs = np.array([cycle.shown for cycle in cycles])
    together = np.nansum(logs, axis=0)
    if not together.any():
        return ''
    share = Likelihood1D(restitution=SHOWN, log_likelihood=together).posterior((0.0, SHOWN[-1]))
    lower, median, upper = share.quantiles(_MIDDLE)
    return f'{median:.2f} [{lower:.2f}, {upper:.2f}]'


def _cycle_of(task: tuple[int, int, float, float]) -> DrawnCycle:
    return drawn_cycle(*task)


def drawn_cycle(number: int, run: int, drag: float, friction: float) -> DrawnCycle:
    """A drawn gas and what its true tracks tell.

    Parameters
    ----------
    number, run, drag, friction
        As of `drawn_gas`.
    """
    tray, values = drawn_gas(number, run, drag, friction)
    rate, jitter = _RATES[run % len(_RATES)], _JITTERS[run % len(_JITTERS)] / METRE_PX
    values |= {'first_shake': 0.0, 'seed': 9000 + run, 'frame_rate': rate}
    settings = with_values(SimulationSettings(), values, 'benchmark')
    nominal = load_trays()[number]
    tracks = list(true_tracks(tray, settings, 0, round(_SECONDS * rate), jitter))
    contacts = contacts_of(nominal, iter(tracks))
    estimate = estimate_of_tracks(nominal, tracks, contacts, [run, 5])
    read = [
        contact
        for contact in contacts
        if isinstance(contact, Rebound | PairCollision) and contact.stamp_ns >= _FIRST * NS
    ]
    terms = ContactTerms.of(dragged(contact, drag) for contact in read)
    errors = [
        Interval(*(limit - float(values[name]) for limit in (own.value, own.lower, own.upper)))
        for own, name in (
            (estimate.restitution, 'restitution'),
            (estimate.wall_restitution, 'wall_restitution'),
        )
    ]
    truth = float(values['wall_restitution'])
    told = terms.rebounds >= _FEWEST
    shared = [_walls(terms, (drag, friction), share) for share in SHARES if told]
    rolling = _walls(terms, (drag, friction), ROLLING) if told else None
    return DrawnCycle(
        beads=errors[0],
        walls=errors[1],
        drag=estimate.drag.value - drag,
        from_contacts=estimate.headline is Headline.CONTACTS,
        pulls=tuple((walls.mean - truth) / walls.deviation for walls in shared)
        or (math.nan,) * len(SHARES),
        known=0.5 * float(np.ptp(rolling.quantiles(_ENDS))) if rolling else math.nan,
        shown=_shares(friction, read),
    )


def _shares(friction: float, contacts: list[Rebound | PairCollision]) -> NDArray[np.float64]:
    # As the stages read them, which do not know the drag.
    likelihood = ContactTerms.of(contacts).friction_likelihood
    if likelihood is None or friction == 0.0:
        return np.full(SHOWN.size, math.nan)
    shown = SHOWN * shown_at_most(np.array(friction))
    return np.interp(shown, likelihood.restitution, likelihood.log_likelihood)


def _walls(terms: ContactTerms, known: tuple[float, float], share: float) -> Posterior1D:
    """What rebounds tell of the walls with drag and friction known."""
    drag, friction = known
    hits, drags = np.array([share * friction]), np.array([drag])
    table = rubbed_table(terms.rebound_impacts, _WALLS, hits, drags)
    logs = marginal(table.reshape(-1, _WALLS.size))
    likelihood = Likelihood1D(restitution=_WALLS, log_likelihood=logs)
    return likelihood.convolved(_PRIOR.rebound_bias).posterior((0.5, 1.0))
