"""The command ``nanorocks sweep``."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sysconfig
import time
from pathlib import Path

import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.studies.sweeps.sweep_result import CURVES, Sweep

SMALL = ['--runs', '3', '--times', '0:2:3', '--workers', '1']
GRID = ['--restitution', '0.6:0.9:3', '--wall-restitution', '0.9,0.99']


def start(*arguments):
    """Start the command in its own process group, as a shell does."""
    return subprocess.Popen(
        [Path(sysconfig.get_path('scripts')) / 'nanorocks', 'sweep', *arguments],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_a_law_of_the_restitution_is_an_axis_like_any_other(tmp_path, capsys):
    laws = ['--restitution-law', 'constant,uniform,viscoelastic,power,pairs']
    pairs = ['--restitution', '0.6', '--restitution-pairs', '0.6']
    output = tmp_path / 'laws.npz'
    assert main(['sweep', *SMALL, *laws, *pairs, '-o', str(output), '--json']) == 0
    curves = json.loads(capsys.readouterr().out)['mean_speed']
    assert len(curves) == 5
    wrong = ['--restitution-law', 'pairs', '--restitution-pairs', '0.6', '0.7']
    assert main(['sweep', *SMALL, *wrong, '-o', str(tmp_path / 'no.npz')]) == 1
    assert 'restitution_pairs: 2 restitutions for 1 species' in capsys.readouterr().err


def test_a_sweep_prints_curves_and_writes_them(tmp_path, capsys):
    output, table = tmp_path / 'a.npz', tmp_path / 'a.csv'
    arguments = ['sweep', *SMALL, *GRID, '-o', str(output), '--csv', str(table), '--json']
    assert main([*arguments, '--seed', '4', '--mean-speed', '0.01']) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['axes'] == {'restitution': [0.6, 0.75, 0.9], 'wall_restitution': [0.9, 0.99]}
    assert printed['runs'] == 3
    assert printed['seed'] == 4
    assert printed['time'] == [0.0, 1.0, 2.0]
    sweep = Sweep.load(output)
    for name in CURVES:
        np.testing.assert_array_equal(printed[name], getattr(sweep, name))
    total = int(sweep.pair_collisions.sum() + sweep.wall_collisions.sum())
    assert printed['events'] == total > 0
    assert json.loads(sweep.specification)['settings']['mean_speed'] == 0.01
    with table.open(newline='') as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == 3 * 2 * 3
    assert list(lines[0])[:4] == [
        'restitution',
        'wall_restitution',
        'time',
        'mean_speed',
    ]
    assert float(lines[-1]['mean_projected_speed']) == sweep.mean_projected_speed[2, 1, 2]


def test_drag_is_an_axis_and_slows_the_gas(tmp_path, capsys):
    arguments = ['sweep', *SMALL, '--drag', '0,0.1', '--json', '-o', str(tmp_path / 'a.npz')]
    assert main(arguments) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['axes'] == {'drag': [0.0, 0.1]}
    free, dragged = np.array(printed['mean_speed'])[:, -1]
    time = printed['time'][-1]
    # The clock of the gas runs slower: it has lost less in collisions than the other.
    assert np.exp(-0.1 * time) < dragged / free < np.exp(-0.05 * time)


def test_unknown_values_are_null(tmp_path, capsys):
    output = str(tmp_path / 'a.npz')
    assert main(['sweep', '--runs', '1', '--times', '0,1', '-o', output, '--json']) == 0
    printed = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert printed['mean_speed_error'] == [None, None]
    assert printed['axes'] == {}


def test_a_map_is_drawn_against_a_point_or_a_file(tmp_path, capsys):
    grid, point = str(tmp_path / 'grid.npz'), str(tmp_path / 'point.npz')
    assert main(['sweep', *SMALL, '-o', point, '--restitution', '0.75', '--seed', '2']) == 0
    for k, reference in enumerate(('0.75,0.9', point)):
        figure = tmp_path / f'{k}.png'
        arguments = ['sweep', *SMALL, *GRID, '-o', grid, '--figure', str(figure)]
        assert main([*arguments, '--reference', reference]) == 0
        assert figure.stat().st_size > 10_000
    assert 'Traceback' not in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--restitution', '0.5:x:3'], "--restitution: '0.5:x:3' cannot be read; give low:high"),
        (['--restitution', '0.5:0.9'], "--restitution: '0.5:0.9' cannot be read; give low:high"),
        (['--restitution', '0.5:0.9:2.5'], "'0.5:0.9:2.5' cannot be read"),
        (['--restitution', '0.9:0.5:3'], "'0.9:0.5:3' has no values"),
        (['--restitution', '0.5:0.9:1'], "'0.5:0.9:1' has no values"),
        (['--restitution', '0.5:0.9:100000'], "'0.5:0.9:100000' has no values"),
        (['--restitution', 'nan:0.9:3'], "'nan:0.9:3' has no values"),
        (['--restitution', '0:inf:3'], 'is not finite'),
        (['--restitution', 'nan,0.9'], 'nan is not finite'),
        (['--restitution', '0.5,'], "'0.5,' cannot be read"),
        (['--restitution', '0.5,1.5'], '1.5 is outside [0, 1]'),
        (['--restitution', '0.5,0.5'], 'holds a value twice'),
        (['--restitution', 'a'], "--restitution: 'a' cannot be read"),
        (['--tray', '1,9'], '9 is outside [1, 8]'),
        (['--times', '2,1'], '--times: 2, 1 [s]; give one or more, rising'),
        (['--times', 'soon'], "--times: 'soon' cannot be read"),
        (['--runs', '0'], '--runs: 0; give a whole number'),
        (['--workers', '0'], '--workers: 0; give 1 or more'),
        (['--workers', '2', '--scheduler', 'tcp://127.0.0.1:1'], 'leave it out with --scheduler'),
        (['--scheduler', 'nowhere'], "--scheduler: 'nowhere' is no address; give tcp://host:port"),
        (['--task-seconds', 'nan'], '--task-seconds: nan; give a time above 0'),
        (['--figure', 'a.png'], '--figure: needs --reference; give both or neither'),
        (
            ['--figure', 'a.xyz', '--reference', '1'],
            "--figure: 'a.xyz' is no picture file; end it in",
        ),
        (['--figure', 'a.png', '--reference', '1'], '--figure: the grid is a single point'),
        ([*GRID, '--figure', 'a.png', '--reference', 'x'], "--reference: 'x' cannot be read"),
        ([*GRID, '--figure', 'a.png', '--reference', '0.6,0.5'], 'choose one of 0.9, 0.99'),
    ],
)
def test_a_wrong_call_is_one_line(tmp_path, capsys, arguments, message):
    output = tmp_path / 'a.npz'
    assert main(['sweep', '--runs', '2', '--times', '0,1', '-o', str(output), *arguments]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.startswith('nanorocks: ')
    assert printed.err.count('\n') == 1
    assert printed.out == ''
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('option', ['--nothing', '--noise'])
def test_unknown_flags_are_rejected(option, capsys):
    with pytest.raises(SystemExit) as ending:
        main(['sweep', '-o', 'a.npz', option, '1'])
    assert ending.value.code == 2
    assert 'no option of nanorocks sweep' in capsys.readouterr().err


def test_unusable_files_are_named(tmp_path, capsys):
    output = tmp_path / 'a.npz'
    output.write_text('mine')
    assert main(['sweep', *SMALL, '-o', str(output)]) == 1
    assert 'a.npz: exists and holds no sweep; delete it' in capsys.readouterr().err
    missing = ['--figure', 'a.png', '--reference', str(tmp_path / 'no.csv')]
    assert main(['sweep', *SMALL, *GRID, '-o', str(tmp_path / 'b.npz'), *missing]) == 1
    assert 'no.csv: does not exist' in capsys.readouterr().err


def test_ctrl_c_keeps_finished_runs_and_the_same_command_resumes(tmp_path):
    arguments = [
        '--restitution',
        '0.6:0.9:4',
        '--runs',
        '900',
        '--times',
        '0:20:5',
        '--seed',
        '3',
    ]
    quick = ['--workers', '2', '--task-seconds', '0.03']
    output = tmp_path / 'a.npz'
    folder = tmp_path / 'a.npz.parts'
    process = start(*arguments, *quick, '-o', str(output))
    while len(list(folder.glob('[0-9]*.npz'))) < 6:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.005)
    # A terminal sends the signal to the command and all its workers.
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate()
    assert process.returncode == 130
    runs = int(error.split('interrupted; ')[1].split(' of 3600')[0])
    # An earlier line may report the compilation of the simulation.
    assert error.splitlines()[-1] == (
        f'nanorocks: interrupted; {runs} of 3600 runs are kept in {folder}; '
        'the same command goes on from there'
    )
    assert 0 < runs < 3600
    assert not output.exists()

    again = start(*arguments, *quick, '-o', str(output))
    _, error = again.communicate()
    assert again.returncode == 0, error
    assert not folder.exists()
    straight = tmp_path / 'straight.npz'
    assert main(['sweep', *arguments, '-o', str(straight), '--workers', '1']) == 0
    resumed, uninterrupted = Sweep.load(output), Sweep.load(straight)
    for name in (*CURVES, 'pair_collisions', 'wall_collisions'):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(uninterrupted, name))


def test_a_terminated_command_leaves_no_workers_and_keeps_its_parts(tmp_path):
    output = tmp_path / 'a.npz'
    arguments = ['--runs', '20000', '--times', '0,20', '--task-seconds', '0.02', '--workers', '2']
    process = start(*arguments, '-o', str(output))
    folder = tmp_path / 'a.npz.parts'
    while len(list(folder.glob('[0-9]*.npz'))) < 4:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.005)
    process.terminate()
    process.communicate()
    # The process group is empty when its last process has ended.
    deadline = time.monotonic() + 60.0
    while True:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            break
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert len(list(folder.glob('[0-9]*.npz'))) >= 4


def test_a_table_that_cannot_be_written_is_refused_before_the_work(tmp_path, capsys):
    output = tmp_path / 'sweep.npz'
    words = ['--runs', '2', '--times', '0:1:2', '--restitution', '0.8']
    table = tmp_path / 'nowhere' / 'x.csv'
    assert main(['sweep', *words, '-o', str(output), '--csv', str(table)]) == 1
    assert 'there is no folder' in capsys.readouterr().err
    assert not output.exists()
