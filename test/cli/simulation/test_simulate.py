"""The command ``nanorocks simulate``."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.synthetic.film_bag import START_NS

SMALL = ('--width-px', '64', '--height-px', '64', '--pixels-per-metre', '4000')
QUICK = ('--duration', '1', '--times', '6')
# Printed when the engine is compiled, on its first use.
COMPILING = 'compiling'
OWN = """
materials: {steel: {density_g_cm3: 7.8, color_bgr: [150, 150, 150]}}
trays:
  4:
    dimensions_mm: [10, 10, 3]
    species:
      - {material: steel, diameter_mm: 1, count: COUNT}
"""


def simulate(capsys, *arguments):
    """Exit code, standard output, and the lines of standard error."""
    try:
        code = main(['simulate', *arguments])
    except SystemExit as ending:
        code = ending.code
    printed = capsys.readouterr()
    return code, printed.out, [line for line in printed.err.splitlines() if COMPILING not in line]


def result(capsys, *arguments):
    code, out, err = simulate(capsys, *arguments, '--json')
    assert (code, err) == (0, [])
    return json.loads(out)


def own_trays(tmp_path, count=20):
    path = tmp_path / 'own.yaml'
    path.write_text(OWN.replace('COUNT', str(count)))
    return str(path)


def test_the_json_contract_holds_without_a_bag(capsys):
    flags = ('--restitution', '0.8', '--wall-restitution', '0.9', '--sticking-speed', '0.001')
    values = result(capsys, '--tray', '3', '--runs', '4', '--seed', '7', '--duration', '6', *flags)
    assert (values['tray'], values['runs'], values['seed']) == (3, 4, 7)
    assert values['settings']['wall_restitution'] == 0.9
    assert isinstance(values['events'], int)
    assert values['cpu_seconds'] > 0.0
    curves = [values[name] for name in ('time', 'mean_speed', 'mean_projected_speed', 'bodies')]
    assert [len(curve) for curve in curves] == [181] * 4
    time_, speed, projected, bodies = map(np.array, curves)
    assert time_[0] == 0.0
    assert time_[-1] == 6.0
    assert speed[-1] < 0.6 * speed[0]
    assert 0.7 < (projected / speed).mean() < 0.85
    assert bodies[0] == 55.0
    assert bodies[-1] < 55.0


def test_runs_are_averaged(capsys):
    single = result(capsys, *QUICK)
    averaged = result(capsys, '--runs', '3', *QUICK)
    assert single['mean_speed_error'] is None
    assert len(averaged['mean_speed_error']) == 6
    assert averaged['mean_speed'] != single['mean_speed']
    assert averaged['events'] > 2 * single['events']


def test_the_same_seed_gives_the_same_speeds(capsys):
    first, again, other = (result(capsys, *QUICK, '--seed', seed) for seed in '336')
    assert first['mean_speed'] == again['mean_speed'] != other['mean_speed']


def test_without_json_a_table_is_printed(capsys):
    code, out, err = simulate(capsys, '--tray', '3', '--duration', '20', '--runs', '2')
    assert (code, err) == (0, [])
    rows = {line[:17].strip(): line[17:] for line in out.splitlines()}
    assert rows['tray'] == '3'
    assert rows['beads'] == '55'
    assert float(rows['filling factor']) == pytest.approx(0.09, abs=0.005)
    assert 'mm/s at the start' in rows['mean speed']
    assert 1.0 < float(rows['half that speed'].removesuffix(' s')) < 20.0
    assert rows['bodies at end'] == '55'
    assert 'written' not in rows


def test_a_custom_tray_is_simulated(capsys, tmp_path):
    values = result(capsys, '--trays-file', own_trays(tmp_path), *QUICK)
    assert (values['tray'], values['beads']) == (4, 20)


def test_all_outputs_are_written_together(capsys, tmp_path):
    files = {'trajectory': 't.npz', 'events': 'e.npz', 'picture': 'p.png', 'video': 'v.avi'}
    paths = {name: str(tmp_path / file) for name, file in files.items()}
    flags = [text for name, path in paths.items() for text in (f'--{name}', path)]
    bag = str(tmp_path / 'bag')
    trays = ('--trays-file', own_trays(tmp_path))
    code, out, _ = simulate(capsys, *trays, *QUICK, *SMALL, *flags, '--bag', bag)
    assert code == 0
    assert out.splitlines()[-1].split(maxsplit=1)[1] == ', '.join([*paths.values(), bag])
    with np.load(paths['trajectory']) as arrays:
        assert arrays['positions'].shape == (6, 20, 3)
        assert set(arrays['materials']) == {'steel'}
    assert cv2.imread(paths['picture']) is not None
    assert cv2.VideoCapture(paths['video']).read()[1].shape == (64, 64, 3)
    assert len(BagFrames(tmp_path / 'bag').truth(START_NS)[4]) == 30
    assert {path.name for path in tmp_path.iterdir()} == {*files.values(), 'bag', 'own.yaml'}


def test_a_bag_adds_its_frames_to_the_json(capsys, tmp_path):
    bag = str(tmp_path / 'bag')
    values = result(capsys, *QUICK, *SMALL, '--bag', bag)
    assert (values['frames'], values['duration'], values['bag']) == (30, 1.0, bag)
    assert len(values['mean_speed']) == 6
    assert values['files'] == {'bag': bag}


def noise_in(folder):
    """Standard deviation of the image outside the tray, which is 0 without noise."""
    frame = next(BagFrames(folder).frames())
    return float(np.std(frame.image[:2].astype(float), axis=1).mean())


def test_effects_can_be_switched_off(capsys, tmp_path):
    spreads = []
    for effects in ('all', 'none'):
        bag = tmp_path / effects
        quality = ('--quality', '100', '--effects', effects)
        far = (*SMALL, '--pixels-per-metre', '2000')
        result(capsys, '--duration', '0.1', *far, '--bag', str(bag), *quality)
        spreads.append(noise_in(bag))
    assert spreads[0] > 1.0
    assert spreads[1] < 0.1


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (['--runs', '0'], 2, '--runs: 0; give 1 or more'),
        (['--times', '1'], 2, '--times: 1; give 2 or more'),
        (['--duration', 'nan'], 2, '--duration: nan; give seconds above 0, up to 86400'),
        (['--workers', '0'], 2, '--workers: 0; give 1 or more'),
        (['--tray', '9'], 2, 'tray: 9 is outside [1, 8]'),
        (['--restitution', 'much'], 2, '--restitution: '),
        (['--trays-file', 'no.yaml'], 2, 'no.yaml: No such file'),
        (['--trajectory', 'run.csv'], 2, 'run.csv ends in none of .npz, .parquet'),
        (['--trajectory', 'a.npz', '--events', 'a.npz'], 2, 'names the file of --trajectory'),
        (['--bag', 'bag', '--quality', '0'], 2, '--quality: 0'),
        (['--bag', 'bag', '--effects', 'none', '--noise', '3'], 2, '--effects: '),
        (['--runs', '9999', '--tray', '8', '--trajectory', 'a.npz'], 2, 'fewer --times or --runs'),
        (['--trajectory', 'nowhere/run.npz'], 1, 'there is no folder nowhere'),
        (['--bag', 'bag', '--width-px', '50'], 1, 'in a picture of 50 x 1080'),
    ],
)
def test_a_wrong_call_is_one_line(capsys, tmp_path, monkeypatch, arguments, code, message):
    monkeypatch.chdir(tmp_path)
    exit_code, out, err = simulate(capsys, *arguments)
    assert (exit_code, out, len(err)) == (code, '', 1)
    assert message in err[0]
    assert err[0].startswith('nanorocks: ')
    assert list(tmp_path.iterdir()) == []


def test_beads_that_do_not_fit_are_unusable_input(capsys, tmp_path):
    code, _, err = simulate(capsys, '--trays-file', own_trays(tmp_path, count=900))
    assert code == 1
    assert len(err) == 1


def test_existing_files_are_replaced_only_with_force(capsys, tmp_path):
    path = tmp_path / 'run.npz'
    path.write_bytes(b'mine')
    code, _, err = simulate(capsys, *QUICK, '--trajectory', str(path))
    assert code == 1
    assert err[0].endswith('exists already and is not overwritten; name another, or add --force')
    assert path.read_bytes() == b'mine'
    assert simulate(capsys, *QUICK, '--trajectory', str(path), '--force')[0] == 0
    assert path.read_bytes() != b'mine'


def test_ctrl_c_names_the_files_that_remain(tmp_path):
    command = [sys.executable, '-c', 'from nanorocks_ros.cli.main import main; exit(main())']
    files = ('--trajectory', 'run.npz', '--bag', 'bag', *SMALL)
    process = subprocess.Popen(
        [*command, 'simulate', '--duration', '80000', '--times', '6', *files],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'},
    )
    try:
        # The first frames follow after the camera is compiled.
        film = tmp_path / 'bag' / 'bag.mcap'
        while not film.exists() or film.stat().st_size < 100_000:
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130
    assert error.splitlines()[-1] == (
        'nanorocks: interrupted; complete: run.npz; bag can be read up to the last frame written'
    )
    assert len(BagFrames(tmp_path / 'bag').truth(START_NS)[1]) > 0
    assert {path.name for path in tmp_path.iterdir()} == {'run.npz', 'bag'}
