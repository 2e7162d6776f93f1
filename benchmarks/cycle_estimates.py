"""Final estimates of single cycles, by the stages that read films and cameras."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import NS, Measured, SpeedEstimate, SpeedMethod
from nanorocks_ros.settings import CoolingSettings, PipelineSettings, PriorSettings
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.contacts import Contacts
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import CorEstimate, Tracks

# Time between mean speeds, and their relative error.
_EVERY, _ERROR = 0.1, 0.02
_FINAL_ONLY = CoolingSettings(update_interval=60.0)
_DEFAULT = PriorSettings()


def estimate_of_tracks(
    tray: Tray,
    tracks: Sequence[Tracks],
    contacts: Contacts,
    seed: Sequence[int],
    prior: PriorSettings = _DEFAULT,
) -> CorEstimate:
    """The final estimate of a cycle from tracks, contacts, and mean speeds with errors of 2 %.

    Parameters
    ----------
    tray : Tray
        As told to the stages.
    tracks : sequence of Tracks
        Of each frame, from the shaking event on.
    contacts : tuple
        Found in the tracks.
    seed : sequence of int
        Draws the errors of the speeds.
    prior : PriorSettings, optional
    """
    noise = np.random.default_rng(seed).standard_normal(len(tracks))
    start = tracks[0].stamp_ns
    interval = (tracks[-1].stamp_ns - start) / NS / (len(tracks) - 1)
    estimator = RestitutionEstimator(PipelineSettings(cooling=_FINAL_ONLY, prior=prior), tray)
    estimates: list[CorEstimate] = []
    for contact in contacts:
        estimates += estimator.push(contact)
    for frame in range(0, len(tracks), max(round(_EVERY / interval), 1)):
        mean = float(np.hypot(*tracks[frame].velocities.T).mean())
        speed = mean * math.exp(_ERROR * noise[frame])
        estimates += estimator.push(
            SpeedEstimate(
                stamp_ns=tracks[frame].stamp_ns,
                tray=tray.number,
                cycle=1,
                cycle_start_ns=start,
                method=SpeedMethod.TRACKING,
                mean_projected_speed=Measured(speed, _ERROR * speed),
                window=interval,
                tray_speed=0.0,
            )
        )
    return [*estimates, *estimator.flush()][-1]
