"""The sample bag is what its README says."""

from __future__ import annotations

import hashlib
import itertools
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.synthetic.film_bag import START_NS

BAGS = Path(__file__).parents[3] / 'bags'
TEXT = (BAGS / 'README.md').read_text(encoding='utf-8')


def test_the_checksum_is_that_of_the_bag():
    content = (BAGS / 'tray_1_sample' / 'tray_1_sample.mcap').read_bytes()
    assert hashlib.sha256(content).hexdigest() in TEXT


def test_the_command_makes_the_same_frames(tmp_path):
    (line,) = [line.strip() for line in TEXT.splitlines() if 'nanorocks simulate' in line]
    command = shlex.split(line)[1:]
    path = tmp_path / 'again'
    command[command.index('--bag') + 1] = str(path)
    command[command.index('--duration') + 1] = '2'
    assert main(command) == 0
    pairs = zip(BagFrames(BAGS / 'tray_1_sample').frames(), BagFrames(path).frames(), strict=False)
    count = 0
    for shipped, made in itertools.islice(pairs, 60):
        count += 1
        assert shipped.stamp_ns == made.stamp_ns
        # JPEGs of another release of OpenCV may differ in the last digit.
        assert np.abs(shipped.image.astype(int) - made.image).max() <= 6
    assert count == 60
    kept, again = (BagFrames(bag).truth(START_NS)[1] for bag in (BAGS / 'tray_1_sample', path))
    # The times of the sample are rounded, as version 0.1.0 wrote them.
    for old, new in zip(kept[:60], again, strict=True):
        assert abs(old.stamp_ns - new.stamp_ns) < 1000
        assert replace(old, stamp_ns=new.stamp_ns) == new


@pytest.mark.parametrize(
    ('flags', 'message'),
    [
        (('--duration', '-1'), 'duration'),
        (('--duration', 'nan'), 'duration'),
        (('--quality', '0'), 'quality'),
        (('--tray', '9'), 'tray: 9 is outside [1, 8]'),
        (('--restitution', '1.5'), 'restitution: 1.5 is outside'),
        (('--noise', 'nan'), 'noise'),
    ],
)
def test_a_run_that_cannot_be_filmed_is_exit_code_2_and_one_line(capsys, tmp_path, flags, message):
    path = tmp_path / 'bag'
    assert main(['simulate', '--bag', str(path), *flags]) == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]
    assert not path.exists()


def test_a_bag_that_exists_is_left_alone(capsys, tmp_path):
    path = tmp_path / 'bag'
    arguments = ['simulate', '--bag', str(path), '--duration', '0.2', '--width-px', '208']
    assert main(arguments) == 0
    before = {file.name: file.read_bytes() for file in path.iterdir()}
    assert main(arguments) == 1
    assert str(path) in capsys.readouterr().err.strip().splitlines()[-1]
    assert {file.name: file.read_bytes() for file in path.iterdir()} == before
