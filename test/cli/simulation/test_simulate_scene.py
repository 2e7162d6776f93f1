"""The command ``nanorocks simulate --scene``."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

SMALL = ('--width-px', '640', '--height-px', '480', '--scene-pixels-per-metre', '5600')
QUICK = ('--scene', '--duration', '0.2', '--scene-trays', '1', *SMALL)


def simulate(capsys, *arguments):
    try:
        code = main(['simulate', *arguments])
    except SystemExit as ending:
        code = ending.code
    printed = capsys.readouterr()
    return (
        code,
        printed.out,
        [line for line in printed.err.splitlines() if 'compiling' not in line],
    )


def test_a_scene_is_filmed_into_a_bag_a_video_and_a_picture(capsys, tmp_path):
    paths = {name: str(tmp_path / name) for name in ('bag', 'scene.png', 'scene.avi')}
    flags = ('--bag', paths['bag'], '--picture', paths['scene.png'], '--video', paths['scene.avi'])
    code, out, err = simulate(capsys, *QUICK, *flags, '--seed', '3', '--json')
    assert (code, err) == (0, [])
    values = json.loads(out)
    assert values['trays'] == [1]
    assert (values['frames'], values['duration'], values['seed']) == (6, 0.2, 3)
    assert values['bag'] == paths['bag']
    assert set(values['files']) == {'bag', 'picture', 'video'}
    assert values['settings']['scene']['pixels_per_metre'] == 5600
    assert cv2.imread(paths['scene.png']).shape == (480, 640, 3)
    frames = list(BagFrames(paths['bag']).frames())
    assert len(frames) == 6
    assert frames[0].image.shape == (480, 640, 3)


def test_the_written_files_are_printed(capsys, tmp_path):
    path = str(tmp_path / 'scene.png')
    code, out, err = simulate(capsys, *QUICK, '--picture', path)
    assert (code, err) == (0, [])
    assert out.splitlines()[-1].split(maxsplit=1) == ['written', path]


def test_a_drawn_camera_films_one_tray_from_near(capsys, tmp_path):
    path = str(tmp_path / 'near.avi')
    flags = ('--scene', '--effects', 'drawn', '--scene-trays', '1', '--duration', '0.1')
    code, out, err = simulate(
        capsys, *flags, '--seed', '4', '--scene-exposure', '0', '--video', path, '--json'
    )
    assert (code, err) == (0, [])
    settings = json.loads(out)['settings']
    assert settings['scene']['close_up']
    assert settings['scene']['exposure'] == 0.0
    video = cv2.VideoCapture(path)
    assert video.read()[1].shape == (
        settings['simulation']['height_px'],
        settings['simulation']['width_px'],
        3,
    )


def test_single_effects_can_be_added_to_none(capsys, tmp_path):
    pictures = []
    for name, flags in (('none', ()), ('noise', ('--scene-noise', '4'))):
        path = tmp_path / f'{name}.png'
        code, _, err = simulate(
            capsys, *QUICK, '--effects', 'none', *flags, '--picture', str(path)
        )
        assert (code, err) == (0, [])
        pictures.append(cv2.imread(str(path)).astype(float))
    # Beside the plate the image is dark, and uniform without noise.
    noise = (pictures[1] - pictures[0])[200:280, :60]
    assert np.std(noise) == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (['--scene'], 2, '--scene: has no output; name a --bag, --video or --picture'),
        (
            ['--scene', '--bag', 'b', '--tray', '3'],
            2,
            '--tray: is a setting of one tray; use --scene-',
        ),
        (['--scene', '--bag', 'b', '--noise', '3'], 2, '--noise: is a setting of one tray; use'),
        (['--scene', '--bag', 'b', '--runs', '3'], 2, '--runs: is a setting of one tray'),
        (['--scene', '--bag', 'b', '--events', 'e.npz'], 2, '--events: is a setting of one tray'),
        (['--scene', '--bag', 'b', '--duration', '0'], 2, '--duration: 0'),
        (['--scene', '--bag', 'b', '--quality', '0'], 2, '--quality: 0'),
        (['--scene', '--bag', 'b', '--scene-glare', 'much'], 2, '--scene-glare: '),
        (['--scene', '--bag', 'b', '--scene-glare', '9'], 2, 'scene.glare: 9 is outside [0, 5]'),
        (['--scene', '--bag', 'b', '--scene-trays', '1', '9'], 2, 'scene.trays: 9 is outside'),
        (['--scene', '--bag', 'b', '--scene-trays', '2', '2'], 2, 'is empty or has duplicates'),
        (['--scene', '--bag', 'b', '--compression-codec', 'av1'], 2, 'is none of jpeg, jpeg_rate'),
        (['--scene', '--effects', 'drawn', '--bag', 'b'], 2, 'not over 8; add --scene-trays 1'),
        (['--effects', 'drawn', '--bag', 'b'], 2, 'add --scene --scene-trays 1'),
        (['--scene', '--picture', 'scene.pdf'], 2, 'scene.pdf ends in none of .png, .jpg'),
        (
            ['--scene', '--bag', 'b', '--width-px', '300'],
            2,
            'lies outside a picture of 300 x 1080',
        ),
        (
            ['--scene-noise', '3', '--bag', 'b'],
            2,
            '--scene-noise: is a setting of the whole plate; add',
        ),
    ],
)
def test_a_wrong_call_is_one_line(capsys, tmp_path, monkeypatch, arguments, code, message):
    monkeypatch.chdir(tmp_path)
    exit_code, out, err = simulate(capsys, *arguments)
    assert (exit_code, out, len(err)) == (code, '', 1)
    assert message in err[0]
    assert err[0].startswith('nanorocks: ')
    assert list(tmp_path.iterdir()) == []
