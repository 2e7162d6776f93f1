"""Many bags at once: what is bad, changed, moved, killed or interrupted, and the rest."""

from __future__ import annotations

import copy
import io
import json
import multiprocessing
import os
import resource
import shutil
import signal
import threading
import time
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from videos import write_video

from benchmarks.batch import broken_bags, short_film
from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.recordings.bag.find_bags import find_bags
from nanorocks_ros.records import Quality
from nanorocks_ros.settings import PipelineSettings, PriorSettings, priors_in_words, with_values
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.studies.batch import bag_summary, batch_task
from nanorocks_ros.studies.batch.batch_analysis import BagResults, BatchPlan, run_batch
from nanorocks_ros.studies.batch.batch_store import BatchStore
from nanorocks_ros.studies.batch.campaign_means import combined
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films

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
    return [short_film(folder / f'run_{seed}', seed, 7.0) for seed in (1, 2)]


@pytest.fixture(scope='module')
def tiny(tmp_path_factory):
    """A bag that is analysed in no time, for what is not about results."""
    return short_film(tmp_path_factory.mktemp('tiny') / 'tiny', 3, 0.4)


def batch_of(folder, *inputs, watcher=None, workers=1, settings=None):
    plan = BatchPlan(
        bags=find_bags([str(path) for path in inputs]),
        folder=folder,
        settings=settings or PipelineSettings(),
    )
    watcher = watcher or Watcher()
    return run_batch(plan, Workers(processes=workers), watcher), watcher


@pytest.fixture(scope='module')
def done(films, tmp_path_factory):
    """Good bags and broken ones, by the command: its folder, what it prints, its exit code."""
    folder = tmp_path_factory.mktemp('batch')
    bags = folder / 'bags'
    bags.mkdir()
    broken_bags(bags, short_film(folder / 'spoilt', 3, 2.0))
    for film in films:
        shutil.copytree(film, bags / film.name)
    out, err, results = io.StringIO(), io.StringIO(), folder / 'results'
    with redirect_stdout(out), redirect_stderr(err):
        code = main(['analyse', f'{bags}/*', '-o', str(results), '--json', '--workers', '2'])
    return results, json.loads(out.getvalue()), err.getvalue(), code


def test_bad_bags_are_told_in_the_end_with_their_reasons(done):
    results, report, errors, code = done
    assert code == 1
    assert 'Traceback' not in errors
    failed = {Path(failure['bag']).name: failure['reason'] for failure in report['failed']}
    assert set(failed) == {'empty.mcap', 'wrong_magic.mcap', 'no_camera'}
    assert 'is empty (0 bytes)' in failed['empty.mcap']
    assert 'is not an MCAP file' in failed['wrong_magic.mcap']
    assert 'no topic' in failed['no_camera']
    last = errors.strip().splitlines()[-1]
    assert '3 of 7 recordings failed' in last
    assert 'run the same command again' in last
    bags = {Path(bag['bag']).name: bag for bag in report['bags']}
    assert set(bags) == {'run_1', 'run_2', 'truncated.mcap', 'flipped.mcap'}
    for name in ('truncated.mcap', 'flipped.mcap'):
        assert not bags[name]['complete']
        assert 0 < bags[name]['frames'] < bags['run_1']['frames']
        assert bags[name]['notices']
    manifest = json.loads((results / 'manifest.json').read_text())
    states = {Path(bag['bag']).name: bag['state'] for bag in manifest['bags']}
    assert states['empty.mcap'] == 'failed'
    assert states['run_1'] == 'done'


