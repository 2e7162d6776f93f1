"""``nr.simulate``, ``nr.track`` and ``nr.measure`` on one film whose truth is known."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

import nanorocks_ros as nr

TRUTH, WALLS = 0.85, 0.97
# Of a bead of 2 mm in a close-up of tray 1.
DIAMETER_PX = 77.4


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp('films') / 'film.avi'
    nr.simulate(tray=1, duration=7.0, restitution=TRUTH, wall_restitution=WALLS, seed=1, film=path)
    return path


@pytest.fixture(scope='module')
def measured(film):
    return nr.measure(film, diameter_px=DIAMETER_PX, diameter_mm=2, height_mm=3, progress=True)


def test_contacts_of_a_film_give_the_true_restitutions(measured):
    cor = measured.cor.set_index('partner')
    assert measured.usable
    for partner, truth in (('beads', TRUTH), ('walls', WALLS)):
        row = cor.loc[partner]
        assert row['restitution_lower'] < truth < row['restitution_upper']
        assert row['restitution_lower'] < row['restitution_lower_68'] < row['restitution']
        assert row['restitution'] < row['restitution_upper_68'] < row['restitution_upper']
    kinds = measured.contacts['kind'].value_counts()
    assert kinds['collision'] == cor.loc['beads', 'contacts']
    assert kinds['rebound'] == cor.loc['walls', 'contacts']
    assert measured.contacts.attrs['units']['speed_before'] == 'm/s'
    assert measured.decay is None


def test_contacts_lie_on_the_tracks(measured):
    tracks = measured.tracks.set_index(['id', 'frame']).sort_index()
    rebounds = measured.contacts.query("kind == 'rebound'")
    for contact in rebounds.itertuples():
        own = tracks.loc[contact.bead]
        near = own.iloc[(own['time'] - contact.time).abs().argmin()]
        assert abs(near['x'] - contact.x) < 4e-4
        assert abs(near['y'] - contact.y) < 4e-4


def test_tracks_and_speeds_are_tables(measured):
    assert measured.tracks['id'].nunique() == 15
    assert measured.speeds['mean_speed'].max() == pytest.approx(6e-3, rel=0.5)


def test_results_lie_beside_the_film_and_are_taken_from_there(measured, film):
    assert measured.folder == film.parent / '.nanorocks/film.avi_measured'
    before = (measured.folder / 'tracks.npz').stat().st_mtime_ns
    again = nr.measure(film, diameter_px=DIAMETER_PX, diameter_mm=2, height_mm=3)
    assert (measured.folder / 'tracks.npz').stat().st_mtime_ns == before
    assert again.contacts.equals(measured.contacts)


def test_the_folder_is_read_as_it_was_measured(measured):
    again = nr.read(measured.folder)
    assert isinstance(again, nr.MeasureResult)
    for name in measured.tables:
        own, read = measured.table(name), again.table(name)
        assert read.equals(own)
        assert read.attrs['units'] == own.attrs['units']
        assert set(own.attrs['units']) == set(own.columns)
    # Only what the import of the film said is told once.
    assert set(repr(again).splitlines()) <= set(repr(measured).splitlines())
    assert again._summary().rows == measured._summary().rows
    assert again.provenance['film'] == 'film.avi'
    single = nr.read(measured.folder / 'tracks.csv')
    assert single.table('tracks').equals(measured.tracks)
    provenance = measured.contacts.attrs['provenance']
    assert provenance['settings']['cooling.probability'] == measured.cor.attrs['probability']
    assert 'film:' in provenance['trays_file']


def test_a_run_that_was_interrupted_is_no_result(tmp_path):
    (tmp_path / 'measured.json').write_text('{}')
    with pytest.raises(nr.RecordingError, match=r'not complete.*again'):
        nr.read(tmp_path)


def test_the_summary_tells_what_is_missing_in_the_words_of_python(measured):
    text = repr(measured)
    assert 'decay: not read; it needs the container: corners, sides_mm' in text
    assert 'all' in text or 'beads seen' in text
    assert '<table>' in measured._repr_html_()
    lens = [notice for notice in measured.notices if 'free of distortion' in notice]
    assert lens
    assert all('film.avi: neither' in notice and '.nanorocks' not in notice for notice in lens)
    assert isinstance(measured.plot(), Figure)


def test_without_any_length_all_is_in_px(film):
    tracked = nr.track(film, diameter_px=DIAMETER_PX)
    names = set(tracked.tracks.columns)
    assert {'x_px', 'vx_px'} <= names
    assert 'x' not in names
    assert len(tracked.plot().axes) == 1
    assert 'diameter_mm gives them in mm' in repr(tracked)


def test_a_film_of_which_nothing_is_told_is_an_error(film):
    with pytest.raises(nr.ConfigurationError, match='diameter_px=31'):
        nr.measure(film)


def test_results_are_no_film(measured):
    with pytest.raises(nr.RecordingError, match=r'is a folder of results.*here film\.avi'):
        nr.measure(measured.folder, diameter_px=DIAMETER_PX)
