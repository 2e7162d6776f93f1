"""Speeds in, restitutions out: provisional while cooling, final once per cycle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bent_flights import bent_flights
from contact_draws import drawn_collision
from wall_rebounds import wall_rebounds

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.physics.paper_formulas import paper_restitution_of_decay
from nanorocks_ros.records import (
    CorRelation,
    CorStatus,
    Headline,
    Measured,
    Merge,
    Quality,
    Rebound,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.stages.restitution.decay_library_method import DecayLibraryMethod
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

NS = 1_000_000_000
TRAY = load_trays()[1]


# A live estimate every 5 s: each takes as long as the final one.
SELDOM = {'cooling.update_interval': 5.0}
# A setting that tells that beads hardly rub, for cycles without rebounds.
SMOOTH = {'prior.friction': 0.001}


def fitter(**values):
    settings = with_values(PipelineSettings(), {**SELDOM, **values}, 'test')
    return RestitutionEstimator(settings, TRAY)


def speed(time, value, cycle=1, start=0.0):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=cycle,
        cycle_start_ns=round(start * NS) if cycle else None,
        mean_projected_speed=Measured(value, 0.02 * abs(value) + 1e-6),
        window=0.1,
        method=SpeedMethod.STRUCTURE_FUNCTION,
    )


def cooling_cycle(cycle=1, start=0.0, v0=6e-3, tau=5.0, until=25.0, noise=0.01):
    rng = np.random.default_rng(cycle)
    times = np.arange(0.1, until, 0.1)
    values = haff_speed(times, v0, tau) * np.exp(rng.normal(0, noise, times.size))
    return [speed(start + t, v, cycle, start) for t, v in zip(times, values, strict=True)]


def all_estimates(stage, speeds):
    return [record for item in speeds for record in stage.push(item)]


def simulated_cycle(cycle=1, start=0.0, restitution=0.89, wall=0.97):
    settings = SimulationSettings(restitution=restitution, wall_restitution=wall, seed=9)
    times = np.arange(0.1, 25.0, 0.1)
    (values,) = cooling_runs(settings, TRAY, times, [cycle]).mean_projected_speed
    return [speed(start + t, v, cycle, start) for t, v in zip(times, values, strict=True)]


def is_inside(final):
    """Whether the interval of 68 % holds the value, and lies in that of 95 %."""
    outer = final.restitution
    inner = outer.lower, final.restitution_lower_68, outer.value
    return sorted(inner) == list(inner) and outer.value < final.restitution_upper_68 < outer.upper


def test_a_library_gives_an_interval_of_68_percent_inside_the_other():
    *_, final = all_estimates(fitter(), simulated_cycle())
    assert is_inside(final)
    walls = final.wall_restitution
    assert walls.lower < final.wall_restitution_lower_68 < walls.value
    assert walls.value < final.wall_restitution_upper_68 < walls.upper
    narrow = all_estimates(fitter(**{'cooling.probability': 0.6827}), simulated_cycle())[-1]
    assert narrow.restitution.lower == pytest.approx(final.restitution_lower_68, abs=1e-12)
    assert narrow.restitution.upper == pytest.approx(final.restitution_upper_68, abs=1e-12)


def test_a_decay_is_read_by_the_closed_form_of_the_paper_when_that_is_asked_for():
    *_, final = all_estimates(fitter(**{'cooling.relation': 'paper'}), cooling_cycle())
    expected = paper_restitution_of_decay(1 / (6e-3 * 5.0), TRAY.diameter, TRAY.number_density)
    assert final.status is CorStatus.FINAL
    assert final.relation is CorRelation.PAPER
    assert final.restitution.lower < expected < final.restitution.upper
    assert final.paper_restitution == final.restitution.value
    assert is_inside(final)
    assert final.initial_speed.value == pytest.approx(6e-3, rel=0.02)
    assert final.haff_time.value == pytest.approx(5.0, rel=0.04)


def test_both_restitutions_of_a_simulated_gas_lie_in_their_intervals():
    *_, final = all_estimates(fitter(), simulated_cycle())
    assert final.status is CorStatus.FINAL
    assert final.relation is CorRelation.LIBRARY
    assert final.restitution.lower < 0.89 < final.restitution.upper
    assert final.wall_restitution.lower < 0.97 < final.wall_restitution.upper
    assert final.correlation < -0.5
    assert final.paper_restitution > 0.95
    assert 0.3 < final.reduced_chi_square < 2.5
    assert final.window_start == pytest.approx(1.8, abs=0.1)
    assert final.window_end == pytest.approx(20.0, abs=0.11)
    assert final.cooling_start == 0.0


def test_the_window_begins_when_the_tray_has_come_to_rest():
    speeds = [
        replace(record, tray_speed=5e-3 * math.exp(-0.3 * record.stamp_ns / NS))
        for record in simulated_cycle()
    ]
    *_, final = all_estimates(fitter(), speeds)
    by_hand = next(
        record for record in speeds if record.tray_speed < 0.05 * record.mean_projected_speed.value
    )
    assert final.window_start == pytest.approx(by_hand.stamp_ns / NS)
    assert final.window_start > 8.0
    assert final.cooling_start == pytest.approx(final.window_start - 1.75, abs=0.01)
    # Afterwards a noisy reading does not end it.
    jolted = [*speeds[:200], replace(speeds[200], tray_speed=1.0), *speeds[201:]]
    *_, same = all_estimates(fitter(), jolted)
    assert same.window_start == final.window_start


def test_a_gas_that_a_swinging_tray_left_alone_late_is_not_taken_for_one_just_shaken():
    tray, beads, walls = load_trays()[7], 0.76, 0.65
    settings = SimulationSettings(
        restitution=beads, wall_restitution=walls, mean_speed=7.4e-3, seed=9
    )
    times = np.arange(0.1, 25.0, 0.1)
    known = {'prior.min_wall_restitution': walls, 'prior.max_wall_restitution': walls}
    options = with_values(
        PipelineSettings(), {**SELDOM, **known, 'cooling.update_interval': 60.0}, 'test'
    )
    finals = []
    for values in cooling_runs(settings, tray, times, range(4)).mean_projected_speed:
        stage = RestitutionEstimator(options, tray)
        for time, value in zip(times, values, strict=True):
            # The tray is slower than a twentieth of the beads after some 18 s.
            swing = 1.3e-3 * math.exp(-0.22 * time)
            stage.push(replace(speed(time, value), tray=7, tray_speed=swing))
        finals += stage.flush()
    assert all(final.cooling_start > 10.0 for final in finals)
    # Where the interval is too wide to be the headline it is still told.
    intervals = [final.decay_restitution for final in finals]
    assert all(interval.lower < beads < interval.upper for interval in intervals)
    assert abs(np.mean([interval.value for interval in intervals]) - beads) < 0.16


def test_next_to_elastic_beads_have_a_restitution_though_no_haff_time():
    speeds = [speed(t, 6e-3 * (1.0 - 1e-4 * t)) for t in np.arange(0.1, 25.0, 0.1)]
    *_, final = all_estimates(fitter(), speeds)
    assert final.status is CorStatus.FINAL
    assert final.restitution.lower > 0.9
    assert final.haff_time.value > 1000.0


def test_a_window_from_the_shake_to_the_next_day_is_no_trouble():
    speeds = [speed(t, 6e-3 / (1.0 + t / 5.0)) for t in np.geomspace(0.01, 900.0, 300)]
    long = {'cooling.delay': 0.0, 'cooling.duration': 3600.0, 'cooling.update_interval': 60.0}
    stage = fitter(**long)
    all_estimates(stage, speeds)
    (final,) = stage.flush()
    assert final.status is CorStatus.FINAL
    assert 0.0 < final.restitution.lower < final.restitution.value < final.restitution.upper <= 1.0


def test_a_tray_that_swings_to_the_end_gives_no_estimate():
    stage = fitter()
    assert (
        all_estimates(stage, [replace(record, tray_speed=0.01) for record in simulated_cycle()])
        == []
    )
    assert stage.flush() == ()


def test_walls_that_are_known_leave_the_beads_to_be_found():
    known = {
        'prior.min_wall_restitution': 0.97,
        'prior.max_wall_restitution': 0.97,
        'prior.floor_lid_spread': 0.0,
    }
    *_, final = all_estimates(fitter(**known), simulated_cycle())
    *_, free = all_estimates(fitter(), simulated_cycle())
    assert final.wall_restitution.value == pytest.approx(0.97)
    assert abs(final.restitution.value - 0.89) < 0.06
    width = final.restitution.upper - final.restitution.lower
    assert width < 0.7 * (free.restitution.upper - free.restitution.lower)


def test_the_interval_tightens_as_the_gas_cools():
    estimates = all_estimates(fitter(**{'cooling.update_interval': 0.5}), simulated_cycle())
    widths = [record.restitution.upper - record.restitution.lower for record in estimates]
    assert len(estimates) > 20
    assert [record.status for record in estimates].count(CorStatus.FINAL) == 1
    assert widths[-1] < 0.7 * widths[0]


def test_a_decay_that_tells_too_little_says_so():
    vague = [
        replace(
            record,
            mean_projected_speed=Measured(
                record.mean_projected_speed.value, 0.8 * record.mean_projected_speed.value
            ),
        )
        for record in simulated_cycle()
    ]
    first, *_ = all_estimates(fitter(), vague)
    assert first.status is CorStatus.UNDETERMINED
    assert (first.restitution.lower, first.restitution.upper) == (0.0, 1.0)
    assert math.isnan(first.restitution.value)
    assert first.initial_speed.value > 0.0


def test_what_was_wrong_with_the_pictures_goes_with_the_estimate():
    speeds = simulated_cycle()
    speeds[60] = replace(speeds[60], quality=Quality.GLARE)
    *_, final = all_estimates(fitter(**SMOOTH), speeds)
    assert final.quality is Quality.GLARE


def test_a_flag_that_comes_after_the_last_speed_is_on_the_final_estimate_of_its_cycle_alone():
    stage = fitter(**SMOOTH)
    # Shorter than the window: the end of the recording ends the cycle.
    all_estimates(stage, simulated_cycle()[:100])
    stage.flag_cycle(Quality.DOUBTFUL_SCALE)
    (final,) = stage.flush()
    assert final.status is CorStatus.FINAL
    assert final.quality is Quality.DOUBTFUL_SCALE
    *_, following = all_estimates(stage, simulated_cycle(cycle=2, start=20.0))
    assert following.cycle == 2
    assert following.quality == 0


def test_of_trays_that_are_not_where_the_settings_say_nothing_is_told():
    stage = fitter()
    wrong = [replace(record, quality=Quality.WRONG_SCALE) for record in simulated_cycle()]
    estimates = all_estimates(stage, wrong)
    assert {record.status for record in estimates} == {CorStatus.UNDETERMINED}
    assert all(
        (record.restitution.lower, record.restitution.upper) == (0.0, 1.0) for record in estimates
    )
    assert estimates[-1].quality is Quality.WRONG_SCALE
    assert stage.evidence is None


def test_evidence_that_another_version_wrote_is_refused():
    stage = fitter()
    all_estimates(stage, simulated_cycle())
    stage.flush()
    arrays = stage.evidence.arrays()
    read = CycleLikelihoods.from_arrays(arrays, 'evidence.npz')
    assert np.array_equal(read.contacts.beads, stage.evidence.contacts.beads)
    # With one nuisance fewer, of contacts or of the decay.
    fewer_beads = {**arrays, 'contacts.beads': arrays['contacts.beads'][:-1]}
    gradient = arrays['decay.gradient'][..., :-1]
    half = gradient.shape[-1] * (gradient.shape[-1] + 1) // 2
    information = arrays['decay.information'][..., :half]
    fewer_nuisances = {
        **arrays,
        'decay.gradient': gradient,
        'decay.information': information,
    }
    for old in (fewer_beads, fewer_nuisances):
        with pytest.raises(FitError, match=r'evidence\.npz: .*analyse the recording again'):
            CycleLikelihoods.from_arrays(old, 'evidence.npz')


def test_a_cycle_that_the_next_shake_cuts_short_is_final_then():
    speeds = cooling_cycle(until=10.0) + cooling_cycle(cycle=2, start=10.0, until=3.0)
    finals = [
        estimate
        for estimate in all_estimates(fitter(), speeds)
        if estimate.status is CorStatus.FINAL
    ]
    assert [record.cycle for record in finals] == [1]


def test_the_end_of_the_recording_ends_the_cycle():
    stage = fitter()
    all_estimates(stage, cooling_cycle(until=10.0))
    (final,) = stage.flush()
    assert final.status is CorStatus.FINAL
    assert stage.flush() == ()


def test_the_mean_of_the_paper_is_over_the_final_estimates():
    stage = fitter(**{'cooling.relation': 'paper'})
    finals = []
    for cycle in (1, 2, 3):
        speeds = cooling_cycle(cycle, start=60.0 * (cycle - 1), noise=0.05)
        finals += [
            estimate
            for estimate in all_estimates(stage, speeds)
            if estimate.status is CorStatus.FINAL
        ]
    values = [record.restitution.value for record in finals]
    assert finals[-1].mean_restitution.value == pytest.approx(np.mean(values))
    assert finals[-1].mean_restitution.error == pytest.approx(np.std(values, ddof=1) / 3**0.5)


def test_many_cycles_together_say_more():
    stage = fitter(**{'prior.min_wall_restitution': 0.97, 'prior.max_wall_restitution': 0.97})
    finals = []
    for cycle in range(1, 7):
        speeds = simulated_cycle(cycle, start=60.0 * (cycle - 1))
        finals += [
            estimate
            for estimate in all_estimates(stage, speeds)
            if estimate.status is CorStatus.FINAL
        ]
    assert finals[-1].mean_restitution.error < 0.8 * finals[0].mean_restitution.error
    off = finals[-1].mean_restitution.value - 0.89
    assert abs(off) < 3.0 * finals[-1].mean_restitution.error


def test_another_tray_than_that_of_the_library_is_refused_at_once():
    tray = replace(TRAY, dimensions=(0.02, 0.02, 0.003))
    with pytest.raises(ConfigurationError, match='nanorocks library --tray 1'):
        RestitutionEstimator(PipelineSettings(), tray)


def test_nothing_is_said_before_the_first_shake():
    speeds = [speed(t, 5e-3, cycle=0) for t in np.arange(0.1, 20.0, 0.1)]
    assert all_estimates(fitter(), speeds) == []


def test_speeds_that_rise_are_no_decay_and_the_interval_says_so():
    speeds = [speed(t, 1e-3 * (1 + t)) for t in np.arange(0.1, 25.0, 0.1)]
    *_, final = all_estimates(fitter(), speeds)
    assert final.status is CorStatus.NO_DECAY
    assert (final.restitution.lower, final.restitution.upper) == (0.0, 1.0)
    assert math.isnan(final.restitution.value)


def test_too_few_speeds_give_no_estimate():
    stage = fitter()
    assert all_estimates(stage, cooling_cycle(until=1.0)) == []
    assert stage.flush() == ()


def test_unknown_speeds_are_left_out():
    speeds = cooling_cycle()
    broken = [*speeds[:50], speed(5.05, math.nan), speed(5.06, 0.0), *speeds[50:]]
    *_, clean = all_estimates(fitter(), speeds)
    *_, other = all_estimates(fitter(), broken)
    assert other.restitution.value == clean.restitution.value


def test_time_that_goes_back_starts_all_afresh():
    stage = fitter()
    first = all_estimates(stage, cooling_cycle())
    again = all_estimates(stage, cooling_cycle())
    assert repr(again) == repr(first)


def test_the_asked_probability_widens_the_interval():
    *_, narrow = all_estimates(fitter(**{'cooling.probability': 0.68}), cooling_cycle())
    *_, wide = all_estimates(fitter(**{'cooling.probability': 0.95}), cooling_cycle())
    assert narrow.restitution.value == pytest.approx(wide.restitution.value)
    assert narrow.restitution.lower > wide.restitution.lower


def test_walls_the_wrong_way_round_are_refused_at_once():
    with pytest.raises(
        ConfigurationError,
        match=r'prior.min_wall_restitution, prior.max_wall_restitution: 0.95 to 0.9',
    ):
        fitter(**{'prior.min_wall_restitution': 0.95, 'prior.max_wall_restitution': 0.9})


def half_width(estimate):
    return 0.5 * (estimate.restitution.upper - estimate.restitution.lower)


def test_rebounds_fix_the_walls_and_through_the_valley_the_beads():
    speeds = simulated_cycle()
    seen = list(wall_rebounds(np.random.default_rng(1), 80, 2.0, 17.0))
    *_, without = all_estimates(fitter(), speeds)
    *_, final = all_estimates(fitter(), by_stamp([*speeds, *seen]))
    assert (without.rebounds, final.rebounds) == (0, 80)
    assert final.wall_restitution.lower < 0.97 < final.wall_restitution.upper
    assert final.wall_restitution.upper - final.wall_restitution.lower < 0.03
    assert final.restitution.lower < 0.89 < final.restitution.upper
    assert half_width(final) < 0.7 * half_width(without)
    assert final.tension < 2.5
    assert not final.quality & Quality.INCONSISTENT
    *_, off = all_estimates(fitter(**{'cooling.rebounds': False}), by_stamp([*speeds, *seen]))
    assert off == without


def by_stamp(records):
    return sorted(records, key=lambda record: record.stamp_ns)


def test_it_does_not_matter_when_in_two_seconds_a_contact_comes_in():
    speeds = simulated_cycle()
    seen = list(wall_rebounds(np.random.default_rng(1), 40, 1.0, 22.0))
    late = sorted(
        [*speeds, *seen],
        key=lambda record: record.stamp_ns + int(1.9 * NS) * isinstance(record, Rebound),
    )
    estimates = all_estimates(fitter(), by_stamp([*speeds, *seen]))
    assert all_estimates(fitter(), late) == estimates
    *_, final = estimates
    first, last = 1.75 * NS, (final.window_end - 2.0) * NS
    assert final.rebounds == sum(first <= contact.stamp_ns <= last for contact in seen) < 40


def test_at_the_end_of_a_recording_contacts_count_up_to_the_last_speed():
    speeds = [estimate for estimate in simulated_cycle() if estimate.stamp_ns < 15 * NS]
    seen = list(wall_rebounds(np.random.default_rng(1), 40, 2.0, 16.0))
    last_ns = speeds[-1].stamp_ns
    expected = sum(contact.stamp_ns <= last_ns for contact in seen)
    ripe = sum(contact.stamp_ns <= last_ns - 2 * NS for contact in seen)
    assert ripe < expected < 40
    ended, interrupted = fitter(), fitter()
    for record in by_stamp([*speeds, *seen]):
        ended.push(record)
        interrupted.push(record)
    (final,) = ended.flush()
    assert final.rebounds == expected
    # After a loop or a seek it is not known which contacts are still on their way.
    (final,) = interrupted.push(speeds[0])
    assert final.rebounds == ripe


def test_contacts_in_a_tray_that_swings_count_though_speeds_do_not():
    swinging = [
        replace(record, tray_speed=1.0 if record.stamp_ns < 8.0 * NS else 0.0)
        for record in simulated_cycle()
    ]
    seen = list(wall_rebounds(np.random.default_rng(1), 60, 0.5, 20.0))
    *_, final = all_estimates(fitter(), by_stamp([*swinging, *seen]))
    assert final.window_start == pytest.approx(8.0, abs=0.11)
    last = (final.window_end - 2.0) * NS
    expected = sum(1.75 * NS <= contact.stamp_ns <= last for contact in seen)
    assert final.rebounds == expected > sum(contact.stamp_ns > 8.0 * NS for contact in seen)


def test_rebounds_that_the_decay_cannot_go_with_are_flagged():
    seen = wall_rebounds(np.random.default_rng(1), 80, 2.0, 17.0, wall=0.8)
    # With walls of 0.8 no gas could have cooled so slowly.
    speeds = simulated_cycle(restitution=0.95, wall=1.0)
    *_, final = all_estimates(fitter(), by_stamp([*speeds, *seen]))
    assert final.tension > 3.0
    assert final.quality & Quality.INCONSISTENT


def test_a_friction_that_neither_rebounds_nor_a_setting_tell_is_flagged():
    speeds = simulated_cycle()
    seen = list(wall_rebounds(np.random.default_rng(1), 40, 2.0, 17.0))
    stage, method = fitter(), DecayLibraryMethod(PipelineSettings(), TRAY)
    *_, without = all_estimates(stage, speeds)
    assert without.quality == Quality.FRICTION_UNKNOWN
    assert method.mean_of(stage.evidence).quality == Quality.FRICTION_UNKNOWN
    *_, few = all_estimates(fitter(), by_stamp([*speeds, *seen[:2]]))
    assert (few.rebounds, few.quality) == (2, Quality.FRICTION_UNKNOWN)
    *_, many = all_estimates(stage, by_stamp([*speeds, *seen]))
    assert not many.quality
    assert not method.mean_of(stage.evidence).quality
    *_, told = all_estimates(fitter(**SMOOTH), speeds)
    assert not told.quality


def test_walls_whose_restitution_depends_on_speed_are_flagged():
    rng = np.random.default_rng(1)
    seen = wall_rebounds(
        rng, 80, 2.0, 17.0, wall=lambda speed: 1.0 - 0.1 * speed / 2e-3, error=2e-5
    )
    *_, final = all_estimates(fitter(), by_stamp([*simulated_cycle(wall=0.9), *seen]))
    assert final.quality & Quality.SPEED_DEPENDENT
    assert final.headline is Headline.CONTACTS
    assert final.wall_restitution_exponent.lower < 1.0 < final.wall_restitution_exponent.upper
    outer, inner = (
        final.wall_restitution_exponent,
        (
            final.wall_restitution_exponent_lower_68,
            final.wall_restitution_exponent_upper_68,
        ),
    )
    assert outer.lower < inner[0] < outer.value < inner[1] < outer.upper
    assert final.wall_impact_speed == pytest.approx(2.3e-3, rel=0.1)
    truth = 1.0 - 0.1 * final.wall_impact_speed / 2e-3
    assert final.wall_impact_restitution.lower < truth < final.wall_impact_restitution.upper
    # Fast rebounds lose more, and count more than in the constant restitution beside.
    assert final.wall_restitution.value < final.contact_wall_restitution.value
    # Without collisions nothing is known of the beads.
    assert math.isnan(final.restitution_exponent.value)
    assert math.isnan(final.impact_speed)


def test_walls_of_constant_restitution_are_not():
    seen = wall_rebounds(np.random.default_rng(2), 80, 2.0, 17.0)
    *_, final = all_estimates(fitter(), by_stamp([*simulated_cycle(), *seen]))
    assert Quality.SPEED_DEPENDENT not in final.quality
    assert final.wall_restitution_exponent.lower < 0.0 < final.wall_restitution_exponent.upper


def with_flights(drag, acceleration=(0.0, 0.0)):
    """The final estimate of a simulated cycle in vacuum, with such flights and 40 rebounds."""
    rebounds = wall_rebounds(np.random.default_rng(1), 40, 2.0, 17.0)
    flights = bent_flights(200, drag, acceleration, first_ns=2 * NS)
    *_, final = all_estimates(fitter(), by_stamp([*simulated_cycle(), *rebounds, *flights]))
    return final


def test_flights_give_drag_and_an_upper_limit_of_the_acceleration():
    final = with_flights(0.0)
    assert abs(final.drag.value) < 3.0 * final.drag.error < 0.01
    assert 0.0 < final.acceleration.upper < 2e-5
    assert Quality.ACCELERATED not in final.quality
    assert final.headline is Headline.JOINT


def test_without_flights_neither_is_known():
    *_, final = all_estimates(fitter(), simulated_cycle())
    assert not final.drag.known
    assert math.isnan(final.acceleration.upper)


def test_a_drag_is_taken_out_of_the_decay():
    still, slowed = with_flights(0.0), with_flights(0.03)
    assert slowed.drag.value == pytest.approx(0.03, abs=0.003)
    # Part of the cooling is that of the gas: the beads lose less than without it.
    assert slowed.decay_restitution.value > still.decay_restitution.value + 0.01


def test_a_decay_of_accelerated_beads_does_not_count():
    final = with_flights(0.0, (2e-4, 0.0))
    assert final.quality & Quality.ACCELERATED
    assert final.headline is Headline.CONTACTS
    assert final.acceleration.lower < 2e-4 < final.acceleration.upper
    assert final.wall_restitution == final.contact_wall_restitution


def test_a_small_acceleration_is_published_without_a_flag():
    final = with_flights(0.0, (1.5e-5, 0.0))
    assert final.acceleration.lower > 0.0
    assert Quality.ACCELERATED not in final.quality


def test_contacts_of_all_cycles_count_in_the_mean():
    rng = np.random.default_rng(3)
    stage, finals = fitter(), []
    for cycle in (1, 2, 3, 4):
        start = 30.0 * cycle
        records = [
            *simulated_cycle(cycle, start),
            *wall_rebounds(rng, 30, start + 2.0, start + 17.0),
        ]
        estimates = all_estimates(stage, by_stamp(records))
        finals += [record for record in estimates if record.status is CorStatus.FINAL]
    assert [estimate.rebounds for estimate in finals] == [30] * 4
    first, last = finals[0], finals[-1]
    assert last.mean_wall_restitution.value == pytest.approx(
        0.97, abs=3.0 * last.mean_wall_restitution.error
    )
    ratio = first.mean_wall_restitution.error / last.mean_wall_restitution.error
    assert ratio == pytest.approx(2.0, abs=0.6)


def merge(time, cycle=1, known=1.0):
    return Merge(
        stamp_ns=round(time * NS),
        known_ns=round((time + known) * NS),
        tray=1,
        cycle=cycle,
        tracks=np.array([1, 2], dtype=np.int32),
        joins=True,
    )


def as_known(records):
    return sorted(
        records,
        key=lambda record: record.known_ns if isinstance(record, Merge) else record.stamp_ns,
    )


def test_the_decay_ends_with_the_first_merge():
    speeds = simulated_cycle()
    *_, cut = all_estimates(fitter(**{'cooling.duration': 12.0}), speeds)
    estimates = all_estimates(fitter(), as_known([*speeds, merge(12.05), merge(14.0)]))
    (final,) = [record for record in estimates if record.status is CorStatus.FINAL]
    assert final.onset == pytest.approx(12.05)
    assert (final.window_end, final.samples) == (cut.window_end, cut.samples)
    assert final.decay_restitution == cut.decay_restitution
    assert final.quality == Quality.STICKING | Quality.FRICTION_UNKNOWN
    *_, later = all_estimates(fitter(**{'cooling.until_merge': False}), [*speeds, merge(12.05)])
    assert later.window_end == pytest.approx(20.0, abs=0.11)
    assert math.isnan(later.onset)


def test_a_gas_whose_beads_stick_at_once_and_meet_nothing_tells_nothing():
    for time in (0.5, 2.0):
        estimates = all_estimates(fitter(), as_known([*simulated_cycle(), merge(time, known=0.4)]))
        assert {estimate.status for estimate in estimates} == {CorStatus.UNDETERMINED}
        last = estimates[-1]
        assert (last.restitution.lower, last.restitution.upper) == (0.0, 1.0)
        assert math.isnan(last.restitution.value)
        assert last.headline is Headline.CONTACTS
        assert math.isnan(last.decay_restitution.lower)
        assert last.cycle == 1


def test_a_merge_that_is_known_before_the_first_speed_of_its_cycle_counts():
    first = merge(0.05)
    *_, final = all_estimates(fitter(), [first, *simulated_cycle()])
    assert final.onset == pytest.approx(0.05)
    assert final.samples == 0


def test_a_merge_of_another_cycle_ends_no_window():
    stage = fitter()
    records = [merge(0.1, cycle=0), *simulated_cycle(), merge(19.0, cycle=2)]
    *_, final = all_estimates(stage, records)
    assert final.status is CorStatus.FINAL
    assert final.window_end == pytest.approx(20.0, abs=0.11)


@pytest.mark.parametrize('method', [SpeedMethod.STRUCTURE_FUNCTION, SpeedMethod.TRACKING])
def test_speeds_of_grains_have_errors_of_their_own_by_either_method(method):
    tray = load_trays()[8]
    settings = SimulationSettings(tray=8, restitution=0.89, wall_restitution=0.97, seed=9)
    times = np.arange(0.5, 12.0, 0.1)
    (values,) = cooling_runs(settings, tray, times, [1]).mean_projected_speed
    speeds = [
        replace(speed(t, v), tray=8, method=method) for t, v in zip(times, values, strict=True)
    ]
    exact = {'prior.grain_scale_error': 0.0, 'prior.grain_speed_bias': 0.01}
    widths = []
    for told in ({}, exact):
        values = with_values(PipelineSettings(), {**SELDOM, **told}, 'test')
        stage = RestitutionEstimator(values, tray)
        *_, grains = [*all_estimates(stage, speeds), *stage.flush()]
        assert grains.status is CorStatus.FINAL
        assert grains.restitution.lower < 0.89 < grains.restitution.upper
        assert math.isfinite(grains.haff_time.value)
        widths.append(grains.restitution.upper - grains.restitution.lower)
    assert widths[0] > 1.5 * widths[1]


@pytest.mark.parametrize(('number', 'counted'), [(3, 12), (7, 0)])
def test_collisions_of_beads_among_grains_do_not_count(number, counted):
    tray = load_trays()[number]
    rng = np.random.default_rng(4)
    contacts = [
        replace(drawn_collision(rng, 0.6), stamp_ns=k * NS, tray=number, cycle=1)
        for k in range(3, 15)
    ]
    rebounds = list(wall_rebounds(rng, 30, 2.0, 17.0))
    stage = RestitutionEstimator(with_values(PipelineSettings(), SELDOM, 'test'), tray)
    *_, final = all_estimates(stage, by_stamp([*cooling_cycle(), *contacts, *rebounds]))
    assert (final.collisions, final.rebounds) == (counted, 30)
    assert math.isnan(final.contact_restitution.value) is (counted == 0)