def test_each_bag_has_the_results_it_has_alone_and_a_tray_what_all_cycles_say(done, films):
    results, report, _, _ = done
    alone = analyse(films[1], PipelineSettings())
    (own,) = (Path(bag['results']) for bag in report['bags'] if bag['bag'].endswith('/run_2'))
    speeds = read_columns(own / 'tray_1_speed.csv', ('mean_projected_speed',))
    expected = [speed.mean_projected_speed.value for speed in alone.trays[1].speeds]
    assert speeds['mean_projected_speed'] == pytest.approx(expected, rel=1e-6)
    # Of a single recording its own running mean; of two of them, more than of one.
    batch = [
        BagResults(name='run_2', folder=own, summary=json.loads((own / 'bag.json').read_text()))
    ]
    mean = combined(batch, PipelineSettings()).trays[1].restitution
    last = alone.trays[1].cors[-1]
    for together, running in (
        (mean.restitution, last.mean_restitution),
        (mean.wall_restitution, last.mean_wall_restitution),
    ):
        assert together.value == pytest.approx(running.value, rel=1e-4)
        assert together.error == pytest.approx(running.error, rel=1e-4)
    # One filmed at a wrong scale, of which no size is known, costs the others none of theirs.
    wrong = copy.deepcopy(batch[0].summary)
    for cycle in wrong['trays']['1']['cycles']:
        cycle['quality'] += Quality.WRONG_SCALE.names()
    sizes = wrong['trays']['1']['by_cycle']
    wrong['trays']['1']['by_cycle'] = {'correlation_length': sizes['correlation_length']}
    with_wrong_scale = combined([*batch, replace(batch[0], summary=wrong)], PipelineSettings())
    assert with_wrong_scale.size_unit == combined(batch, PipelineSettings()).size_unit == '1'
    tray = report['trays']['1']
    cycles = [cycle for bag in report['bags'] for cycle in bag['trays']['1']['cycles']]
    assert tray['cycles'] == len(cycles) >= tray['cycles_read'] == 2
    assert tray['restitution_lower'] < 0.89 < tray['restitution_upper']
    inner = [tray[f'restitution{end}'] for end in ('_lower_68', '', '_upper_68')]
    assert tray['restitution_lower'] < inner[0] < inner[1] < inner[2] < tray['restitution_upper']
    widths = [cycle['restitution_upper'] - cycle['restitution_lower'] for cycle in cycles]
    narrow_widths = [width for width in widths if width < 1.0]
    assert tray['restitution_upper'] - tray['restitution_lower'] < max(narrow_widths)
    assert tray['collisions'] == sum(cycle['collisions'] for cycle in cycles)
    peaks = read_columns(results / 'cycles.csv', ('peak_speed', 'initial_speed'))
    finite_peaks = peaks['peak_speed'][np.isfinite(peaks['peak_speed'])]
    assert len(peaks['peak_speed']) == len(cycles)
    assert tray['mean_peak_speed'] == pytest.approx(finite_peaks.mean())
    # What a fit to a stump of a decay says is no part of a mean.
    fitted = [
        cycle['initial_speed']
        for cycle in cycles
        if cycle['initial_speed_error']
        and cycle['initial_speed_error'] < 0.5 * cycle['initial_speed']
    ]
    assert tray['initial_speed_cycles'] == len(fitted) > 0
    assert tray['mean_initial_speed'] == pytest.approx(np.mean(fitted))


def test_the_same_command_again_does_only_what_failed(done, capsys):
    parquet = pytest.importorskip('pyarrow.parquet')
    results, report, _, _ = done
    bags = Path(report['bags'][0]['bag']).parent
    before = {path: path.stat().st_mtime_ns for path in results.glob('bags/*/bag.json')}
    call = ['analyse', str(bags), '-o', str(results), '--json', '--format', 'parquet']
    assert main([*call, '--workers', '1']) == 1
    printed = capsys.readouterr()
    assert json.loads(printed.out)['trays'] == report['trays']
    assert '4 of 7 recordings are finished and unchanged' in printed.err
    assert before == {path: path.stat().st_mtime_ns for path in results.glob('bags/*/bag.json')}
    table = parquet.read_table(results / 'trays.parquet')
    assert table['restitution'].to_pylist() == [report['trays']['1']['restitution']]
    cycles = parquet.read_table(results / 'cycles.parquet')
    assert set(cycles['tray'].to_pylist()) == {1}


def test_the_priors_are_told_with_the_restitutions(done, capsys):
    results, report, _, _ = done
    text = priors_in_words(PriorSettings())
    assert report['priors'] == asdict(PriorSettings())
    printed = text.replace('+-', '±')
    assert f'(priors): {printed}.' in (results / 'report.html').read_text()
    bags = Path(report['bags'][0]['bag']).parent
    assert main(['analyse', str(bags), '-o', str(results), '--workers', '1']) == 1
    lines = capsys.readouterr().out.splitlines()
    tray = next(line for line in lines if line.startswith('tray 1: '))
    assert f'priors: {text}' in lines[: lines.index(tray)]


def test_the_report_shows_what_was_analysed_and_what_failed(done):
    results, report, _, _ = done
    page = (results / 'report.html').read_text()
    for text in ('What failed', 'is not an MCAP file', 'Restitution of all cycles together'):
        assert text in page
    assert page.count('<img') == 2
    # A colon is in no picture.
    assert 'http:' not in page
    assert 'https:' not in page
    assert report['report'] == str(results / 'report.html')


