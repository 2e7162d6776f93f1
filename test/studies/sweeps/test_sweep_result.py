"""Files of sweeps: damaged files, and files of other content, are refused."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.npz_archive import read_archive, write_archive
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan
from nanorocks_ros.studies.sweeps.sweep_result import Sweep
from nanorocks_ros.studies.sweeps.sweep_runs import sweep

HERE = Workers(processes=1)
PLAN = sweep_plan(SimulationSettings(seed=7), {}, (0.0, 0.5, 2.0, 6.0), 1)


@pytest.mark.parametrize('cut', [0, 1, 100, -1])
def test_a_file_cut_short_is_refused(tmp_path, cut):
    path = tmp_path / 'a.npz'
    sweep(PLAN, path, HERE)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(RecordingError, match=r'a.npz: is damaged, or no .npz file'):
        Sweep.load(path)


def test_files_that_hold_no_sweep_are_refused(tmp_path):
    path = tmp_path / 'a.npz'
    with pytest.raises(RecordingError, match=r'cannot be read \(No such file or directory\)'):
        Sweep.load(path)
    write_archive(path, {'a': np.zeros(3)})
    with pytest.raises(RecordingError, match='holds no sweep'):
        Sweep.load(path)
    np.save(tmp_path / 'single', np.zeros(3))
    with pytest.raises(RecordingError, match='is damaged, or no'):
        Sweep.load(tmp_path / 'single.npy')
    sweep(PLAN, tmp_path / 'b.npz', HERE)
    arrays = read_archive(tmp_path / 'b.npz')
    write_archive(path, {**arrays, 'mean_speed': np.zeros((2, 2))})
    with pytest.raises(RecordingError, match='holds no sweep'):
        Sweep.load(path)
