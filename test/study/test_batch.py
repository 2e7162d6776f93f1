"""Many bags at once: what is bad, changed, moved, killed or interrupted, and the rest."""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import shutil
import signal
import threading
import time
from pathlib import Path

import pytest
from campaigns import film  # a short film of tray 1 with one decay

from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.settings import PipelineSettings, with_values
from nanorocks_ros.recordings.find_bags import find_bags
from nanorocks_ros.recordings.writer import BagWriter
from nanorocks_ros.study.batch import BatchPlan, run_batch
from nanorocks_ros.study.combined import combined, means_as_json
from nanorocks_ros.study.offline import analyse
from nanorocks_ros.study.result_tables import read_columns
from nanorocks_ros.study.results_bag import offered
from nanorocks_ros.study.tasks import Workers
from nanorocks_ros.wire import topics

HOSTILE = '<img src=x onerror=alert(1)>'


class Watcher:
    """Remembers what it is told; a test may do something when a recording is finished."""

    def __init__(self, when_finished=None, when_begun=None):
        self.notices, self.outcomes = [], {}
        self._finished, self._begun = when_finished, when_begun

    def begin(self, store, sizes, done):
        self.left, self.done = set(sizes), done
        if self._begun:
            self._begun(store)

    def finished(self, name, outcome):
        self.outcomes[name] = outcome
        if self._finished:
            self._finished()

    def notice(self, text):
        self.notices.append(text)


@pytest.fixture(scope='module')
def films(tmp_path_factory):
    """Two bags with a decay each."""
    folder = tmp_path_factory.mktemp('films')
    return [film(folder / f'run_{seed}', seed) for seed in (1, 2)]


@pytest.fixture(scope='module')
def tiny(tmp_path_factory):
    """A bag that is analysed in no time, for what is not about results."""
    return film(tmp_path_factory.mktemp('tiny') / 'tiny', 3, seconds=0.4)


def batch_of(folder, *inputs, watcher=None, workers=1, settings=None):
    plan = BatchPlan(
        bags=find_bags([str(one) for one in inputs]),
        folder=folder,
        settings=settings or PipelineSettings(),
    )
    watcher = watcher or Watcher()
    return run_batch(plan, Workers(processes=workers), watcher), watcher


