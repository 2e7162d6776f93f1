"""The simulated campaign and its report, with films of a few seconds."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, replace

import pytest

import nanorocks_ros as nr
from benchmarks.file_steps import kill_at_each_step
from nanorocks_ros import __version__
from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.paper_values import PAPER_PEAK_SPEED
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.studies.figures import cor_figures
from nanorocks_ros.studies.measure import measured_folder
from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan, plate_settings
from nanorocks_ros.studies.reproduction.reproduce_paper import reproduce
from nanorocks_ros.studies.reproduction.simulated_campaign import (
    open_campaign,
    parts_done,
    run_campaign,
)

PLAN = CampaignPlan(cycles=1, seconds=2.6, seed=2)
SETTINGS = {name: value for name, value in asdict(PLAN).items() if name != 'cycles'}
ALONE = Workers(processes=1)


@pytest.fixture(scope='module')
def campaign(tmp_path_factory):
    """A folder with a short campaign."""
    folder = tmp_path_factory.mktemp('campaign') / 'new'
    # The parts of cycles that an interrupted call of more cycles left.
    for name in ('.sticking_001.part', '.sticking_002.part'):
        (folder / name).mkdir(parents=True)
        (folder / name / 'done').write_text('0.4')
    (folder / '.nanorocks_campaign').write_text(json.dumps(SETTINGS))
    assert parts_done(folder, PLAN) == pytest.approx(0.2)
    with open_campaign(folder, PLAN):
        assert parts_done(folder, PLAN) == 0.0
        run_campaign(folder, PLAN, ALONE, lambda done: None)
    return folder


def test_each_cycle_has_a_film_two_analyses_and_the_truth(campaign):
    for kind in ('bouncing', 'sticking'):
        folder = campaign / f'{kind}_001'
        summary = json.loads((folder / 'summary.json').read_text())
        assert set(summary['default']['trays']) == {str(k) for k in range(1, 9)}
        truth = summary['default']['trays']['1']['truth']
        assert truth['restitution'] == pytest.approx(PLAN.restitution)
        assert (truth['sticking_speed'] > 0.0) == (kind == 'sticking')
        assert set(summary['paper']['trays']['1']['method']) == {'binarised_area'}
        truth = summary['truth']['1']
        assert truth['bodies'][0] == 15
        assert max(truth['marked_speed']) == pytest.approx(PAPER_PEAK_SPEED, rel=0.4)
        # Detected, found, and on no bead; grains alone are not tracked.
        assert summary['tracked']['1'] == pytest.approx([1.0, 1.0, 0.0], abs=0.1)
        assert set(summary['tracked']) <= {str(k) for k in range(1, 8)}
        assert (folder / 'film').exists()
    read = nr.read(campaign)
    assert set(read.speeds['tray']) <= set(range(1, 9))
    assert parts_done(campaign, PLAN) == 1.0
    assert not list(campaign.glob('.*.part'))


def test_finished_cycles_are_reused(campaign):
    before = (campaign / 'bouncing_001' / 'summary.json').stat().st_mtime_ns
    cycles = run_campaign(campaign, PLAN, ALONE, lambda done: None)
    assert [cycle.kind for cycle in cycles] == ['bouncing', 'sticking']
    assert (campaign / 'bouncing_001' / 'summary.json').stat().st_mtime_ns == before


def test_the_report_has_all_chapters_even_with_short_films(campaign):
    notices = []
    path = reproduce(campaign, PLAN, ALONE, 2, lambda name, done: None, notices.append)
    text = path.read_text('utf-8')
    assert text.count('<section') == 11
    # First what was run, and what cannot be had.
    head = text[: text.index('The experiment (Table 1')]
    assert __version__ in head
    in_words = re.sub(r'<[^>]+>', '', head)
    assert 'nanorocks reproduce --cycles 1 --runs 2 --seed 2' in in_words
    assert text.index('What cannot be reproduced</h2>') < text.index('Table 1: the trays')
    # Two seconds of cooling are too short for a restitution.
    assert any(notice.startswith('restitution: ') for notice in notices)
    assert 'Could not be made' in text
    for name in (
        'Table 1',
        'Table 2',
        'Figure 1b',
        'Figure 2:',
        'Figure 4',
        'Figure 5: a)',
        'Figure 8e',
        'Figure 11',
    ):
        assert name in text


def test_a_folder_with_other_files_or_another_plan_is_not_changed(campaign, tmp_path):
    def opened(folder, plan):
        with open_campaign(folder, plan):
            pass

    with pytest.raises(RecordingError, match='other settings'):
        opened(campaign, CampaignPlan(cycles=1, seconds=5.0))
    (tmp_path / 'mine.txt').write_text('')
    with pytest.raises(RecordingError, match='holds no campaign'):
        opened(tmp_path, PLAN)
    assert [path.name for path in tmp_path.iterdir()] == ['mine.txt']
    # A later call may add cycles.
    opened(campaign, replace(PLAN, cycles=5))


def test_one_process_at_a_time_makes_a_campaign(tmp_path):
    folder = tmp_path / 'new'
    with (
        open_campaign(folder, PLAN),
        pytest.raises(RecordingError, match='is in use by another process'),
        open_campaign(folder, PLAN),
    ):
        pass


def begin_campaign(folder):
    with open_campaign(folder, PLAN):
        pass


@pytest.mark.parametrize(
    'begin', [begin_campaign, cor_figures.prepare_folder, measured_folder.prepare_folder]
)
def test_a_folder_is_taken_again_after_a_kill_at_any_step_of_its_making(begin, tmp_path):
    kills, differences = kill_at_each_step(lambda: begin(tmp_path / 'new'), tmp_path)
    assert differences == []
    assert kills > 1


@pytest.mark.parametrize(
    'begin', [begin_campaign, cor_figures.prepare_folder, measured_folder.prepare_folder]
)
def test_a_file_in_the_place_of_the_folder_is_told(begin, tmp_path):
    (tmp_path / 'new').write_text('mine')
    with pytest.raises(RecordingError, match='exists and holds no'):
        begin(tmp_path / 'new')
    assert (tmp_path / 'new').read_text() == 'mine'


def test_a_cycle_without_its_summary_is_told_before_the_work(tmp_path):
    (tmp_path / 'bouncing_001').mkdir()
    (tmp_path / '.nanorocks_campaign').write_text(json.dumps(SETTINGS))
    with pytest.raises(RecordingError, match=r'bouncing_001: has no summary\.json; delete it'):
        reproduce(tmp_path, PLAN, ALONE, 2, lambda name, done: None, lambda text: None)


@pytest.mark.parametrize(
    ('flags', 'named'),
    [
        (['--cycles', '0'], '--cycles'),
        (['--runs', '1'], '--runs'),
        (['--seed', '-1'], '--seed'),
        (['--sticking-speed', '0'], '--sticking-speed'),
    ],
)
def test_wrong_calls_are_named(flags, named, tmp_path, capsys):
    assert main(['reproduce', '--quick', '-o', str(tmp_path / 'out'), *flags]) == 2
    assert named in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / 'out').exists()


def test_films_are_analysed_with_the_layout_of_the_plate():
    settings = plate_settings(trays=[1])
    assert settings.preprocess.layout == 'plate'
    assert settings.trays == (1,)
