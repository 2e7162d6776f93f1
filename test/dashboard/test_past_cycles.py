"""Cycles that are over can be opened again, as many as are kept."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import aiohttp
import pytest
from cycles_of_results import shifted, told

from nanorocks_ros.dashboard.board import Board, columns
from nanorocks_ros.dashboard.past_cycles import MOST_KEPT_POINTS
from nanorocks_ros.dashboard.tray_board import Cursor
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import NS, CorEstimate, CorStatus, SpeedEstimate
from nanorocks_ros.studies.results.record_columns import columns_of


def test_a_cycle_that_is_over_is_kept_as_it_was_shown(results):
    board = Board(load_trays())
    records = told(results, (1, 2))
    begun = next(k for k, record in enumerate(records) if record.cycle == 2)
    for record in records[:begun]:
        board.take(record, 0.0)
    running = board.news(Cursor(), 0.0)['trays']['1']
    assert (running['past'], board.past_cycle(1, 1)) == ([], None)
    for record in records[begun:]:
        board.take(record, 0.0)
    assert board.news(Cursor(), 0.0)['trays']['1']['past'] == [1]
    past = board.past_cycle(1, 1)
    assert (past.start, past.latest) == (running['start'], running['latest'])
    for name, rows in past.rows.items():
        assert rows == running[name]['rows']


def test_no_more_cycles_are_kept_than_set_and_none_of_before_a_restart(results):
    board = Board(load_trays(), kept_cycles=2)
    for record in told(results, (1, 2, 3, 4)):
        board.take(record, 0.0)
    assert board.news(Cursor(), 0.0)['trays']['1']['past'] == [2, 3]
    for record in told(results, (1,)):
        board.take(record, 0.0)
    assert board.news(Cursor(), 0.0)['trays']['1']['past'] == []


def test_an_estimate_that_comes_late_belongs_to_its_cycle(results):
    board = Board(load_trays())
    *cycle, final = told(results, (1,))
    assert isinstance(final, CorEstimate)
    assert final.status is CorStatus.FINAL
    for record in (*cycle, shifted(results.speeds[-1], 2)):
        board.take(record, 0.0)
    assert board.past_cycle(1, 1).latest['cor']['status'] == 'cooling'
    board.take(final, 0.0)
    past = board.past_cycle(1, 1)
    assert past.latest['cor']['status'] == 'final'
    last = past.rows['cor'][-1]
    assert last[:2] == pytest.approx([final.stamp_ns / NS, final.restitution.value])


def test_long_curves_are_thinned(results):
    board = Board(load_trays())
    speed = next(record for record in results.speeds if record.cycle == 1)
    for k in range(3 * MOST_KEPT_POINTS):
        board.take(replace(speed, stamp_ns=speed.stamp_ns + k * NS // 10), 0.0)
    last_ns = speed.stamp_ns + (3 * MOST_KEPT_POINTS - 1) * NS // 10
    board.take(replace(speed, stamp_ns=last_ns + NS, cycle=2), 0.0)
    rows = board.past_cycle(1, 1).rows['speed']
    assert len(rows) <= MOST_KEPT_POINTS + 1
    assert rows[-1][0] == pytest.approx(last_ns / NS)


def test_columns_are_named_as_in_the_tables():
    speed = tuple(column.name for column in columns_of(SpeedEstimate))
    assert columns()['speed'] == ['time', 'mean_projected_speed', 'mean_projected_speed_error']
    assert set(columns()['speed']) <= {'time', *speed}
    cor = tuple(column.name for column in columns_of(CorEstimate))
    assert set(columns()['cor']) <= {'time', *cor}


def test_a_past_cycle_is_asked_for_by_its_address(serve, results):
    server = serve(token='correct-horse-battery')
    for record in told(results, (1, 2)):
        server.take(record)

    async def ask(path, token):
        headers = {'Authorization': f'Bearer {token}'}
        address = f'http://127.0.0.1:{server.port}{path}'
        async with (
            aiohttp.ClientSession() as client,
            client.get(address, headers=headers) as answer,
        ):
            is_json = answer.content_type == 'application/json'
            return answer.status, await answer.json() if is_json else {}

    status, past = asyncio.run(ask('/cycles/1/1', 'correct-horse-battery'))
    assert (status, past['cycle']) == (200, 1)
    assert len(past['rows']['speed']) > 50
    for path in ('/cycles/1/2', '/cycles/9/1', '/cycles/1/999999999'):
        assert asyncio.run(ask(path, 'correct-horse-battery'))[0] == 404
    assert asyncio.run(ask('/cycles/1/1', 'a wrong token'))[0] == 401
    assert asyncio.run(ask('/cycles/1/x', 'correct-horse-battery'))[0] == 404