def broken_bags(folder, good):
    """One of each kind; only that cut short can be used in part."""
    folder.mkdir()
    (file,) = good.glob('*.mcap')
    content = file.read_bytes()
    (folder / 'cut.mcap').write_bytes(content[: len(content) * 3 // 5])
    (folder / 'empty.mcap').touch()
    (folder / 'wrong.mcap').write_bytes(b'RIFF' + content[4:])
    flipped = bytearray(content)
    for place in range(len(content) // 3, len(content) // 2, 500):
        flipped[place] ^= 0x10
    (folder / 'flipped.mcap').write_bytes(flipped)
    chatter = topics.EPOCH.absolute()
    with BagWriter(folder / 'no_camera', {chatter: offered(topics.EPOCH)}, metadata={}):
        pass
    return folder


@pytest.fixture(scope='module')
def done(films, tmp_path_factory):
    """Good bags and broken ones, by the command: its folder, what it prints, its exit code."""
    folder = tmp_path_factory.mktemp('batch')
    bags = broken_bags(folder / 'bags', films[0])
    for one in films:
        shutil.copytree(one, bags / one.name)
    with (folder / 'out').open('w') as out, (folder / 'err').open('w') as err:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr('sys.stdout', out)
            patch.setattr('sys.stderr', err)
            results = folder / 'results'
            code = main(['analyse', f'{bags}/*', '-o', str(results), '--json', '--workers', '2'])
    return results, json.loads((folder / 'out').read_text()), (folder / 'err').read_text(), code


def test_bad_bags_are_told_in_the_end_and_the_good_ones_are_complete(done, films):
    results, found, errors, code = done
    assert code == 1
    assert 'Traceback' not in errors
    failed = {Path(one['bag']).name: one['reason'] for one in found['failed']}
    assert set(failed) == {'empty.mcap', 'wrong.mcap', 'no_camera'}
    assert 'is empty (0 bytes)' in failed['empty.mcap']
    assert 'is not an MCAP file' in failed['wrong.mcap']
    assert 'holds no messages' in failed['no_camera']
    last = errors.strip().splitlines()[-1]
    assert '3 of 7 recordings failed' in last
    assert 'run the same command again' in last
    bags = {Path(one['bag']).name: one for one in found['bags']}
    assert set(bags) == {'run_1', 'run_2', 'cut.mcap', 'flipped.mcap'}
    for name in ('cut.mcap', 'flipped.mcap'):
        assert not bags[name]['complete']
        assert 0 < bags[name]['frames'] < bags['run_1']['frames']
        assert bags[name]['notices']
    alone = analyse(films[1], PipelineSettings())
    own = Path(bags['run_2']['results'])
    speeds = read_columns(own / 'tray_1_speed.csv', ('mean_projected_speed',))
    expected = [one.mean_projected_speed for one in alone.trays[1].speeds]
    assert speeds['mean_projected_speed'] == pytest.approx(expected, rel=1e-6)
    manifest = json.loads((results / 'manifest.json').read_text())
    states = {Path(one['bag']).name: one['state'] for one in manifest['bags']}
    assert states['empty.mcap'] == 'failed'
    assert states['run_1'] == 'done'


def test_all_cycles_count_in_what_is_said_of_a_tray(done):
    results, found, _, _ = done
    tray = found['trays']['1']
    cycles = [one for bag in found['bags'] for one in bag['trays']['1']['cycles']]
    assert tray['cycles'] == len(cycles) >= 3
    assert tray['restitution_lower'] < 0.89 < tray['restitution_upper']
    widths = [one['restitution_upper'] - one['restitution_lower'] for one in cycles]
    assert tray['restitution_upper'] - tray['restitution_lower'] < min(widths)
    assert tray['collisions'] == sum(one['collisions'] for one in cycles)
    starts = [one['initial_speed'] for one in cycles]
    assert tray['mean_initial_speed'] == pytest.approx(sum(starts) / len(starts))
    table = read_columns(results / 'cycles.csv', ('cycle', 'initial_speed'))
    assert sorted(table['initial_speed']) == pytest.approx(sorted(starts))


def test_the_same_command_again_does_only_what_failed(done, capsys):
    results, found, _, _ = done
    bags = Path(found['bags'][0]['bag']).parent
    before = {one: one.stat().st_mtime_ns for one in results.glob('bags/*/bag.json')}
    assert main(['analyse', str(bags), '-o', str(results), '--json']) == 1
    printed = capsys.readouterr()
    assert json.loads(printed.out)['trays'] == found['trays']
    assert '4 of 7 recordings are done already' in printed.err
    assert before == {one: one.stat().st_mtime_ns for one in results.glob('bags/*/bag.json')}


def test_the_report_shows_what_was_analysed_and_what_failed(done):
    results, found, _, _ = done
    page = (results / 'report.html').read_text()
    for text in ('What failed', 'is not an MCAP file', 'Restitution of all cycles together'):
        assert text in page
    assert page.count('<img') == 2
    assert 'http' not in page
    assert found['report'] == str(results / 'report.html')


def test_names_and_metadata_that_are_hostile_are_shown_not_obeyed(films, tmp_path, capsys):
    bags = tmp_path / 'bags'
    one = shutil.copytree(films[0], bags / HOSTILE)
    text = (one / 'metadata.yaml').read_text()
    assert 'custom_data:' in text
    (one / 'metadata.yaml').write_text(
        text.replace('custom_data:', f"custom_data:\n    '{HOSTILE}': '<script>alert(2)</script>'")
    )
    shutil.copytree(films[1], bags / 'line\nend \x1b[31m größe')
    (bags / os.fsdecode(b'caf\xe9.mcap')).touch()
    assert main(['analyse', str(bags), '-o', str(tmp_path / 'out')]) == 1
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert '&lt;script&gt;alert(2)' in page
    assert '<script' not in page
    assert page.count('<img') == 2
    printed = capsys.readouterr()
    assert '\x1b' not in printed.out + printed.err
    assert 'größe' in page
    assert r'caf\udce9.mcap: is empty' in printed.err


def test_recordings_of_one_name_do_not_collide(tiny, tmp_path):
    for day in ('day 1', 'day 2'):
        shutil.copytree(tiny, tmp_path / day / 'run')
    (file,) = (tmp_path / 'day 2' / 'run').glob('*.mcap')
    with file.open('ab') as stream:
        stream.write(b'\x00')
    batch, _ = batch_of(tmp_path / 'out', tmp_path / 'day 1', tmp_path / 'day 2')
    assert [one.folder.name for one in batch.results] == ['run', 'run-2']
    assert not batch.failed
    # One more day before them changes nothing.
    shutil.copytree(tiny, tmp_path / 'day 0' / 'run')
    again, watcher = batch_of(tmp_path / 'out', *(tmp_path / f'day {k}' for k in range(3)))
    assert watcher.left == {'run-3'}
    # Now bit by bit the same is there twice.
    assert [bool(one.twin) for one in again.results] == [False, True, False]


def test_what_changed_is_done_again_and_what_moved_is_not(tiny, films, tmp_path):
    bags = tmp_path / 'bags'
    shutil.copytree(tiny, bags / 'one')
    shutil.copytree(tiny, bags / 'two')
    out = tmp_path / 'out'
    batch_of(out, bags)
    # Touched, but the same.
    for one in (bags / 'one').iterdir():
        os.utime(one)
    _, watcher = batch_of(out, bags)
    assert watcher.left == {'one'}
    assert watcher.outcomes['one'].frames == 0
    (bags / 'two').rename(bags / 'moved')
    batch, watcher = batch_of(out, bags)
    assert watcher.outcomes['moved'].frames == 0
    assert [one.folder.name for one in batch.results] == ['two', 'one']
    shutil.rmtree(bags / 'one')
    shutil.copytree(films[0], bags / 'one')
    _, watcher = batch_of(out, bags)
    assert watcher.left == {'one'}
    assert watcher.outcomes['one'].frames > 30
    other = with_values(PipelineSettings(), {'speed.interval': 0.2}, 'test')
    _, watcher = batch_of(out, bags / 'moved', settings=other)
    assert watcher.outcomes['two'].frames > 0


def test_a_lost_manifest_costs_no_results(tiny, tmp_path):
    out = tmp_path / 'out'
    batch_of(out, tiny)
    (out / 'manifest.json').write_text('{')
    batch, watcher = batch_of(out, tiny)
    assert 'is damaged' in watcher.notices[0]
    assert watcher.outcomes['tiny'].frames == 0
    assert len(batch.results) == 1


def test_a_worker_that_is_killed_costs_its_own_bag_and_no_other(films, tmp_path):
    def kill_one(_):
        def wait_and_kill():
            while not (children := multiprocessing.active_children()):
                time.sleep(0.01)
            os.kill(children[0].pid, signal.SIGKILL)

        threading.Thread(target=wait_and_kill, daemon=True).start()

    watcher = Watcher(when_begun=kill_one)
    batch, _ = batch_of(tmp_path / 'out', *films, watcher=watcher, workers=2)
    (failure,) = batch.failed
    assert 'was killed, for lack of memory perhaps' in failure.reason
    assert len(batch.results) == 1
    again, watcher = batch_of(tmp_path / 'out', *films, workers=2)
    assert len(watcher.left) == 1
    assert not again.failed


def test_an_interruption_keeps_what_is_done_and_says_how_to_go_on(tiny, tmp_path):
    bags = tmp_path / 'bags'
    for number in range(3):
        shutil.copytree(tiny, bags / f'run_{number}')

    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match='1 of 3 recordings are done and kept in .*again|'):
        batch_of(tmp_path / 'out', bags, watcher=Watcher(when_finished=interrupt))
    assert not multiprocessing.active_children()
    _, watcher = batch_of(tmp_path / 'out', bags)
    assert len(watcher.left) == 2


def test_a_full_disk_ends_the_batch_and_costs_nothing_that_was_written(tiny, films, tmp_path):
    out = tmp_path / 'out'
    batch_of(out, tiny)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (15_000, limits[1]))
    try:
        with pytest.raises(RecordingError, match='cannot be written any more .*make room; 1 of 3'):
            batch_of(out, tiny, *films)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(out.glob('bags/.*'))
    batch, watcher = batch_of(out, tiny, *films)
    assert watcher.left == {'run_1', 'run_2'}
    assert len(batch.results) == 3


def test_what_all_cycles_say_is_what_a_recording_of_all_of_them_says(films, tmp_path):
    batch, _ = batch_of(tmp_path / 'out', films[0])
    found = means_as_json(combined(batch.results, PipelineSettings()).trays[1])
    last = analyse(films[0], PipelineSettings()).trays[1].cors[-1]
    for name in ('restitution_error', 'wall_restitution', 'wall_restitution_error'):
        assert found[name] == pytest.approx(getattr(last, f'mean_{name}'), rel=1e-4)
    assert found['restitution'] == pytest.approx(last.mean_restitution, rel=1e-5)


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (('{tmp}/none*', '-o', '{tmp}/out'), 1, 'none*: matches nothing'),
        (('{tiny}', '{tiny}'), 2, '--output: is where results of many recordings are kept'),
        (('{tiny}', '--workers', '0', '-o', '{tmp}/out'), 2, '--workers: 0'),
        (('{tiny}', '--workers', '1', '-o', '/proc/out'), 1, '/proc/out: cannot be written'),
        (('{tiny}', '--workers', '1', '-o', '{tmp}'), 1, 'holds no batch of ours'),
        (('{tiny}', '--workers', '1', '-o', '{tiny}/metadata.yaml'), 1, 'cannot be'),
        (('{tiny}', '--scheduler', 'tcp://x', '-o', '{tmp}/out'), 2, 'is no address'),
    ],
)
def test_a_call_that_cannot_be_is_one_line(tiny, tmp_path, capsys, arguments, code, message):
    (tmp_path / 'precious').touch()
    places = {'tmp': tmp_path, 'tiny': tiny}
    assert main(['analyse', *(one.format(**places) for one in arguments)]) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert message in lines[-1]
    assert not any('Traceback' in one for one in lines)


def test_two_at_once_in_one_folder_are_refused(tiny, tmp_path):
    def again(store):
        with pytest.raises(RecordingError, match='is in use by another process'):
            batch_of(store.folder, tiny)

    batch, _ = batch_of(tmp_path / 'out', tiny, watcher=Watcher(when_begun=again))
    assert len(batch.results) == 1


def test_tables_are_parquet_where_that_is_asked_for(tiny, tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    out = tmp_path / 'out'
    assert main(['analyse', str(tiny), '-o', str(out), '--format', 'parquet']) == 0
    table = parquet.read_table(out / 'trays.parquet')
    assert table['tray'].to_pylist() == [1]
    assert 'restitution' in parquet.read_table(out / 'cycles.parquet').column_names


def test_a_cluster_does_the_same(cluster, films, tmp_path):
    plan = BatchPlan(
        bags=find_bags([str(one) for one in films]),
        folder=tmp_path / 'out',
        settings=PipelineSettings(),
    )
    batch = run_batch(plan, Workers(scheduler=cluster.address), Watcher())
    assert [one.folder.name for one in batch.results] == ['run_1', 'run_2']
    assert not batch.failed
