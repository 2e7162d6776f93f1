"""Cooling gases of rough beads: decays, and the restitutions inferred from them.

Restitutions 0.89 (beads) and 0.97 (walls), started at 10 mm/s without rotation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from operator import add

import numpy as np
from scipy import optimize

from benchmarks.contacts import contacts_of, true_tracks
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_estimate import contact_estimate
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.decay.instantaneous_restitution import local_slopes
from nanorocks_ros.inference.posterior import posterior_of
from nanorocks_ros.physics.paper_formulas import (
    RELATIVE_TO_MEAN_SPEED,
    paper_instantaneous_restitution,
)
from nanorocks_ros.settings import PriorSettings, SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

PAIRS, WALLS = 0.89, 0.97


@dataclass(frozen=True, slots=True, kw_only=True)
class Roughness:
    """Tangential restitution and coefficient of friction of beads, and whether walls have them."""

    tangential: float = -1.0
    friction: float = 1e6
    walls: bool = True

    @property
    def name(self):
        """Label in tables."""
        if self.tangential <= -1.0:
            return 'smooth'
        slides = f', μ {self.friction:g}' if self.friction < 1e6 else ''
        return f'β {self.tangential:g}{slides}' + ('' if self.walls else ', smooth walls')

    @property
    def settings(self):
        """Settings of a simulation."""
        return {
            'tangential_restitution': self.tangential,
            'wall_tangential_restitution': self.tangential if self.walls else -1.0,
            'friction': self.friction,
            'wall_friction': self.friction,
        }


SMOOTH = Roughness()
# Similar to glass and acrylic, and twice as rough: Foerster et al. 1994, Phys. Fluids 6, 1108, and
# Lorenz et al. 1997, Exp. Mech. 37, 292; from memory.
BEADS = Roughness(tangential=0.4, friction=0.1)
RUBBING = Roughness(tangential=0.4, friction=0.25)
SMOOTH_WALLS = Roughness(tangential=0.4, friction=0.1, walls=False)
HALF = Roughness(tangential=0.0)
ROUGH = (
    Roughness(tangential=0.4, friction=0.03),
    BEADS,
    RUBBING,
    SMOOTH_WALLS,
    Roughness(tangential=-0.5),
    HALF,
    Roughness(tangential=0.5),
)
_FIRST, _LAST, _RATE, _ERROR = 1.75, 20.0, 30.0, 0.02
_NS = 1e9


def settings_of(tray, roughness, **values):
    """Settings of a simulated tray."""
    return SimulationSettings(
        **{
            'tray': tray.number,
            'restitution': PAIRS,
            'wall_restitution': WALLS,
            **roughness.settings,
            'mean_speed': 0.010,
            'seed': 99,
            'first_shake': 0.0,
            'frame_rate': _RATE,
            **values,
        }
    )


def speeds_of(number, roughness, times, runs, **values):
    """Mean projected speeds of a tray, (n_runs, n_times), [m/s]."""
    tray = load_trays()[number]
    settings = settings_of(tray, roughness, **values)
    return cooling_runs(settings, tray, times, range(runs)).mean_projected_speed


def paper_values(speeds, step, tray):
    """Restitutions by the paper's estimate and their collision speeds, of (n_curves, n_times).

    The estimate uses speeds 1 s apart. The collision speed is that of the mean over all curves,
    so that noise does not change the speed of a value.
    """
    lag = round(1.0 / step)
    restitutions = paper_instantaneous_restitution(
        speeds[:, :-lag], speeds[:, lag:], lag * step, tray.diameter, tray.number_density
    )
    return restitutions, RELATIVE_TO_MEAN_SPEED * speeds.mean(axis=0)[:-lag]


def spread(values, speed, edges):
    """Scatter of the estimates in ranges of speed.

    Parameters
    ----------
    values : ndarray (n_curves, n_times)
    speed : ndarray (n_times,)
    edges : sequence of float
        Edges of the ranges of speed, [m/s].

    Returns
    -------
    middle, half, above_one, highest, half_log : ndarray (n_ranges,)
        Median, half of the range of the middle 68 %, share above 1, quantile 97.5 %, and half
        of the same range of the logarithm; NaN where no speed is in the range.
    """
    rows = []
    for low, high in pairwise(edges):
        inside = values[:, (speed >= low) & (speed < high)]
        if inside.size:
            lower, middle, upper, highest = np.nanquantile(inside, (0.16, 0.5, 0.84, 0.975))
            above = np.nanmean(inside > 1.0)
            half, logs = 0.5 * (upper - lower), 0.5 * np.log(upper / lower)
            rows.append((middle, half, above, highest, logs))
        else:
            rows.append((math.nan,) * 5)
    return np.array(rows).T


def local_rates(speeds, times, windows=4):
    """Slopes of 1/v of each mean over cycles, in windows of equal width in ln v.

    Returns
    -------
    speed : ndarray (windows,), [m/s]
    slopes : ndarray (n_means, windows), [1/m]
    """
    law = speeds.mean(axis=0)
    share = np.log(law[0] / law) / np.log(law[0] / law[-1])
    place = np.clip((share * windows).astype(int), 0, windows - 1)
    # The mean may rise briefly, but windows have to be consecutive.
    place = np.maximum.accumulate(place)
    middle = [np.exp(np.log(law[place == k]).mean()) for k in range(windows)]
    return np.array(middle), local_slopes(times, speeds, law, place)


def haff_rate(times, mean):
    """Decay rate 1 / (v0 tau) of an unweighted fit of Haff's law to ln v, [1/m]."""

    def residual(logs):
        return np.log(mean) - logs[0] + np.log1p(math.exp(logs[0] + logs[1]) * times)

    return math.exp(optimize.least_squares(residual, (math.log(mean[0]), math.log(50.0))).x[1])


