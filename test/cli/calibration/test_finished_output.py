"""A kill between the output and the end of its parts: the same command ends the job."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.file_steps import kill_at_each_step, run_until, was_killed
from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference import cluster_size
from nanorocks_ros.inference.cluster_size.cluster_curve import PACKAGED
from nanorocks_ros.jobs.journal import Journal
from nanorocks_ros.jobs.resumed_tasks import parts_folder
from nanorocks_ros.outputs.npz_archive import read_archive, write_archive
from nanorocks_ros.studies.libraries.cluster_films import ClusterPlan

LIBRARY = [
    'library',
    '--tray',
    '1',
    '--nodes',
    '254',
    '--rough-nodes',
    '0',
    '--runs',
    '2',
    '--workers',
    '1',
]


def library(output):
    if main([*LIBRARY, '--workers', '1', '-o', str(output)]):
        raise SystemExit


@pytest.fixture(scope='module')
def killed(tmp_path_factory):
    """A folder with a complete library and all its parts."""
    folder = tmp_path_factory.mktemp('killed')
    output = folder / 'a.npz'
    code, steps = run_until(lambda: library(output), folder, r'os\.remove .*/0-4\.npz')
    assert was_killed(code), steps
    return folder


@pytest.fixture
def output(killed, tmp_path):
    shutil.copytree(killed, tmp_path / 'here')
    return tmp_path / 'here' / 'a.npz'


def test_the_same_command_deletes_the_parts_of_its_library_and_tells_it(output, capsys):
    content = output.read_bytes()
    assert main([*LIBRARY, '-o', str(output), '--json']) == 0
    printed = capsys.readouterr()
    assert printed.err == (
        f'nanorocks: {output}: was complete; the parts it was made of are deleted\n'
    )
    assert json.loads(printed.out)['nodes'] == 254
    assert output.read_bytes() == content
    assert os.listdir(output.parent) == ['a.npz']
    # Now it is a file like any other.
    assert main([*LIBRARY, '-o', str(output)]) == 1
    assert 'exists already and is not overwritten' in capsys.readouterr().err


def test_a_kill_while_the_parts_are_deleted_changes_nothing(killed, tmp_path):
    folder = tmp_path / 'here'
    folder.mkdir()
    before = tmp_path / 'before'
    shutil.copytree(killed, before)
    # Three parts stand for all.
    for part in sorted(parts_folder(before / 'a.npz').glob('*.npz'))[3:]:
        part.unlink()

    def job():
        # Once its folder is gone, the second call finds a library like any other.
        if parts_folder(folder / 'a.npz').exists():
            library(folder / 'a.npz')

    kills, differences = kill_at_each_step(job, folder, before)
    assert differences == []
    assert kills > 5
    assert os.listdir(folder) == ['a.npz']


def test_parts_that_may_be_of_use_stay(output, capsys):
    parts = parts_folder(output)
    count = len(list(parts.glob('*.npz')))
    other = [*LIBRARY, '-o', str(output), '--seed', '2']
    assert main(other) == 1
    with Journal(parts, (parts / 'question.json').read_text()):
        assert main([*LIBRARY, '-o', str(output)]) == 1
    # A call with --force was killed before it had replaced the library.
    os.utime(output, ns=(0, 0))
    assert main([*LIBRARY, '-o', str(output)]) == 1
    assert capsys.readouterr().err.count('exists already and is not overwritten') == 3
    assert len(list(parts.glob('*.npz'))) == count


def test_the_same_command_deletes_the_parts_of_its_cluster_curve(tmp_path, capsys):
    output, trays = tmp_path / 'curve.npz', load_trays()
    plan = ClusterPlan(cells=trays, trays=tuple(sorted(trays)), runs=128)
    packaged = read_archive(Path(cluster_size.__file__).with_name(PACKAGED))
    write_archive(output, {**packaged, 'made_by': np.array(plan.specification())})
    # The kill came after the last part was deleted: its folder is left.
    parts_folder(output).mkdir()
    (parts_folder(output) / 'question.json').write_text(plan.specification())
    (parts_folder(output) / 'lock').touch()
    assert main(['cluster-curve', '-o', str(output), '--workers', '1']) == 0
    printed = capsys.readouterr()
    assert printed.err.count('\n') == 1
    assert 'was complete; the parts it was made of are deleted' in printed.err
    assert printed.out.count('sizes up to') + printed.out.count('does not depend') == len(trays)
    assert os.listdir(tmp_path) == ['curve.npz']
