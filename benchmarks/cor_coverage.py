"""How often the interval of one cycle covers what the ensemble says; the paper's form beside it.

Tray 1, walls 0.99, true mean speeds without a camera, 300 runs a row. The interval is about the
decay rate 1/(v0 tau); "covered" is Haff's law fitted to the mean decay of all the runs.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from nanorocks_ros.experiment.settings import CoolingSettings, SimulationSettings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff_fit import HaffFit, fit_haff
from nanorocks_ros.physics.paper import paper_restitution_of_decay
from nanorocks_ros.simulation.ensemble import cooling_runs

_RUNS = 300
_RESTITUTIONS = (0.6, 0.7, 0.8, 0.89, 0.95)
# Of a speed measured from frames, about (`speed_accuracy`).
_RELATIVE_ERROR = 0.04


def _fit(times: np.ndarray, speed: np.ndarray, beads: int) -> HaffFit:
    return fit_haff(times, speed, _RELATIVE_ERROR * speed, beads)


def report() -> None:
    """Print the table."""
    tray = load_trays()[1]
    cooling = CoolingSettings()
    times = np.arange(cooling.delay, cooling.duration, 0.1)
    print('| truth | covered, 68 % | covered, 95 % | sd of ln(rate), runs / fits | paper says |')
    print('| --- | --- | --- | --- | --- |')
    for restitution in _RESTITUTIONS:
        settings = SimulationSettings(restitution=restitution, seed=7)
        runs = cooling_runs(settings, tray, times, range(_RUNS))
        mean = _fit(times, runs.mean_projected_speed.mean(axis=0), tray.count * _RUNS)
        fits = [_fit(times, speed, tray.count) for speed in runs.mean_projected_speed]
        pulls = np.array(
            [np.log(one.decay_rate / mean.decay_rate) / one.log_decay_rate_error for one in fits]
        )
        freedom = np.array([one.degrees_of_freedom for one in fits])
        covered = [
            float((np.abs(pulls) < special.stdtrit(freedom, 0.5 + 0.5 * probability)).mean())
            for probability in (0.68, 0.95)
        ]
        scatter = np.std([np.log(one.decay_rate) for one in fits])
        error = np.median([one.log_decay_rate_error for one in fits])
        printed = [
            paper_restitution_of_decay(one.decay_rate, tray.diameter, tray.number_density)
            for one in fits
        ]
        print(
            f'| {restitution:g} | {covered[0]:.2f} | {covered[1]:.2f} | '
            f'{scatter:.3f} / {error:.3f} | {np.mean(printed):.3f} |'
        )