def read_cycles(number, roughness, cycles):
    """Restitutions inferred from decays, contacts and both, assuming smooth beads.

    Returns
    -------
    posteriors : dict of Posterior
        'walls known' and 'decay': from the decays; 'all': with rebounds and collisions.
    numbers : tuple of 6 floats
        Decay rate of the mean decay [1/m]; median tension of single cycles; rebounds and
        collisions found in a cycle; restitutions of beads and walls from contacts alone.
    """
    tray = load_trays()[number]
    settings = settings_of(tray, roughness)
    library = library_of(tray)
    times = np.arange(_FIRST, _LAST, 0.1)
    noise = np.random.default_rng([number, cycles]).standard_normal((cycles, times.size))
    speeds = cooling_runs(settings, tray, times, range(cycles)).mean_projected_speed
    speeds = speeds * np.exp(_ERROR * noise)
    prior = PriorSettings(min_wall_restitution=0.8)
    camera = (math.hypot(prior.scale_error, library.misfit), prior.speed_bias)
    tables = tables_of(library, tray, prior)
    decays = [decay_likelihood(tables, times, speed, _ERROR * speed, camera) for speed in speeds]
    contacts = [_contacts(tray, settings, run) for run in range(cycles)]
    all_decays, walls = (
        reduce(add, decays).integrated(),
        (prior.min_wall_restitution, prior.max_wall_restitution),
    )

    def with_contacts(decay, terms):
        return posterior_of(
            tables,
            decay,
            walls,
            bead_likelihood=terms.bead_likelihood(prior.collision_bias),
            wall_likelihood=terms.wall_likelihood(prior.rebound_bias),
        )

    cycle_posteriors = [
        with_contacts(decay.integrated(), terms)
        for decay, terms in zip(decays, contacts, strict=True)
    ]
    all_contacts = reduce(add, contacts)
    posteriors = {
        'walls known': posterior_of(tables, all_decays, (WALLS, WALLS)),
        'decay': posterior_of(tables, all_decays, walls),
        'all': with_contacts(all_decays, all_contacts),
    }
    rate = haff_rate(times, speeds.mean(axis=0))
    return posteriors, (
        rate,
        float(np.median([posterior.tension for posterior in cycle_posteriors])),
        all_contacts.rebounds / cycles,
        all_contacts.collisions / cycles,
        *_alone(all_contacts),
    )


def _alone(contacts):
    """Restitutions of beads and walls from contacts alone; NaN without contacts."""
    restitutions = []
    for term in (contacts.bead_likelihood(), contacts.wall_likelihood()):
        if term is None:
            restitutions.append(math.nan)
        else:
            restitutions.append(
                contact_estimate(term.restitution, term.log_likelihood).restitution
            )
    return restitutions


def _contacts(tray, settings, run):
    tracks = true_tracks(tray, settings, run, round(_LAST * _RATE))
    contacts = contacts_of(tray, tracks)
    return ContactTerms.of([contact for contact in contacts if contact.stamp_ns > _FIRST * _NS])
