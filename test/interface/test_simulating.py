"""``nr.simulate``: tables of runs, and films."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

import nanorocks_ros as nr


@pytest.fixture(scope='module')
def runs():
    return nr.simulate(tray=1, duration=5.0, runs=2, seed=3, restitution=0.8, keep_tracks=True)


def test_tables_hold_every_run(runs):
    assert set(runs.speeds['run']) == {0, 1}
    assert (
        runs.speeds.groupby('run')['mean_speed'].agg(['first', 'last']).eval('last < first').all()
    )
    assert runs.cor['restitution'].item() == 0.8
    assert set(runs.contacts['type']) == {'pair', 'wall'}
    assert len(runs.tracks) == 2 * 15 * runs.speeds['time'].nunique()
    assert runs.clusters['beads_of_a_body'].eq(1.0).all()
    for name in runs.tables:
        frame = runs.table(name)
        assert set(frame.attrs['units']) == set(frame.columns)


def test_the_same_seed_gives_the_same_run(runs):
    again = nr.simulate(tray=1, duration=5.0, runs=2, seed=3, restitution=0.8)
    assert again.speeds.equals(runs.speeds)
    with pytest.raises(nr.ConfigurationError, match='keep_tracks=True'):
        _ = again.tracks


def test_summary_and_figure(runs):
    assert '2 runs, seed 3' in repr(runs)
    assert isinstance(runs.plot(), Figure)


def test_a_film_that_exists_is_kept_unless_told(tmp_path):
    film = tmp_path / 'film.avi'
    nr.simulate(duration=0.2, film=film)
    size = film.stat().st_size
    with pytest.raises(nr.RecordingError, match='exists'):
        nr.simulate(duration=0.3, film=film)
    assert film.stat().st_size == size
    nr.simulate(duration=0.3, film=film, overwrite=True)
    assert film.stat().st_size > size


def test_a_bag_names_its_tray(tmp_path):
    nr.simulate(tray=1, duration=0.3, film=tmp_path / 'bag', width_px=208, height_px=208)
    assert (tmp_path / 'bag/metadata.yaml').is_file()
