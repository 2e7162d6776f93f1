"""A short seeded run of the fuzzer: nothing is silent, endless or ends in a traceback."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from benchmarks import fuzz, killed_jobs
from benchmarks.fuzzing.mutations import damaged, generator_of
from benchmarks.fuzzing.outcomes import BAD, NO_CHECKSUM, SAME, SILENT, Outcome
from benchmarks.fuzzing.targets import KINDS, SHARES, target_of

pytest.importorskip('av')
pytest.importorskip('aiohttp')
PAGE = Path(__file__).parents[2] / 'docs' / 'validation' / 'hostile_input.md'
COUNTS = {'bags': 120, 'texts': 60, 'results': 40, 'films': 16, 'requests': 20, 'salvage': 42}


@pytest.mark.parametrize('kind', KINDS)
def test_no_mutation_ends_badly(tmp_path, kind):
    target = target_of(kind, tmp_path)
    outcomes = [target.run(number) for number in range(COUNTS[kind])]
    assert [outcome for outcome in outcomes if outcome.name in BAD] == []
    assert len({outcome.name for outcome in outcomes}) >= 2
    for outcome in outcomes:
        assert '\n' not in outcome.detail


def test_a_salvage_recovers_every_message_that_another_reader_finds(tmp_path):
    target = target_of('salvage', tmp_path)
    for number in range(28):
        numbers = target.run(number).numbers
        assert numbers['of_recoverable'] == numbers['recoverable'] >= numbers['library']


def test_the_fuzzer_tells_a_reader_that_is_silent(tmp_path, monkeypatch):
    """Otherwise its zeros would mean nothing."""
    target = target_of('bags', tmp_path)
    intact = target.run(2).name
    reader = 'nanorocks_ros.recordings.bag.reader.BagReader'
    monkeypatch.setattr(f'{reader}.complete', True)
    monkeypatch.setattr(f'{reader}.notices', ())
    names = {target.run(number).name for number in range(60)}
    assert SILENT in names
    assert intact != SILENT


def test_a_mutation_is_the_same_each_time():
    content = bytes(range(256)) * 20
    runs = [damaged(content, generator_of('bags', 7)) for _ in range(2)]
    assert runs[0] == runs[1]
    others = {damaged(content, generator_of(kind, 7))[0] for kind in KINDS}
    assert len(others) == len(KINDS)


def test_a_run_is_resumed_from_its_journal_and_the_table_is_of_all(tmp_path, capsys):
    journal = tmp_path / 'fuzz.jsonl'
    line = ['texts', 0, *Outcome(SAME, 'trays', 'flip_bit')]
    journal.write_text(f'{json.dumps(line)}\n["texts", 1, "sa')
    assert fuzz.main(['--kind', 'texts', '--count', '3', '--journal', str(journal)]) == 0
    assert '| texts | 3 |' in capsys.readouterr().out
    lines = journal.read_text().splitlines()
    assert lines[0] == json.dumps(line)
    assert fuzz.main(['--kind', 'texts', '--count', '3', '--journal', str(journal)]) == 0
    assert journal.read_text().splitlines() == lines


def test_the_kinds_share_the_mutations():
    done = {}
    wanted = list(fuzz.wanted(2500, None, done))
    assert len(wanted) == len(set(wanted)) == 2500
    assert {kind for kind, _ in wanted} == set(KINDS) == set(SHARES)
    assert set(fuzz.wanted(2500, None, dict.fromkeys(wanted[:100], None))) == set(wanted[100:])


def test_the_page_says_nothing_bad_of_what_has_checksums():
    rows = [line.split('|')[1:-1] for line in PAGE.read_text().splitlines() if '| all |' in line]
    assert rows
    for row in rows:
        assert [int(cell) for cell in row[6:]] == [0] * len(BAD)
    assert re.search(r'\| all \| \d{4}', PAGE.read_text())
    assert NO_CHECKSUM in PAGE.read_text()


def test_a_killed_salvage_and_import_are_finished_by_the_same_command(tmp_path):
    for name in ('salvage', 'import --each'):
        job = killed_jobs.JOBS[name](tmp_path / name.split()[0])
        assert job.kill(generator_of('kills', 3)) == (True, None)


def test_what_a_kill_led_to_is_kept_beside_what_it_should_be(tmp_path):
    job = killed_jobs.JOBS['sweep'](tmp_path / 'sweep')
    assert job.kill(generator_of('kills', 3)) == (True, None)
    (tmp_path / 'sweep' / 'killed' / '.output.left').write_text('half')
    (tmp_path / 'sweep' / 'killed' / 'output.npz').write_text('other')
    job.keep(tmp_path)
    assert (tmp_path / 'differences.txt').read_text().splitlines() == [
        '.output.left is left over',
        'output.npz has another content',
    ]
    assert (tmp_path / 'killed' / '.output.left').read_text() == 'half'
    assert (tmp_path / 'wanted' / 'output.npz').stat().st_size > 1000
