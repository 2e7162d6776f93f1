"""Contacts and bodies of the last second of a recording are among its results."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.analysis.results.results_folder import write_results
from nanorocks_ros.studies.results.results_provenance import BAG_NAME
from nanorocks_ros.wire import topics

NS = 1_000_000_000
RATE = 30
FRAMES = 100
# Of the rebound and the collision: 0.45 s before the end.
CONTACT = 86.4
TRAY = load_trays()[1]
RADIUS = 0.5 * TRAY.diameter
# A bead at 3 mm/s comes so far between two pictures.
STEP = 3e-3 / RATE
SETTINGS = with_values(PipelineSettings(), {'speed.method': 'tracking'}, 'test')


def positions(frame):
    """One bead comes back from the low wall, two meet, and two fly past."""
    before = STEP * abs(frame - CONTACT)
    return np.array(
        [
            (RADIUS + before, 3e-3, 1.5e-3),
            (7.5e-3 - RADIUS - before, 11e-3, 1.5e-3),
            (7.5e-3 + RADIUS + before, 11e-3, 1.5e-3),
            (11e-3, 2e-3 + 0.4 * STEP * frame, 1.5e-3),
            (13.5e-3, 6e-3 - 0.4 * STEP * frame, 1.5e-3),
        ]
    )


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    """A bag that ends right after a rebound and a collision."""
    path = tmp_path_factory.mktemp('film') / 'bag'
    simulation = SimulationSettings(width_px=260, height_px=260, seed=2)
    camera = TrayCamera(simulation, TRAY, np.full(5, RADIUS), ('acrylic',) * 5)
    table = {topic.absolute(): offered_topic(topic) for topic in (topics.EPOCH, topics.RAW)}
    with BagWriter(path, table, metadata={}) as bag:
        bag.write(topics.EPOCH.absolute(), 0, time_message(0))
        for frame in range(FRAMES):
            stamp_ns = frame * NS // RATE
            pixels = camera.picture(positions(frame), frame)
            message = image_message(stamp_ns, 'camera', 'bgr8', pixels)
            bag.write(topics.RAW.absolute(), stamp_ns, message)
    return path


@pytest.fixture(scope='module')
def analysis(film):
    return analyse(film, SETTINGS)


@pytest.mark.parametrize('contacts', ['rebounds', 'collisions'])
def test_a_contact_right_before_the_end_is_found(analysis, contacts):
    (contact,) = getattr(analysis.trays[1], contacts)
    assert contact.stamp_ns == pytest.approx(CONTACT * NS / RATE, abs=0.02 * NS)


def test_bodies_are_counted_up_to_the_end(analysis):
    last = analysis.trays[1].bodies[-1]
    assert FRAMES / RATE - last.stamp_ns / NS < SETTINGS.bodies.interval + 2 / RATE


@pytest.mark.parametrize('table', ['rebound', 'collision', 'bodies'])
def test_the_tables_and_the_results_bag_hold_the_last_second(analysis, film, tmp_path, table):
    write_results(analysis, tmp_path / 'results', film, SETTINGS)
    with (tmp_path / 'results' / f'tray_1_{table}.csv').open(newline='') as stream:
        times = [float(row['time']) for row in csv.DictReader(stream)]
    assert max(times) > FRAMES / RATE - 0.5
    bag = open_bag(tmp_path / 'results' / BAG_NAME)
    (topic,) = (name for name in bag.topics if name.endswith(f'/{table}'))
    recorded = [bag.deserialize(message).data[0] for message in bag.messages([topic])]
    assert sorted(recorded) == pytest.approx(sorted(times), abs=1e-4)
