"""Jobs that keep the results of their tasks until their output is written."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.file_steps import kill_at_each_step
from nanorocks_ros.jobs.resumed_tasks import fill_journal, parts_folder, resumed_journal
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.npz_archive import write_archive

HERE = Workers(processes=1)
TASKS = {f'{number}': number for number in range(5)}


def squared(number):
    return {'square': np.array(number**2)}


def interrupt_after(count):
    def press(done, total):
        if done == count:
            raise KeyboardInterrupt

    return press


def test_an_interrupted_job_runs_only_the_missing_tasks(tmp_path):
    output, reported = tmp_path / 'a.npz', []
    text = r'3 of 5 parts are kept in .*a\.npz\.parts; the same command'
    with (
        pytest.raises(KeyboardInterrupt, match=text),
        resumed_journal(output, '{}') as journal,
    ):
        fill_journal(journal, squared, TASKS, HERE, interrupt_after(3))
    with resumed_journal(output, '{}') as journal:
        fill_journal(journal, squared, TASKS, HERE, lambda *counts: reported.append(counts))
        squares = [int(journal.read(key)['square']) for key in TASKS]
    assert reported == [(3, 5), (4, 5), (5, 5)]
    assert squares == [0, 1, 4, 9, 16]
    assert not parts_folder(output).exists()


def test_a_damaged_part_is_reported_and_made_again(tmp_path):
    output, notices = tmp_path / 'a.npz', []
    with pytest.raises(KeyboardInterrupt), resumed_journal(output, '{}') as journal:
        fill_journal(journal, squared, TASKS, HERE, interrupt_after(2))
    part = parts_folder(output) / '1.npz'
    part.write_bytes(b'')
    with resumed_journal(output, '{}', notices.append) as journal:
        fill_journal(journal, squared, TASKS, HERE)
        assert int(journal.read('1')['square']) == 1
    assert notices == [f'{part}: is damaged; it is made again']


def test_a_job_killed_at_any_step_is_finished_by_the_same_call_and_leaves_nothing(tmp_path):
    output = tmp_path / 'a.npz'

    def job():
        with resumed_journal(output, '{}') as journal:
            fill_journal(journal, squared, TASKS, HERE)
            write_archive(output, {key: journal.read(key)['square'] for key in TASKS})

    kills, differences = kill_at_each_step(job, tmp_path)
    assert differences == []
    assert kills > 6 * len(TASKS)
