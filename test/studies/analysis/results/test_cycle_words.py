"""Flags, reasons, contacts and sticking are said in words, each with a remedy."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from nanorocks_ros.records import (
    ClusterEstimate,
    CorEstimate,
    CorRelation,
    CorStatus,
    Headline,
    Interval,
    Measured,
    MeasuredInterval,
    Quality,
    SpeedEstimate,
    SpeedMethod,
    StickingStatus,
)
from nanorocks_ros.records.result_words import FLAGS, WallPrior, flags_in_words, reason_of
from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults
from nanorocks_ros.studies.analysis.results.cycle_lines import cycle_lines
from nanorocks_ros.studies.analysis.results.cycle_words import (
    UsedSpeeds,
    cycle_as_json,
    is_decay_left_out,
    tray_reason,
    used_speeds,
)
from nanorocks_ros.studies.analysis.results.results_json import as_json

NS = 1_000_000_000
NOTHING_WRONG = Quality(0)
FINAL = CorEstimate(
    stamp_ns=20 * NS,
    tray=1,
    cycle=1,
    status=CorStatus.FINAL,
    relation=CorRelation.LIBRARY,
    restitution=Interval(0.8912, 0.8801, 0.9011),
    wall_restitution=Interval(0.971, 0.966, 0.976),
    initial_speed=Measured(3.1e-3, 1e-4),
    haff_time=Measured(8.5, 0.4),
    paper_restitution=0.95,
    reduced_chi_square=1.0,
    samples=180,
    window_start=1.8,
    window_end=20.0,
    rebounds=20,
    collisions=31,
    tension=0.7,
)
CLUSTERS = ClusterEstimate(
    stamp_ns=20 * NS,
    tray=1,
    cycle=1,
    level_area=1e-6,
    correlation_length=1e-3,
    sticking_status=StickingStatus.MEASURED,
    sticking_speed=Interval(3.1e-3, 2.4e-3, 4.0e-3),
    onset=7.3,
)


def text_of(cor, clusters=None, *, left_out=False):
    return '\n'.join(cycle_lines(cor, clusters, UsedSpeeds(), left_out=left_out))


def speed(time, *, start=1.0, quality=NOTHING_WRONG, tray_speed=0.0):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=0 if start is None else 1,
        cycle_start_ns=None if start is None else round(start * NS),
        mean_projected_speed=Measured(2e-3, 1e-4),
        window=0.1,
        method=SpeedMethod.TRACKING,
        quality=quality,
        tray_speed=tray_speed,
    )


def test_every_flag_has_words_and_a_remedy():
    assert set(FLAGS) == set(Quality)
    assert all(words.text and words.remedy for words in FLAGS.values())


def test_a_cycle_is_said_with_what_it_rests_on():
    text = text_of(FINAL, CLUSTERS)
    assert 'COR 0.8912 [0.8801, 0.9011], walls 0.971 [0.966, 0.976]' in text
    assert "Haff's law: v0 3.10 +- 0.10 mm/s, tau 8.50 +- 0.40 s" in text
    assert '180 speeds from 1.8 to 20.0 s' in text
    assert '20 rebounds, 31 collisions' in text
    assert '0.7 standard deviations' in text
    assert 'beads stick below 3.1 mm/s [2.4, 4], from 7.3 s after the shaking event on' in text
    assert 'flag' not in text


@pytest.mark.parametrize(
    ('speed_error', 'time', 'time_error'),
    [(2221.0, 0.001, 0.298), (1e-4, 8.5, 6.0), (1e-4, float('nan'), float('nan'))],
)
def test_numbers_that_the_fit_does_not_know_are_not_printed(speed_error, time, time_error):
    cor = replace(
        FINAL, initial_speed=Measured(7.445, speed_error), haff_time=Measured(time, time_error)
    )
    text = text_of(cor)
    assert 'v0' not in text
    assert 'tau' not in text
    assert 'nan' not in text


def test_an_inconsistent_cycle_is_flagged_with_its_tension_and_left_out():
    cor = replace(
        FINAL,
        quality=Quality.INCONSISTENT,
        tension=5.06,
        headline=Headline.CONTACTS,
        decay_restitution=Interval(0.62, 0.5, 0.7),
        decay_wall_restitution=Interval(0.85, 0.8, 0.9),
        contact_restitution=FINAL.restitution,
        contact_wall_restitution=FINAL.wall_restitution,
        wall_friction=Measured(0.031, 0.008),
    )
    assert is_decay_left_out(cor, include_inconsistent=False)
    assert not is_decay_left_out(cor, include_inconsistent=True)
    assert not is_decay_left_out(FINAL, include_inconsistent=False)
    text = text_of(cor, left_out=True)
    assert 'from contacts alone, since decay and contacts differ by 5.1' in text
    assert 'friction of 0.031 +- 0.008' in text
    assert 'decay 0.620 [0.500, 0.700], walls 0.850' in text
    assert 'both unknown' in text
    assert 'flag inconsistent' in text
    assert '5.1 standard deviations' in text
    assert '--include-inconsistent' in text


def test_how_the_restitution_goes_with_speed_is_said():
    cor = replace(
        FINAL,
        quality=Quality.SPEED_DEPENDENT,
        headline=Headline.CONTACTS,
        restitution_exponent=Interval(0.55, 0.41, 0.7),
        impact_speed=1.42e-3,
        impact_restitution=Interval(0.86, 0.84, 0.88),
    )
    text = text_of(cor)
    assert 'contacts alone, since contacts at different speeds contradict a constant' in text
    assert 'restitution seems to depend on the impact speed; exponent of 1 - restitution: ' in text
    assert 'beads 0.55 [0.41, 0.70] at 1.42 mm/s' in text
    assert 'walls' not in text.split('exponent of 1 - restitution')[1].splitlines()[0]
    assert 'by that law, at these speeds: beads 0.860 [0.840, 0.880]; the COR above' in text
    assert 'in 5 % of cycles by chance' in text
    constant = replace(cor, quality=NOTHING_WRONG, headline=Headline.JOINT)
    assert 'need not depend' in text_of(constant)
    assert 'by that law' not in text_of(constant)
    assert 'allows for such a law' in text_of(constant)
    plain = replace(constant, joint_restitution=constant.restitution)
    assert 'allows for such a law' not in text_of(plain)
    assert 'depend' not in text_of(FINAL)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'window_start': float('nan'), 'samples': 3}, 'too few speeds'),
        ({'quality': Quality.WRONG_SCALE}, 'not where the settings say'),
        ({'status': CorStatus.NO_DECAY}, 'the speeds do not fall'),
        ({'reduced_chi_square': float('nan'), 'rebounds': 0}, 'those of grains'),
        ({}, 'with 20 rebounds and 31 collisions, allows almost any restitution'),
    ],
)
def test_why_a_cycle_is_undetermined_is_said_with_a_remedy(change, words):
    cor = replace(FINAL, **{'status': CorStatus.UNDETERMINED, **change})
    reason = reason_of(cor)
    assert words in reason.text
    assert reason.remedy
    text = text_of(cor)
    assert 'COR unknown' in text
    assert '0.8912' not in text
    assert words in text


@pytest.mark.parametrize(
    ('speeds', 'words'),
    [
        ([], 'no speed could be measured'),
        ([speed(4.0, start=None)], 'no shaking event was seen'),
        ([speed(4.0, tray_speed=5e-4)], 'tray moves at 0.5 mm/s'),
    ],
)
def test_why_a_tray_has_no_cycle_is_said(speeds, words):
    reason = tray_reason(TrayResults(speeds))
    assert words in reason.text
    assert reason.remedy
    analysis = Analysis(epoch_ns=0, trays={1: TrayResults(speeds)})
    tray = as_json(analysis)['trays']['1']
    assert tray['reason'] == {'text': reason.text, 'remedy': reason.remedy}
    assert tray['cycles'] == []


@pytest.mark.parametrize(
    ('status', 'limits', 'words'),
    [
        (StickingStatus.NO_MERGE, (0.0, 2e-4), 'no merge was seen; the sticking speed is below'),
        (StickingStatus.NO_UPPER_LIMIT, (2e-3, float('nan')), 'above 2 mm/s'),
        (StickingStatus.STUCK_FROM_THE_START, (float('nan'), float('nan')), 'from the start'),
        (StickingStatus.UNKNOWN, (float('nan'), float('nan')), 'not known'),
    ],
)
def test_sticking_is_said_in_every_state(status, limits, words):
    clusters = replace(
        CLUSTERS,
        sticking_status=status,
        sticking_speed=Interval(float('nan'), *limits),
        onset=float('nan'),
    )
    text = text_of(FINAL, clusters)
    assert words in text
    assert 'nan' not in text


def test_flags_are_counted_in_the_speeds_of_the_window():
    speeds = [speed(1.0 + 0.1 * k, quality=Quality(512 if k % 2 else 0)) for k in range(250)]
    cor = replace(FINAL, quality=Quality.UNCERTAIN)
    used = used_speeds(speeds, [cor])[0]
    assert used.methods[SpeedMethod.TRACKING] == 183
    assert used.flags['uncertain'] == 91
    text = '\n'.join(cycle_lines(cor, None, used, left_out=False))
    assert 'flag uncertain (91 of 180 speeds)' in text
    assert 'by tracking' in text


def test_clusters_by_the_autocorrelation_that_the_tracks_contradict_are_flagged():
    size = MeasuredInterval(2.4, 0.9, 1.8, 3.7)
    contradicted = replace(CLUSTERS, cluster_size=size, weighted_size=Measured(1.0, 0.0))
    assert 'the autocorrelation says 1.8 to 3.7 beads a cluster, the tracks 1.0' in text_of(
        FINAL, contradicted
    )
    agreed = replace(contradicted, weighted_size=Measured(2.1, 0.2))
    assert 'autocorrelation' not in text_of(FINAL, agreed)
    assert 'autocorrelation' not in text_of(FINAL, replace(agreed, weighted_size=Measured()))


@pytest.mark.parametrize(
    ('walls', 'flagged'),
    [
        (Interval(0.8006, 0.8000, 0.8034), True),
        (Interval(0.83, 0.8012, 0.88), True),
        (Interval(0.85, 0.82, 0.88), False),
        (Interval(0.97, 0.96, 0.98), False),
    ],
)
def test_walls_at_the_edge_of_what_is_allowed_are_flagged(walls, flagged):
    cor = replace(FINAL, wall_restitution=walls)
    flags = cycle_as_json(cor, None, UsedSpeeds(walls=WallPrior(lowest=0.8)))['flags']
    assert [flag['name'] for flag in flags] == ['wall_limit'] * flagged


@pytest.mark.parametrize(
    ('headline', 'walls', 'edge'),
    [
        (Headline.JOINT, Interval(0.782, 0.7801, 0.80), None),
        (Headline.JOINT, Interval(0.51, 0.5001, 0.53), '0.5 (prior.min_wall_restitution)'),
        (Headline.CONTACTS, Interval(0.51, 0.5001, 0.53), '0.5 (prior.min_wall_restitution)'),
        (Headline.JOINT, Interval(0.945, 0.93, 0.9499), '0.95 (prior.max_wall_restitution)'),
    ],
)
def test_the_flag_names_the_edge_that_the_walls_lean_on(headline, walls, edge):
    prior = WallPrior(lowest=0.5, highest=0.95)
    cor = replace(FINAL, wall_restitution=walls, headline=headline)
    flags = cycle_as_json(cor, None, UsedSpeeds(walls=prior))['flags']
    assert len(flags) == (edge is not None)
    assert edge is None or edge in flags[0]['text']


def test_the_json_says_the_same_as_the_terminal():
    cor = replace(FINAL, quality=Quality.INCONSISTENT | Quality.GLARE, headline=Headline.CONTACTS)
    values = cycle_as_json(cor, CLUSTERS, UsedSpeeds())
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert [flag['name'] for flag in values['flags']] == ['glare', 'inconsistent']
    assert [flag['text'] for flag in values['flags']] == [
        words.text for words in flags_in_words(cor.quality)
    ]
    assert (values['headline'], values['headline_reason']) == ('contacts', 'contacts alone')
    assert values['contacts'] == {'rebounds': 20, 'body_rebounds': 0, 'collisions': 31}
    assert values['reason'] is None
    assert values['sticking'].startswith('beads stick below 3.1 mm/s')
    results = TrayResults([speed(2.0 + k) for k in range(19)])
    results.add(cor)
    tray = as_json(Analysis(epoch_ns=0, trays={1: results}))['trays']['1']
    assert tray['decays_left_out'] == 1
    assert tray['cycles'][0]['flags'] == [{**flag, 'speeds': None} for flag in values['flags']]


def test_what_counts_where_beads_stick_is_said():
    cor = replace(
        FINAL,
        quality=Quality.STICKING,
        headline=Headline.CONTACTS,
        samples=0,
        window_start=float('nan'),
        window_end=float('nan'),
        tension=float('nan'),
        onset=0.42,
        body_rebounds=9,
    )
    text = text_of(cor)
    assert 'from contacts alone, since beads stick' in text
    assert 'used: 0 speeds, 20 rebounds (9 of bodies), 31 collisions' in text
    assert 'beads stick from 0.4 s on' in text
    assert 'nan' not in text
    assert 'flag sticking' in text
    unknown = replace(cor, status=CorStatus.UNDETERMINED, collisions=0)
    assert 'COR unknown, walls 0.971 [0.966, 0.976]' in text_of(unknown)
    assert '20 rebounds and 0 collisions tell too little of the beads' in text_of(unknown)
