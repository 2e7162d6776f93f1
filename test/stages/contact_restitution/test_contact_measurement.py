"""Contacts while the images come in: each once, and the same as those of all tracks together."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.flat_discs import FlatBox, flat_pictures, flat_run
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import (
    CorEstimate,
    CorStatus,
    FreeFlight,
    Headline,
    PairCollision,
    Rebound,
    SpeedEstimate,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings, PreprocessSettings
from nanorocks_ros.stages.contact_restitution.contact_estimator import ContactEstimator
from nanorocks_ros.stages.contact_restitution.contact_measurement import ContactMeasurement
from nanorocks_ros.stages.contact_restitution.track_contacts import track_contacts
from nanorocks_ros.stages.tracking.tracker import Tracker

SCALE, RATE, SECONDS = 5000.0, 60.0, 9.0
SETTINGS = PipelineSettings(preprocess=PreprocessSettings(pixels_per_metre=SCALE))
TRAY = load_trays(
    'trays:\n  1:\n    dimensions_mm: [60, 45]\n    species:\n'
    '      - {diameter_mm: 3, look: auto}\n'
)[1]
BOX = FlatBox(count=10, speed=0.05)


def images(box):
    run = flat_run(box, SECONDS, rate=RATE, seed=1)
    return [
        TrayImage(
            stamp_ns=1 + round(k * 1e9 / RATE),
            tray=1,
            gray=picture[:, :, 0].copy(),
            color=picture,
            displacement=(0.0, 0.0),
            displacement_error=0.0,
        )
        for k, picture in enumerate(flat_pictures(run, box, SCALE))
    ]


@pytest.fixture(scope='module')
def gas():
    """Images of discs that cool, the records of them, and when each was given out."""
    stage = ContactMeasurement(SETTINGS, TRAY, container_known=False)
    frames = images(BOX)
    records = [(image.stamp_ns, record) for image in frames for record in stage.push(image)]
    records += [(frames[-1].stamp_ns, record) for record in stage.flush()]
    return frames, records, stage


def of_kind(records, kind):
    return [record for _, record in records if isinstance(record, kind)]


def test_contacts_are_those_of_all_tracks_together_and_each_is_given_once(gas):
    frames, records, stage = gas
    tracker = Tracker(SETTINGS, TRAY)
    tracks = [record for image in frames for record in tracker.push(image)]
    whole = track_contacts(tracks, TRAY, SETTINGS, container_known=False)
    for kind, expected in ((Rebound, whole.rebounds), (PairCollision, whole.collisions)):
        stamps = sorted(record.stamp_ns for record in of_kind(records, kind))
        assert len(expected) > 10
        assert len(stamps) == pytest.approx(len(expected), abs=1)
        assert len(set(stamps)) == len(stamps)
    for own, other in (
        (stage.summary().alone.beads, whole.alone.beads),
        (stage.summary().alone.walls, whole.alone.walls),
    ):
        assert own.restitution.value == pytest.approx(
            other.restitution.value, abs=0.2 * other.restitution.error
        )
    beads, walls = whole.alone.beads.restitution, whole.alone.walls.restitution
    assert beads.lower < BOX.restitution < beads.upper
    assert walls.lower < BOX.wall_restitution < walls.upper


def test_contacts_are_given_out_while_the_film_goes_on(gas):
    _, records, _ = gas
    early = [record for given, record in records if given < 5e9]
    assert sum(isinstance(record, Rebound) for record in early) > 5
    flights = of_kind(records, FreeFlight)
    for flight in flights:
        others = [other for other in flights if other.track == flight.track and other != flight]
        assert all(abs(other.stamp_ns - flight.stamp_ns) > 1e8 for other in others)


def test_places_count_from_the_corner_of_the_tray(gas):
    _, records, _ = gas
    for rebound in of_kind(records, Rebound):
        axis, high = divmod(rebound.wall, 2)
        edge = BOX.sides[axis] - BOX.radius if high else BOX.radius
        assert rebound.place[axis] == pytest.approx(edge, abs=0.3 * BOX.radius)


def test_speeds_are_the_mean_of_the_beads(gas):
    _, records, _ = gas
    run = flat_run(BOX, SECONDS, rate=RATE, seed=1)
    truth = np.hypot(*run.velocities.transpose(2, 0, 1)).mean(axis=1)
    speeds = of_kind(records, SpeedEstimate)
    assert len(speeds) > 80
    for speed in speeds[5::10]:
        frame = round(speed.stamp_ns * 1e-9 * RATE)
        assert speed.mean_projected_speed.value == pytest.approx(truth[frame], rel=0.08)


def test_estimates_follow_the_contacts_and_the_last_one_is_final(gas):
    _, records, stage = gas
    estimator = ContactEstimator(SETTINGS, TRAY)
    estimates = [
        estimate
        for _, record in records
        if isinstance(record, SpeedEstimate | Rebound | PairCollision | FreeFlight)
        for estimate in estimator.push(record)
    ]
    assert len(estimates) >= 2
    assert all(isinstance(estimate, CorEstimate) for estimate in estimates)
    (final,) = estimator.flush()
    assert final.status is CorStatus.FINAL
    assert final.headline is Headline.CONTACTS
    alone = stage.summary().alone
    assert final.collisions == alone.beads.contacts
    assert final.rebounds == alone.walls.contacts
    assert final.restitution.value == pytest.approx(alone.beads.restitution.value)
    assert final.contact_wall_restitution.lower == pytest.approx(alone.walls.restitution.lower)


def test_time_that_goes_back_starts_afresh(gas):
    frames, _, _ = gas
    stage = ContactMeasurement(SETTINGS, TRAY, container_known=False)
    for image in (*frames[:60], frames[0]):
        stage.push(image)
    assert stage.contacts == 0
    assert stage.summary().frames == 1


def test_kinds_that_are_switched_off_are_left_out(gas):
    frames, _, _ = gas
    settings = PipelineSettings(
        preprocess=SETTINGS.preprocess,
        cooling=type(SETTINGS.cooling)(collisions=False),
    )
    stage = ContactMeasurement(settings, TRAY, container_known=False)
    records = [record for image in frames[:240] for record in stage.push(image)]
    records += stage.flush()
    assert any(isinstance(record, Rebound) for record in records)
    assert not any(isinstance(record, PairCollision) for record in records)
