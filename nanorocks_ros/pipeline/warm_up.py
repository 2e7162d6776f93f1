"""Compile or load all compiled functions before the first frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.inference.contacts.restitution_exponent import MIN_CONTACTS
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
from nanorocks_ros.inference.sticking.sticking_speed import sticking_estimate
from nanorocks_ros.numerics.picture_jitter import JitterMeter
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import (
    Frame,
    Measured,
    PairCollision,
    Rebound,
    SpeedEstimate,
    SpeedMethod,
    Tracks,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.clusters.correlation_width import ClusterAutocorrelator
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.preprocess.shaking.shaking_cycles import CycleFollower
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray

_SIDE = 160
_REGION = (40, 40, 80, 80)
_PICTURE_NS, _TENTH_NS = 33_333_333, 100_000_000


def warm_up_counting() -> None:
    """Push two images without a cycle through a `CycleFollower`."""
    follower = CycleFollower(2.0, 1.0)
    for stamp_ns in (0, 1):
        gray = np.full((16, 16), 100, dtype=np.uint8)
        follower.push(TrayImage(stamp_ns=stamp_ns, tray=1, gray=gray))


def warm_up_clusters() -> None:
    """Correlate a picture of a disc, and estimate a sticking speed from one merge."""
    stage = ClusterAutocorrelator(PipelineSettings(), load_trays()[1])
    gray = np.full((64, 64), 150, dtype=np.uint8)
    cv2.circle(gray, (32, 32), 12, 60, -1)
    gray[:8, :8] = 255
    stage.push(TrayImage(stamp_ns=0, tray=1, gray=gray))
    tray = load_trays()[1]
    times = np.linspace(0.0, 10.0, 20)
    cycle = StickingCycle(
        times=times,
        speeds=0.005 / (1.0 + times),
        bodies=np.where(times > 5.0, tray.count - 1.0, tray.count),
        merges=np.array([5.0]),
    )
    sticking_estimate([cycle], slow_contacts(tray), tray.count)


def warm_up() -> None:
    """Push a few pictures of a square through a preprocessor.

    With the cache on the disk this takes a second, without it some tens of seconds.
    """
    values = {'preprocess.regions_px': _REGION}
    settings = with_values(PipelineSettings(), values, 'warm-up')
    view = View(camera=IdentityLens(width=_SIDE, height=_SIDE))
    noise = np.random.default_rng(0).integers(90, 110, (3, _SIDE, _SIDE, 3), dtype=np.uint8)
    x, y, width, height = _REGION
    # In the last frame the square is missing, and searched for.
    noise[:2, y : y + height, x : x + width] += 80
    for encoding in ('bgr8', 'mono8'):
        stage = Preprocessor(settings, {1: load_trays()[1]}, 'warm-up', view)
        # Enough frames for the check of the tray positions.
        for number in range(10):
            image = noise[2 if number == 9 else number % 2]
            pixels = image if encoding == 'bgr8' else np.ascontiguousarray(image[:, :, 0])
            stage.push(Frame(stamp_ns=number, encoding=encoding, image=pixels))
    jitter = JitterMeter()
    # Enough displacements for a judgement.
    for number in range(20):
        jitter.push(number / 30.0, 0.0, 0.0, 0.1)


def warm_up_cooling() -> None:
    """Estimate the restitution of a decay and of some contacts."""
    tray = load_trays()[1]
    fitter = RestitutionEstimator(PipelineSettings(), tray)
    for number in range(1, 60):
        stamp_ns = number * _TENTH_NS
        speed = 0.005 / (1.0 + 1e-10 * stamp_ns)
        # Contacts of a gas that cools, enough for an exponent.
        if number >= 60 - MIN_CONTACTS:
            fitter.push(_rebound(stamp_ns, speed))
            fitter.push(_collision(stamp_ns, speed, tray))
        fitter.push(
            SpeedEstimate(
                stamp_ns=stamp_ns,
                tray=1,
                cycle=1,
                cycle_start_ns=0,
                mean_projected_speed=Measured(speed, 0.02 * speed),
                window=0.1,
                method=SpeedMethod.TRACKING,
            )
        )
    fitter.flush()


def _rebound(stamp_ns: int, speed: float) -> Rebound:
    return Rebound(
        stamp_ns=stamp_ns,
        tray=1,
        cycle=1,
        track=0,
        species=0,
        wall=0,
        incoming=Measured(speed, 0.02 * speed),
        outgoing=Measured(0.95 * speed, 0.02 * speed),
        tangential_incoming=0.0,
        tangential_outgoing=0.0,
        tangential_error=0.02 * speed,
        wall_velocity=Measured(0.0, 0.0),
        place=np.zeros(2),
    )


def _collision(stamp_ns: int, speed: float, tray: Tray) -> PairCollision:
    """A bead that hits one at rest."""
    return PairCollision(
        stamp_ns=stamp_ns,
        tray=1,
        cycle=1,
        tracks=np.array([0, 1], dtype=np.int32),
        species=np.zeros(2, dtype=np.int32),
        radii=np.full(2, 0.5 * tray.diameter),
        radius_errors=np.full(2, 1e-6),
        masses=np.full(2, 1e-6),
        before=np.array([[speed, 0.0], [0.0, 0.0]]),
        after=np.array([[0.05 * speed, 0.0], [0.95 * speed, 0.0]]),
        before_errors=np.full(2, 0.02 * speed),
        after_errors=np.full(2, 0.02 * speed),
        separation=np.array([0.95 * tray.diameter, 0.0]),
        separation_error=1e-5,
        temperatures=np.full(2, speed**2),
        height=tray.dimensions[2],
        place=np.full(2, 5e-3),
    )


def warm_up_contacts() -> None:
    """Find the contacts of three beads: one rebounds from a wall, two collide."""
    tray = load_trays()[1]
    finder, counter = ContactFinder(tray), BodyCounter(PipelineSettings(), tray)
    radius = 0.5 * tray.diameter
    for number in range(100):
        # At 3 mm/s, and 30 pictures a second.
        away = radius + 1e-4 * abs(number - 44.6)
        places = [(away, 3e-3), (7.5e-3 - away, 11e-3), (7.5e-3 + away, 11e-3)]
        tracks = Tracks(
            stamp_ns=number * _PICTURE_NS,
            tray=tray.number,
            ids=np.arange(3, dtype=np.int32),
            species=np.zeros(3, dtype=np.int32),
            displacement=np.zeros(2),
            positions=np.array(places),
            position_errors=np.full(3, 4e-6),
            velocities=np.full((3, 2), 2e-3),
            velocity_errors=np.full(3, 1e-5),
            radii=np.full(3, radius),
            radius_errors=np.full(3, 1e-6),
            seen=np.ones(3, dtype=np.bool_),
            expected=np.array([3], dtype=np.int32),
            cycle=1,
        )
        finder.push(tracks)
        counter.push(tracks)
    finder.flush()


def warm_up_speed() -> None:
    """Push a few pictures of moving discs through the measurement of a tray."""
    settings = PipelineSettings()
    # Under chalk beads are detected in another way.
    for tray in (load_trays()[3], load_trays()[2]):
        estimator = TrayMeasurement(settings, tray)
        for number in range(8):
            color = np.full((80, 160, 3), 150, dtype=np.uint8)
            for k in range(8):
                place = 18 + 18 * k
                cv2.circle(color, (place, 20 + number), 12, (30, 30, 200), -1)
                cv2.circle(color, (place, 60 - number), 7, (200, 60, 30), -1)
            gray = np.ascontiguousarray(color[:, :, 0])
            image = TrayImage(
                stamp_ns=number * _PICTURE_NS,
                tray=tray.number,
                gray=gray,
                color=color,
                displacement=(0.0, 0.0),
                displacement_error=1e-6,
            )
            estimator.push(image)
    warm_up_contacts()
