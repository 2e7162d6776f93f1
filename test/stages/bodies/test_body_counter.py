"""Bodies counted in tracks of simulated gases, against the bodies of the simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.sticking import simulated
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import BodyEstimate, Merge, Tracks
from nanorocks_ros.settings import BodySettings, PipelineSettings, SimulationSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.stages.bodies.body_counter import BodyCounter

TRAY = load_trays()[1]
RATE, NS = 30.0, 1e9
ERROR = 8e-6


def _tracks(stamp_ns, positions, velocities, seen=None, ids=None):
    n = len(positions)
    return Tracks(
        stamp_ns=stamp_ns,
        tray=1,
        ids=np.arange(n, dtype=np.int32) if ids is None else ids,
        species=np.zeros(n, dtype=np.int32),
        displacement=np.zeros(2),
        positions=positions,
        position_errors=np.full(n, ERROR),
        velocities=velocities,
        velocity_errors=np.full(n, 1e-5),
        radii=np.full(n, 1e-3),
        radius_errors=np.full(n, 1e-5),
        seen=np.ones(n, dtype=bool) if seen is None else seen,
        expected=np.array([15], dtype=np.int32),
        cycle=1,
    )


def _gas(sticking_speed, seconds, seed=1, **values):
    """Tracks of each frame, with the body of each bead."""
    settings = SimulationSettings(
        sticking_speed=sticking_speed, seed=seed, first_shake=0.0, mean_speed=0.01, **values
    )
    gas, rng = ShakenTray(settings, TRAY), np.random.default_rng(seed)
    for moment in gas.moments(round(seconds * RATE)):
        positions = moment.positions[:, :2] + rng.normal(0.0, ERROR, (15, 2))
        yield (
            _tracks(moment.truth.stamp_ns, positions, moment.velocities[:, :2]),
            gas.bodies.copy(),
        )


def _estimates_and_merges(frames, settings=None):
    counter = BodyCounter(settings or PipelineSettings(), TRAY)
    records = [record for tracks in frames for record in counter.push(tracks)]
    records += counter.flush()
    return (
        [record for record in records if isinstance(record, BodyEstimate)],
        [record for record in records if isinstance(record, Merge)],
    )


@pytest.fixture(scope='module')
def sticky():
    return list(_gas(5e-3, 12.0))


def test_bodies_and_sizes_of_a_sticky_gas_agree_with_the_simulation(sticky):
    counts, _ = _estimates_and_merges([tracks for tracks, _ in sticky])
    truth = {tracks.stamp_ns: np.unique(b, return_counts=True)[1] for tracks, b in sticky}
    wrong = np.array([count.bodies.value - truth[count.stamp_ns].size for count in counts])
    sizes = np.array([(truth[count.stamp_ns] ** 2).sum() / 15 for count in counts])
    ratio = np.array([count.weighted_size.value for count in counts]) / sizes
    assert truth[counts[-1].stamp_ns].size < 5
    assert np.mean(wrong == 0.0) > 0.9
    assert ratio.mean() == pytest.approx(1.0, abs=0.05)
    last = counts[-1]
    assert last.mean_size.value == pytest.approx(15 / last.bodies.value)
    assert last.sizes.sum() == last.bodies.value


def test_bodies_of_grains_are_not_counted(sticky):
    """Their outlines change as they turn, so that free ones beside each other look bonded."""
    (kind,) = TRAY.species
    grains = replace(
        TRAY, species=(replace(kind, properties=load_trays()[7].species[1].properties),)
    )
    frames = [tracks for tracks, _ in sticky]
    for tray, gives in ((TRAY, True), (grains, False)):
        counter = BodyCounter(PipelineSettings(), tray)
        records = [record for tracks in frames for record in counter.push(tracks)]
        assert bool([*records, *counter.flush()]) is gives


def test_the_first_merge_has_the_time_of_the_simulated_one(sticky):
    counts, merges = _estimates_and_merges([tracks for tracks, _ in sticky])
    first = next(tracks.stamp_ns for tracks, b in sticky if np.unique(b).size < 15)
    found = min(merge.stamp_ns for merge in merges)
    assert found == pytest.approx(first, abs=0.1 * NS)
    assert all(merge.known_ns >= merge.stamp_ns + 0.3 * NS for merge in merges)
    assert [count.merged for count in counts] == [count.stamp_ns >= found for count in counts]
    assert sum(merge.joins for merge in merges) == 15 - counts[-1].bodies.value


def test_merges_of_bodies_that_turned_before_any_was_known_are_dated_to_when_beads_met():
    # All sticks within a second, and the first body is known after more than two.
    cycle = simulated(5, 3, seconds=4.0, sticking_speed=10.4e-3)
    assert min(merge.known_ns for merge in cycle.merges) > 2.0 * NS
    merged = -np.diff(cycle.bodies, prepend=80).astype(np.int64)
    true = np.repeat(cycle.times, merged)
    dated = np.sort([merge.stamp_ns / NS for merge in cycle.merges if merge.joins])
    assert dated.size > 70
    assert np.abs(dated - true[: dated.size]).mean() < 0.1


def test_a_gas_without_sticking_has_no_merge_and_fifteen_bodies():
    frames = [tracks for tracks, _ in _gas(0.0, 20.0, restitution=0.7)]
    counts, merges = _estimates_and_merges(frames)
    assert not merges
    assert {count.bodies.value for count in counts} == {15.0}
    assert not any(count.merged for count in counts)


def test_adjacent_beads_at_rest_are_no_body():
    rng = np.random.default_rng(2)
    columns, rows = np.meshgrid(np.arange(5), np.arange(3))
    positions = 2.0e-3 * np.column_stack([columns.ravel(), rows.ravel()]) + 2e-3
    still = np.zeros((15, 2))
    frames = [
        _tracks(int(k * NS / RATE), positions + rng.normal(0.0, ERROR, (15, 2)), still)
        for k in range(300)
    ]
    counts, merges = _estimates_and_merges(frames)
    assert not merges
    assert counts[-1].weighted_size.value == 1.0


def test_an_occluded_bead_stays_in_its_body_and_keeps_its_number():
    """In bodies that do not turn: it reappears where it was beside the others."""
    sticky = list(_gas(5e-3, 12.0, aggregate_motion='translating'))
    _, merges = _estimates_and_merges([tracks for tracks, _ in sticky])
    lost = int(merges[0].tracks[1])
    from_ns, to_ns = merges[0].known_ns + 1 * NS, merges[0].known_ns + 4 * NS
    frames = []
    for tracks, _ in sticky:
        if tracks.stamp_ns > from_ns:
            kept = tracks.ids != lost
            ids = np.where(kept, tracks.ids, 99).astype(np.int32)
            if tracks.stamp_ns > to_ns:
                kept[:] = True
            order = np.flatnonzero(kept)[np.argsort(ids[kept])]
            tracks = _tracks(
                tracks.stamp_ns, tracks.positions[order], tracks.velocities[order], ids=ids[order]
            )
        frames.append(tracks)
    counts, _ = _estimates_and_merges(frames)
    whole, _ = _estimates_and_merges([tracks for tracks, _ in sticky])
    differs = [
        estimate.bodies.value != complete.bodies.value
        for estimate, complete in zip(counts, whole, strict=True)
    ]
    assert np.mean(differs) < 0.1
    assert min(count.followed for count in counts) == 15


def test_unseen_beads_widen_the_error_and_count_as_single_ones(sticky):
    frames = [
        _tracks(tracks.stamp_ns, tracks.positions[:12], tracks.velocities[:12])
        for tracks, _ in sticky[:60]
    ]
    first = _estimates_and_merges(frames)[0][0]
    assert (first.beads, first.followed, first.bodies.value) == (15, 12, 15.0)
    assert first.bodies.error > 0.5


def test_a_body_that_breaks_is_two_bodies(sticky):
    counts, merges = _estimates_and_merges([tracks for tracks, _ in sticky])
    pair = next(merge.tracks for merge in merges if merge.joins)
    alone = next(count for count in counts if count.clusters.value == 1.0).stamp_ns + 2 * NS
    frames = []
    for tracks, _ in sticky:
        positions = tracks.positions.copy()
        if tracks.stamp_ns > alone:
            positions[pair[1]] += 5e-3 * (tracks.stamp_ns - alone) / NS * np.array([1.0, 0.3])
        frames.append(replace(tracks, positions=positions))
    parted, _ = _estimates_and_merges(frames)
    # Two seconds later it is 10 mm away, though all others went on as they were.
    at = next(k for k, count in enumerate(counts) if count.stamp_ns > alone + 2 * NS)
    assert parted[at].bodies.value > counts[at].bodies.value


def test_a_shaking_event_separates_all_beads(sticky):
    counter = BodyCounter(PipelineSettings(), TRAY)
    for tracks, _ in sticky:
        counter.push(tracks)
    later = [
        replace(tracks, stamp_ns=tracks.stamp_ns + sticky[-1][0].stamp_ns + 33_000_000, cycle=2)
        for tracks, _ in _gas(0.0, 3.0, seed=3)
    ]
    records = [record for tracks in later for record in counter.push(tracks)]
    estimates = [
        record
        for record in (*records, *counter.flush())
        if isinstance(record, BodyEstimate) and record.cycle == 2
    ]
    assert len(estimates) == 15
    assert {(estimate.bodies.value, estimate.merged) for estimate in estimates} == {(15.0, False)}


def test_a_stamp_that_goes_back_resets_the_counter(sticky):
    counter = BodyCounter(PipelineSettings(), TRAY)
    runs = [
        [record for tracks, _ in sticky[:120] for record in counter.push(tracks)] for _ in range(2)
    ]
    assert [record.stamp_ns for record in runs[0]] == [record.stamp_ns for record in runs[1]]


def test_flush_gives_the_estimates_of_the_last_instants(sticky):
    counts, merges = _estimates_and_merges([tracks for tracks, _ in sticky])
    last = [merge for merge in merges if merge.joins][-1]
    counter = BodyCounter(PipelineSettings(), TRAY)
    pushed = [
        record
        for tracks, _ in sticky
        if tracks.stamp_ns <= last.known_ns
        for record in counter.push(tracks)
    ]
    before = [record for record in pushed if isinstance(record, BodyEstimate)]
    # The merge itself is not held back; the estimates of the bodies it makes are.
    merged = [record for record in pushed if isinstance(record, Merge)]
    assert merged[-1].known_ns == last.known_ns
    held_back = counter.flush()
    assert held_back[0].stamp_ns > before[-1].stamp_ns
    assert held_back[-1].stamp_ns > last.known_ns - 0.2 * NS
    assert held_back[-1].bodies.value == counts[-1].bodies.value
    assert counter.flush() == ()


def test_reset_forgets_bodies_and_estimates(sticky):
    counter = BodyCounter(PipelineSettings(), TRAY)
    runs = []
    for _ in range(2):
        records = [record for tracks, _ in sticky for record in counter.push(tracks)]
        runs.append([record.stamp_ns for record in records])
        counter.reset()
        assert counter.flush() == ()
    assert runs[0] == runs[1]


def test_beads_that_stick_from_the_start_are_one_body_from_the_start():
    rng = np.random.default_rng(4)
    velocity = np.array([3e-3, 1e-3])
    columns, rows = np.meshgrid(np.arange(5), np.arange(3))
    positions = 1.99e-3 * np.column_stack([columns.ravel(), rows.ravel()]) + 2e-3
    frames = [
        _tracks(
            int(k * NS / RATE),
            positions + velocity * k / RATE + rng.normal(0.0, ERROR, (15, 2)),
            np.tile(velocity, (15, 1)),
        )
        for k in range(150)
    ]
    counts, merges = _estimates_and_merges(frames)
    assert counts[-1].bodies.value == 1.0
    assert counts[-1].first_merge_ns == merges[0].stamp_ns == 0


def test_an_empty_tray_has_unknown_estimates():
    nothing = np.empty((0, 2))
    counts, merges = _estimates_and_merges(
        [_tracks(int(k * NS / RATE), nothing, nothing) for k in range(60)]
    )
    assert not merges
    assert counts
    assert all(np.isnan(count.bodies.value) and np.isnan(count.bodies.error) for count in counts)


def test_one_bead_is_one_body():
    tray = replace(TRAY, species=(replace(TRAY.species[0], count=1),))
    counter = BodyCounter(PipelineSettings(), tray)
    positions = np.array([[5e-3, 5e-3]])
    for k in range(60):
        assert not counter.push(_tracks(int(k * NS / RATE), positions, np.zeros((1, 2))))
    estimates = counter.flush()
    assert {(estimate.bodies.value, estimate.bodies.error) for estimate in estimates} == {
        (1.0, 0.0)
    }


def test_fewer_false_alarms_delay_the_first_merge(sticky):
    known = []
    for rate in (1e-4, 0.01, 0.3):
        settings = PipelineSettings(bodies=BodySettings(false_alarm_rate=rate))
        _, merges = _estimates_and_merges(
            [tracks for tracks, _ in sticky[:200]], settings=settings
        )
        known.append(merges[0].known_ns)
    assert known[0] > known[1] > known[2]


def _doubled(frames, bead, start, shift):
    """Tracks in which one bead is detected twice from a frame on, `shift` apart."""
    for k, (tracks, _) in enumerate(frames):
        if k < start:
            yield tracks
            continue
        columns = {
            name: np.concatenate([getattr(tracks, name), getattr(tracks, name)[bead : bead + 1]])
            for name in (
                'species', 'position_errors', 'velocities', 'velocity_errors', 'radii',
                'radius_errors', 'seen',
            )
        }  # fmt: skip
        positions = np.vstack([tracks.positions, tracks.positions[bead] + (shift, 0.0)])
        ids = np.append(tracks.ids, 99).astype(np.int32)
        yield replace(tracks, ids=ids, positions=positions, **columns)


def test_a_double_detection_is_no_body():
    free = list(_gas(0.0, 8.0))
    for shift in (0.5e-3, 1.0e-3, 1.5e-3):
        _, merges = _estimates_and_merges(_doubled(free, 4, 60, shift))
        assert not merges


def test_no_estimate_is_made_while_tracks_break_often(sticky):
    frames = [tracks for tracks, _ in sticky]
    # Every track gets a new number every second.
    broken = [
        replace(tracks, ids=(tracks.ids + 100 * ((k + 2 * tracks.ids) // 30)).astype(np.int32))
        for k, tracks in enumerate(frames)
    ]
    counts, merges = _estimates_and_merges(frames)
    assert counts
    assert merges
    counts, merges = _estimates_and_merges(broken)
    assert not merges
    assert not [count for count in counts if count.stamp_ns > NS]


def test_a_bead_that_reappears_at_its_cluster_is_part_of_it(sticky):
    frames = [tracks for tracks, _ in sticky]
    truth = np.unique(sticky[-1][1], return_counts=True)[1]
    counts, _ = _estimates_and_merges(frames)
    assert counts[-1].bodies.value == truth.size
    # From 6 s on every bead has another number, as if all had been hidden for a moment.
    renamed = [
        replace(tracks, ids=(tracks.ids + 100 * (k > 180)).astype(np.int32))
        for k, tracks in enumerate(frames)
    ]
    counts, _ = _estimates_and_merges(renamed)
    assert counts[-1].bodies.value == pytest.approx(truth.size, abs=1.0)


def test_free_beads_of_a_dense_tray_that_stay_in_a_crowd_are_no_bodies():
    """Others keep a pair together there: with the parting of a thin gas it looked bonded."""
    assert not simulated(
        5, run=0, seed=7, seconds=8.0, restitution=0.5, wall_restitution=0.9
    ).merges
