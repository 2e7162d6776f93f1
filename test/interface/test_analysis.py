"""``nr.analyse`` on the sample bag, twice: frames, words, figure."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import nanorocks_ros as nr
from nanorocks_ros.wire.products import MEASURED

SAMPLE = Path(__file__).resolve().parents[2] / 'bags/tray_1_sample'
# Of the simulation that made the sample.
TRUTH, WALLS = 0.89, 0.99


@pytest.fixture(scope='module')
def campaign(tmp_path_factory):
    twin = tmp_path_factory.mktemp('flight') / 'second'
    shutil.copytree(SAMPLE, twin)
    return nr.analyse([SAMPLE, twin], keep_tracks=True, progress=True)


def test_each_cycle_has_a_restitution_with_both_intervals(campaign):
    cor = campaign.cor
    assert cor[['recording', 'tray', 'cycle']].to_numpy().tolist() == [
        ['tray_1_sample', 1, 1],
        ['second', 1, 1],
    ]
    for name, truth in (('restitution', TRUTH), ('wall_restitution', WALLS)):
        assert (cor[f'{name}_lower'] < truth).all()
        assert (truth < cor[f'{name}_upper']).all()
        assert (cor[f'{name}_lower'] < cor[f'{name}_lower_68']).all()
        assert (cor[f'{name}_upper_68'] < cor[f'{name}_upper']).all()
    assert cor['status'].tolist() == ['final', 'final']
    assert cor['reason'].isna().all()


def test_all_cycles_together_count_every_contact_and_hold_the_truth(campaign):
    # Not narrower: a copy doubles what one recording says of laws of the speed, which then count.
    together, single = campaign.combined.iloc[0], campaign.cor.iloc[0]
    assert together['cycles'] == 2
    assert together['collisions'] == 2 * single['collisions']
    assert together['rebounds'] == 2 * single['rebounds']
    assert together['restitution_lower'] < TRUTH < together['restitution_upper']
    assert together['wall_restitution_lower'] < WALLS < together['wall_restitution_upper']
    assert together['restitution_lower'] < together['restitution_lower_68']
    assert together['restitution_upper_68'] < together['restitution_upper']


def test_speeds_clusters_contacts_and_tracks_are_tables(campaign):
    assert campaign.speeds['mean_projected_speed'].gt(0).any()
    assert set(campaign.clusters['cycle']) >= {1}
    contacts = campaign.contacts
    assert set(contacts['kind']) == {'collision', 'rebound'}
    walls = contacts['kind'] == 'rebound'
    assert contacts.loc[walls, 'wall'].isin(['left', 'right', 'top', 'bottom']).all()
    assert contacts.loc[walls, 'partner'].isna().all()
    assert contacts.loc[~walls, 'partner'].notna().all()
    assert contacts.loc[walls, 'speed_ratio'].median() == pytest.approx(WALLS, abs=0.01)
    frames = campaign.tracks.groupby('recording')['frame'].nunique()
    assert frames.nunique() == 1
    assert campaign.tracks['seen'].eq(1).mean() > 0.9


def test_every_table_has_units_and_provenance_that_json_can_hold(campaign):
    assert len(campaign.tables) == len(MEASURED) + 4
    for name in campaign.tables:
        frame = campaign.table(name)
        assert campaign.table(name) is frame
        assert set(frame.attrs['units']) == set(frame.columns)
        assert frame.attrs['provenance']['nanorocks_ros'] == nr.__version__
        json.dumps(frame.attrs)
    assert campaign.speeds.attrs['units']['mean_projected_speed'] == 'm/s'
    with pytest.raises(nr.ConfigurationError, match='choose from speeds'):
        campaign.table('speed')


def test_the_summary_tells_restitutions_with_intervals(campaign):
    text, page = repr(campaign), campaign._repr_html_()
    assert '2 recordings, 2 cycles' in text
    assert f'{campaign.cor["restitution"][0]:.3f}' in text
    assert 'decay and contacts together' in page
    assert page.count('<tr>') == 3
    assert '--' not in text


def test_the_figure_has_speeds_and_restitutions(campaign):
    figure = campaign.plot()
    assert isinstance(figure, Figure)
    decay, cycles = figure.axes
    assert len(decay.lines) == 2
    low, high = cycles.get_ylim()
    assert low < TRUTH < high


def test_tracks_that_were_not_kept_are_an_error_with_a_remedy(campaign, tmp_path):
    campaign.save(tmp_path / 'saved')
    again = nr.read(tmp_path / 'saved')
    with pytest.raises(nr.ConfigurationError, match='keep_tracks=True'):
        _ = again.tracks
    same = ['recording', 'cycle', 'status', 'quality', 'restitution', 'restitution_lower_68']
    expected = campaign.cor[same].sort_values('recording').reset_index(drop=True)
    read = again.cor[same].sort_values('recording').reset_index(drop=True)
    assert read['recording'].tolist() == expected['recording'].tolist()
    for name in same[1:4]:
        assert read[name].tolist() == expected[name].tolist()
    assert np.allclose(read['restitution'], expected['restitution'], rtol=1e-6)
    assert np.allclose(read['restitution_lower_68'], expected['restitution_lower_68'], rtol=1e-6)
    assert len(again.contacts) == len(campaign.contacts)
    assert np.allclose(again.speeds['time'], campaign.speeds.sort_values('recording')['time'])


def test_a_folder_without_results_cannot_be_read(tmp_path):
    with pytest.raises(nr.RecordingError, match='holds no results'):
        nr.read(tmp_path)
