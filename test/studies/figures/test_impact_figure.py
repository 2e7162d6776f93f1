"""The figure of restitution against impact speed, and the tables that it is drawn from."""

from __future__ import annotations

import cv2
import pytest
from contact_results import contact_results

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.settings import PriorSettings
from nanorocks_ros.studies.analysis.results.contact_tables import contacts_of_results
from nanorocks_ros.studies.figures.impact_figure import ImpactData, impact_figure

PRIOR = PriorSettings()


def falling(speed):
    return 1.0 - 0.2 * (speed / 3e-3) ** 0.5


def data_of(*folders, tray=1):
    terms, losses, cycles = contacts_of_results(folders, tray, PRIOR)
    return ImpactData(tray=tray, cycles=cycles, terms=terms, losses=losses, prior=PRIOR)


def test_contacts_in_the_window_of_every_recording_count(tmp_path):
    first = contact_results(tmp_path / 'a', falling, contacts=40, late=5)
    second = contact_results(tmp_path / 'b', falling, contacts=30, seed=2)
    terms, _, cycles = contacts_of_results([first, second], 1, PRIOR)
    assert cycles == 2
    assert terms.rebounds == terms.collisions == 70


def test_a_law_of_the_impact_speed_is_drawn_with_its_numbers(tmp_path):
    path = tmp_path / 'impacts.png'
    values = impact_figure(path, data_of(contact_results(tmp_path / 'a', falling)))
    assert cv2.imread(str(path)).std() > 10.0
    for kind in ('beads', 'walls'):
        law = values[kind]['law']
        speed = law['impact_speed']
        assert law['exponent']['lower'] < 0.5 < law['exponent']['upper']
        at_speed = law['impact_restitution']
        assert at_speed['lower'] < falling(speed) < at_speed['upper']
        assert law['chance_of_constant'] < 0.05
        ranges = values[kind]['ranges']
        assert sum(each['contacts'] for each in ranges) >= 145
        assert ranges[0]['restitution'] > ranges[-1]['restitution'] + 0.05
        assert law['energy_weighted']['value'] < values[kind]['constant']['value']


def test_a_constant_restitution_is_told_from_a_law(tmp_path):
    folder = contact_results(tmp_path / 'a', lambda speed: 0.85, tray=3)
    values = impact_figure(tmp_path / 'constant.png', data_of(folder, tray=3))
    for kind in ('beads', 'walls'):
        assert values[kind]['law']['chance_of_constant'] > 0.05
        constant = values[kind]['constant']
        assert constant['lower'] < 0.85 < constant['upper']


def test_too_few_contacts_cannot_be_drawn(tmp_path):
    folder = contact_results(tmp_path / 'a', falling, contacts=9)
    with pytest.raises(FitError, match='9 collisions and 9 rebounds are too few; give more'):
        impact_figure(tmp_path / 'few.png', data_of(folder))
    assert not (tmp_path / 'few.png').exists()


def test_tables_that_are_none_are_named(tmp_path):
    folder = contact_results(tmp_path / 'a', falling, contacts=20)
    with pytest.raises(RecordingError, match='no cycle of tray 3 cools freely'):
        contacts_of_results([folder], 3, PRIOR)
    (folder / 'tray_1_rebound.csv').write_text('time [s],cycle [1]\n1.0,1.0\n')
    with pytest.raises(RecordingError, match=r'tray_1_rebound.csv: is no table of contacts'):
        contacts_of_results([folder], 1, PRIOR)