def test_names_and_metadata_that_are_hostile_are_shown_not_obeyed(tiny, tmp_path, capsys):
    bags = tmp_path / 'bags'
    bag = shutil.copytree(tiny, bags / HOSTILE)
    text = (bag / 'metadata.yaml').read_text()
    assert 'custom_data:' in text
    (bag / 'metadata.yaml').write_text(
        text.replace('custom_data:', f"custom_data:\n    '{HOSTILE}': '<script>alert(2)</script>'")
    )
    shutil.copytree(tiny, bags / 'line\nend \x1b[31m größe')
    (bags / os.fsdecode(b'caf\xe9.mcap')).touch()
    assert main(['analyse', str(bags), '-o', str(tmp_path / 'out'), '--workers', '1']) == 1
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert '&lt;script&gt;alert(2)' in page
    assert '<script' not in page
    assert '<img' not in page
    printed = capsys.readouterr()
    assert '\x1b' not in printed.out + printed.err
    assert 'größe' in page
    assert r'caf\udce9.mcap: is empty' in printed.err


def test_one_name_twice_what_changed_what_moved_and_a_lost_manifest(tiny, tmp_path):
    bags, out = tmp_path / 'bags', tmp_path / 'out'
    for number, name in enumerate(('day 1/run', 'day 2/run', 'three', 'four')):
        place = shutil.copytree(tiny, bags / name)
        # Each of its own size, so that they are no twins.
        (file,) = place.glob('*.mcap')
        with file.open('ab') as stream:
            stream.write(bytes(number))

    def twice(store):
        with pytest.raises(RecordingError, match='is in use by another process'):
            batch_of(store.folder, tiny)

    batch, _ = batch_of(out, bags, watcher=Watcher(when_begun=twice))
    assert [result.folder.name for result in batch.results] == ['run', 'run-2', 'four', 'three']
    assert not batch.failed
    # Untouched; touched; another content; elsewhere.
    for path in (bags / 'day 2' / 'run').iterdir():
        os.utime(path)
    with next((bags / 'three').glob('*.mcap')).open('ab') as stream:
        stream.write(b'more')
    (bags / 'four').rename(bags / 'five')
    batch, watcher = batch_of(out, bags)
    frames = {name: outcome.frames for name, outcome in watcher.outcomes.items()}
    assert frames == {'run-2': 0, 'three': 12, 'five': 0}
    assert [result.folder.name for result in batch.results] == ['run', 'run-2', 'four', 'three']
    # Twins are told.
    shutil.copytree(bags / 'five', bags / 'six')
    (out / 'manifest.json').write_text('{')
    batch, watcher = batch_of(out, bags)
    assert 'is damaged' in watcher.notices[0]
    assert {name for name, outcome in watcher.outcomes.items() if outcome.frames} <= {
        'six',
        'five',
    }
    assert [bool(result.twin) for result in batch.results] == [False, False, False, True, False]
    other = with_values(PipelineSettings(), {'speed.interval': 0.2}, 'test')
    _, watcher = batch_of(out, bags / 'three', settings=other)
    assert watcher.outcomes['three'].frames == 12


@pytest.mark.parametrize(
    'wrong',
    [
        {'files': [['a', float('inf'), 0, 0, 0]]},
        {'folder': '..'},
        {'folder': '.hidden'},
        {'folder': 'a\0b'},
        {'bag': '/a\0b'},
        {'files': 3},
    ],
    ids=str,
)
def test_a_manifest_of_other_values_is_damaged(tmp_path, wrong):
    def opened():
        return BatchStore(tmp_path / 'out', PipelineSettings(), '')

    with opened() as store:
        store.write()
    path = tmp_path / 'out' / 'manifest.json'
    entry = {'bag': '/a', 'folder': 'a', 'state': 'done', 'reason': '', 'content': '', 'files': []}
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, 'bags': [entry]}))
    with opened() as store:
        assert store.notices == []
    path.write_text(json.dumps({**content, 'bags': [{**entry, **wrong}]}))
    with opened() as store:
        assert 'is damaged' in store.notices[0]


def test_a_worker_that_is_killed_costs_its_own_bag_and_no_other(tiny, tmp_path):
    bags = [shutil.copytree(tiny, tmp_path / f'run_{k}') for k in (1, 2)]

    def kill_one(_):
        def wait_and_kill():
            while not (children := multiprocessing.active_children()):
                time.sleep(0.01)
            os.kill(children[0].pid, signal.SIGKILL)

        threading.Thread(target=wait_and_kill, daemon=True).start()

    watcher = Watcher(when_begun=kill_one)
    batch, _ = batch_of(tmp_path / 'out', *bags, watcher=watcher, workers=2)
    (failure,) = batch.failed
    assert 'was killed, perhaps for lack of memory' in failure.reason
    assert len(batch.results) == 1


