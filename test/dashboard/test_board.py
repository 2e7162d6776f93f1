"""What a client is told, whenever it asks."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from nanorocks_ros.dashboard.board import Board, clean
from nanorocks_ros.dashboard.curves import MOST_POINTS
from nanorocks_ros.dashboard.tray_board import Cursor
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import (
    ClusterEstimate,
    CorEstimate,
    CorRelation,
    CorStatus,
    GroundTruth,
    Interval,
    Measured,
    Quality,
    SpeedEstimate,
    SpeedMethod,
)

NS = 1_000_000_000


def speed(seconds, cycle=1, value=0.005, start=1.0):
    return SpeedEstimate(
        stamp_ns=round(seconds * NS),
        tray=1,
        cycle=cycle,
        cycle_start_ns=round(start * NS),
        mean_projected_speed=Measured(value, 0.1 * value),
        window=0.1,
        method=SpeedMethod.TRACKING,
        quality=Quality.GLARE,
    )


def cor(seconds, cycle=1, status=CorStatus.COOLING, value=0.9):
    return CorEstimate(
        stamp_ns=round(seconds * NS),
        tray=1,
        cycle=cycle,
        status=status,
        relation=CorRelation.LIBRARY,
        restitution=Interval(value, value - 0.02, value + 0.02),
        window_end=seconds - 1.0,
    )


def truth(seconds, cycle=1):
    return GroundTruth(
        stamp_ns=round(seconds * NS),
        tray=1,
        cycle=cycle,
        mean_projected_speed=0.005,
        mean_speed=0.006,
        bodies=15,
        restitution=0.9,
        wall_restitution=0.8,
        sticking_speed=0.0,
    )


def times(news, name):
    return [row[0] for row in news[name]['rows']]


@pytest.fixture
def board():
    return Board(load_trays())


def follow(board, cursor, rows):
    """What a page makes of the news: points of the curve of the speed."""
    news = board.news(cursor, 0.0)['trays']['1']['speed']
    return rows[: news['from']] + news['rows']


def test_a_client_that_asks_seldom_has_the_same_curve_in_the_end(board):
    often, seldom = Cursor(), Cursor()
    rows = []
    for k in range(20):
        board.take(speed(1.0 + 0.1 * k, value=0.001 * (k + 1)), 0.0)
        rows = follow(board, often, rows)
    assert rows == follow(board, seldom, [])
    assert [row[1] for row in rows] == pytest.approx([0.001 * (k + 1) for k in range(20)])


def test_nobody_is_told_anything_twice(board):
    cursor = Cursor()
    board.take(speed(2.0), 0.0)
    board.diagnose([('/n', 0, 'working', [])], 0.0)
    assert set(board.news(cursor, 0.0)) == {'trays', 'nodes'}
    assert board.news(cursor, 0.0) == {}


def test_a_long_curve_is_thinned_and_told_anew(board):
    cursor, rows = Cursor(), []
    for k in range(3 * MOST_POINTS):
        board.take(speed(2.0 + 0.1 * k), 0.0)
        if k % 500 == 0:
            rows = follow(board, cursor, rows)
    rows = follow(board, cursor, rows)
    times = [row[0] for row in rows]
    assert len(rows) <= MOST_POINTS
    assert times == sorted(times)
    assert times[-1] == pytest.approx(2.0 + 0.1 * (3 * MOST_POINTS - 1))
    assert times[0] == 2.0


def test_a_new_cycle_begins_with_an_empty_curve_and_the_last_stays_as_a_number(board):
    cursor = Cursor()
    board.take(speed(2.0), 0.0)
    board.take(cor(2.0), 0.0)
    board.news(cursor, 0.0)
    board.take(speed(62.0, cycle=2, start=61.0), 0.0)
    board.take(cor(60.0, status=CorStatus.FINAL, value=0.88), 0.0)
    news = board.news(cursor, 0.0)['trays']['1']
    assert (news['cycle'], news['start']) == (2, 61.0)
    assert news['cor'] == {'from': 0, 'rows': []}
    assert [row[0] for row in news['speed']['rows']] == [62.0]
    assert 'cor' not in news['latest']
    assert news['finals'] == [[1, 0.88, 0.86, 0.9]]
    board.take(speed(62.1, cycle=2, start=61.0), 0.0)
    assert 'finals' not in board.news(cursor, 0.0)['trays']['1']


def test_what_is_late_of_the_cycle_before_is_not_shown_in_this_one(board):
    board.take(speed(62.0, cycle=2), 0.0)
    late = ClusterEstimate(
        stamp_ns=60 * NS, tray=1, cycle=1, level_area=1e-6, correlation_length=1e-3
    )
    board.take(late, 0.0)
    news = board.news(Cursor(), 0.0)['trays']['1']
    assert (news['cycle'], news['cluster']['rows']) == (2, [])


def test_a_source_that_starts_again_starts_the_page_again(board):
    for k in range(5):
        board.take(speed(50.0 + k), 0.0)
    board.take(cor(54.0, status=CorStatus.FINAL), 0.0)
    board.take(speed(2.0), 0.0)
    news = board.news(Cursor(), 0.0)['trays']['1']
    assert [row[0] for row in news['speed']['rows']] == [2.0]
    assert news['finals'] == []


def test_whoever_joins_in_the_middle_sees_results_beside_the_truth(board):
    # The truth counts cycles from the start of the simulator, the pipeline from when it joined.
    for k in range(5):
        board.take(truth(5.0 + k, cycle=3), 0.0)
        board.take(speed(5.5 + k, cycle=0, start=4.0), 0.0)
    news = board.news(Cursor(), 0.0)['trays']['1']
    assert (news['cycle'], news['start']) == (0, 4.0)
    assert times(news, 'speed') == [5.5, 6.5, 7.5, 8.5, 9.5]
    assert times(news, 'truth') == [5.0, 6.0, 7.0, 8.0, 9.0]
    assert set(news['latest']) == {'speed', 'truth'}


def test_the_truth_goes_over_to_the_cycle_in_whose_time_it_is(board):
    cursor = Cursor()
    for k in range(4):
        board.take(speed(57.0 + k), 0.0)
    for k in range(7):
        board.take(truth(57.0 + k, cycle=1 + (k > 3)), 0.0)
    board.news(cursor, 0.0)
    board.take(speed(61.5, cycle=2, start=61.0), 0.0)
    news = board.news(cursor, 0.0)['trays']['1']
    assert (news['truth']['from'], times(news, 'truth')) == (0, [61.0, 62.0, 63.0])
    assert 'truth' in news['latest']


def test_the_truth_before_a_node_joined_is_not_shown(board):
    for k in range(60):
        board.take(truth(k), 0.0)
    first = replace(speed(57.5, cycle=0), cycle_start_ns=None)
    board.take(first, 0.0)
    assert times(board.news(Cursor(), 0.0)['trays']['1'], 'truth') == [58.0, 59.0]


@pytest.mark.parametrize('truth_first', [True, False])
def test_a_source_that_starts_again_has_its_new_truth_alone(board, truth_first):
    cursor = Cursor()
    for k in range(5):
        board.take(speed(50.0 + k), 0.0)
        board.take(truth(50.0 + k), 0.0)
    board.news(cursor, 0.0)
    again = [speed(2.0), truth(2.1)]
    for record in reversed(again) if truth_first else again:
        board.take(record, 0.0)
    news = board.news(cursor, 0.0)['trays']['1']
    assert (news['truth']['from'], times(news, 'truth')) == (0, [2.1])
    assert (news['speed']['from'], times(news, 'speed')) == (0, [2.0])


def test_a_clock_of_the_truth_that_goes_back_alone_takes_no_result_away(board):
    cursor = Cursor()
    for k in range(3):
        board.take(speed(50.0 + k), 0.0)
        board.take(truth(50.0 + k), 0.0)
    board.news(cursor, 0.0)
    board.take(truth(2.0), 0.0)
    news = board.news(cursor, 0.0)['trays']['1']
    assert (news['truth']['from'], times(news, 'truth')) == (0, [2.0])
    assert 'speed' not in news
    assert len(times(board.news(Cursor(), 0.0)['trays']['1'], 'speed')) == 3


def test_the_truth_does_not_hide_that_nothing_is_measured_any_more(board):
    board.take(speed(2.0), 10.0)
    board.take(truth(3.0), 20.0)
    assert board.news(Cursor(), 20.0)['trays']['1']['age'] == 10.0


def test_a_merge_that_became_known_later_ends_the_curve_and_nothing_else(board):
    cursor = Cursor()
    board.take(speed(2.0), 0.0)
    board.take(cor(10.0, status=CorStatus.FINAL, value=0.8), 0.0)
    for k in range(5):
        board.take(speed(62.0 + k, cycle=2, start=61.0), 0.0)
        board.take(cor(62.0 + k, cycle=2), 0.0)
    board.news(cursor, 0.0)
    board.take(cor(64.5, cycle=2, status=CorStatus.FINAL, value=0.88), 0.0)
    news = board.news(cursor, 0.0)['trays']['1']
    assert 'speed' not in news
    assert news['cor']['from'] == 0
    assert [row[0] for row in news['cor']['rows']] == [62.0, 63.0, 64.0, 64.5]
    assert [record[:2] for record in news['finals']] == [[1, 0.8], [2, 0.88]]
    assert len(board.news(Cursor(), 0.0)['trays']['1']['speed']['rows']) == 5


def test_whoever_hears_estimates_before_speeds_knows_when_the_tray_was_shaken(board):
    board.take(cor(5.0), 0.0)
    assert board.news(Cursor(), 0.0)['trays']['1']['start'] == pytest.approx(1.0)


def test_what_is_not_known_is_null_and_states_are_words(board):
    board.take(speed(2.0), 0.0)
    board.take(replace(cor(2.0), haff_time=Measured(float('inf'))), 0.0)
    news = json.loads(json.dumps(board.news(Cursor(), 0.0), allow_nan=False))['trays']['1']
    assert news['latest']['cor']['haff_time'] is None
    assert news['latest']['cor']['wall_restitution'] is None
    assert news['latest']['cor']['status'] == 'cooling'
    assert news['latest']['speed']['quality'] == ['glare']
    (words,) = news['latest']['speed']['flags']
    assert words.startswith('reflections hide')
    assert 'reason' not in news['latest']['cor']
    assert news['description'] == '15 acrylic 2 mm'


def test_remedies_of_a_live_tray_need_no_recording(board):
    every = ~Quality(0)
    board.take(replace(speed(2.0), quality=every), 0.0)
    flags = board.news(Cursor(), 0.0)['trays']['1']['latest']['speed']['flags']
    assert len(flags) == len(every.names())
    assert any('on this page' in words for words in flags)
    assert not any('BAG' in words for words in flags)


def test_an_undetermined_restitution_says_why(board):
    board.take(replace(cor(2.0), status=CorStatus.NO_DECAY), 0.0)
    latest = board.news(Cursor(), 0.0)['trays']['1']['latest']['cor']
    assert latest['reason'] == 'the speeds do not fall'


def test_a_tray_is_shown_before_anything_is_measured(board):
    board.expect(3, 7.0)
    news = board.news(Cursor(), 9.0)['trays']['3']
    assert (news['age'], news['latest'], news['start']) == (2.0, {}, None)


def test_nodes_that_are_gone_are_forgotten_and_too_many_are_not_kept(board):
    board.diagnose([(f'/n{k}', 0, '', []) for k in range(1000)], 0.0)
    cursor = Cursor()
    kept = [node['name'] for node in board.news(cursor, 5.0)['nodes']]
    assert len(kept) == 64
    board.diagnose([('/n0', 3, 'hm', [('k', 'v')])], 100.0)
    (only,) = board.news(cursor, 101.0)['nodes']
    assert only == {
        'name': '/n0',
        'level': 'silent',
        'text': 'hm',
        'values': [['k', 'v']],
        'age': 1.0,
    }


def test_texts_from_outside_are_cut_and_cannot_turn_others_around():
    assert clean('a' * 500, 10) == 'a' * 9 + '…'
    assert clean('ok\u202egnorw\n\x00', 99) == 'ok\ufffdgnorw\ufffd\ufffd'
    assert clean('<b>Säule</b>', 99) == '<b>Säule</b>'