def test_results_that_fit_no_bag_are_a_matter_of_that_recording_alone(tiny, tmp_path, monkeypatch):
    bags = [shutil.copytree(tiny, tmp_path / name) for name in ('a_odd', 'b_good')]
    (tmp_path / 'out').mkdir()
    written = batch_task.write_results

    def write_results(analysis, folder, source, *rest, **named):
        if source.name == 'a_odd':
            raise RecordingError(str(source), 'stamp -1 ns lies before 1970', 'give others')
        written(analysis, folder, source, *rest, **named)

    monkeypatch.setattr(batch_task, 'write_results', write_results)
    outcomes = [
        batch_task.analyse_bag(
            batch_task.BagTask(
                path=bag,
                folder=tmp_path / 'out' / bag.name,
                settings=PipelineSettings(),
                image_topic='',
                question='',
                note=tmp_path / 'note',
            )
        )
        for bag in bags
    ]
    assert [outcome.state for outcome in outcomes] == [bag_summary.FAILED, bag_summary.DONE]
    assert 'lies before 1970' in outcomes[0].reason


def test_what_is_done_outlives_an_interruption_and_a_full_disk(tiny, films, tmp_path):
    out = tmp_path / 'out'

    def interrupt():
        raise KeyboardInterrupt

    # The largest comes first.
    with pytest.raises(
        KeyboardInterrupt, match=r'1 of 2 recordings are done and kept in .* goes on'
    ):
        batch_of(out, tiny, films[0], watcher=Watcher(when_finished=interrupt))
    assert not multiprocessing.active_children()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(RecordingError, match=r'File too large'):
            batch_of(out, tiny, films[0])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(out.glob('bags/.*'))
    batch, watcher = batch_of(out, tiny, films[0])
    assert watcher.left == {'tiny'}
    assert len(batch.results) == 2


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (('{tmp}/none*', '-o', '{tmp}/out'), 1, 'none*: matches nothing'),
        (('{tiny}', '{tiny}'), 2, '--output: is required for many recordings'),
        (('{tiny}', '--workers', '0', '-o', '{tmp}/out'), 2, '--workers: 0'),
        (('{tiny}', '--workers', '1', '-o', '/proc/out'), 1, '/proc/out: cannot be written'),
        (('{tiny}', '--workers', '1', '-o', '{tmp}'), 1, 'holds no batch of ours'),
        (('{tiny}', '--workers', '1', '-o', '{tiny}/metadata.yaml'), 1, 'holds no batch of ours'),
        (('{tiny}', '--scheduler', 'tcp://x', '-o', '{tmp}/out'), 2, 'is no address'),
    ],
)
def test_a_call_that_cannot_be_is_one_line(tiny, tmp_path, capsys, arguments, code, message):
    (tmp_path / 'precious').touch()
    places = {'tmp': tmp_path, 'tiny': tiny}
    assert main(['analyse', *(argument.format(**places) for argument in arguments)]) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert message in lines[-1]
    assert not any('Traceback' in line for line in lines)


def test_a_cluster_does_the_same(scheduler, tiny, tmp_path):
    scheduler.add_worker()
    scheduler.await_workers()
    plan = BatchPlan(
        bags=find_bags([str(tiny)]), folder=tmp_path / 'out', settings=PipelineSettings()
    )
    batch = run_batch(plan, Workers(scheduler=scheduler.address), Watcher())
    assert [result.folder.name for result in batch.results] == ['tiny']
    assert not batch.failed


def test_two_copies_of_one_video_count_once(tmp_path):
    videos = [write_video(tmp_path / name, range(8)) for name in ('a.avi', 'b.avi', 'c.avi')]
    shutil.copy(videos[0], videos[2])
    write_video(videos[1], range(1, 9))
    made = [tmp_path / 'bags' / video.stem for video in videos]
    for video, bag in zip(videos, made, strict=True):
        import_films([video], bag, ImportSettings(start_ns=10**18), lambda _: None)
    settings = with_values(PipelineSettings(), {'preprocess.pixels_per_metre': 1000.0}, 'test')
    batch, _ = batch_of(tmp_path / 'out', *made, settings=settings)
    assert not batch.failed
    twins = {Path(result.name).name: Path(result.twin).name for result in batch.results}
    assert twins == {'a': '', 'b': '', 'c': 'a'}
