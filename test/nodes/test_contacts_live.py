"""Contacts alone over real DDS: a ball on a floor, of which nothing is told but its diameter."""

from __future__ import annotations

import cv2
import pytest

pytest.importorskip('rclpy')

from benchmarks.flat_discs import FlatBox, flat_pictures, flat_run
from nanorocks_ros.cli.main import main
from nanorocks_ros.records import CorEstimate, CorStatus, Headline, Rebound
from nanorocks_ros.studies.measure.film_tray import FilmedBeads, FilmedTray, described_tray
from nanorocks_ros.wire import topics

from .result_arrays import ResultArrays

SCALE, RATE = 5000.0, 60.0
# Four nodes prepare at the same time, and the look of the ball is learnt as the film goes on.
_PATIENCE_S = 150.0
BALL = FlatBox(count=1, gravity=(0.0, 0.4), speed=0.05, wall_restitution=0.8)
STAGES = ('preprocessor', 'speed_estimator', 'cluster_autocorrelator', 'haff_fitter')


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    """A bag of a ball that bounces and rolls on, and its trays file."""
    folder = tmp_path_factory.mktemp('ball')
    images = folder / 'images'
    images.mkdir()
    run = flat_run(BALL, 4.5, rate=RATE, seed=3)
    for k, picture in enumerate(flat_pictures(run, BALL, SCALE)):
        cv2.imwrite(str(images / f'{k:04d}.png'), picture)
    bag, trays_file = folder / 'bag', folder / 'mine.yaml'
    assert main(['import', str(images), '--rate', f'{RATE:g}', '-o', str(bag)]) == 0
    size = tuple(round(side * SCALE) for side in BALL.sides)
    filmed = FilmedTray(beads=(FilmedBeads(diameter_px=2.0 * BALL.radius * SCALE),))
    trays_file.write_text(described_tray(filmed, size).text, encoding='utf-8')
    return bag, trays_file


def end_of(graph, process):
    graph.until(lambda: process.poll() is not None, _PATIENCE_S)
    return graph.wait(process)


def assert_ball(cor):
    walls = cor.contact_wall_restitution
    assert cor.headline is Headline.CONTACTS
    assert cor.rebounds > 3
    assert walls.lower < BALL.wall_restitution < walls.upper


@pytest.mark.parametrize('workers', [0, 1])
def test_the_pipeline_publishes_the_restitution_of_the_floor(graph, film, workers):
    bag, trays_file = film
    arrays = ResultArrays(graph.node)
    process = graph.start(
        'pipeline',
        'source:=bag',
        f'bag:={bag}',
        f'trays_file:={trays_file}',
        'rate:=0.0',
        f'workers:={workers}',
    )
    finished = end_of(graph, process)
    assert finished.code == 0, finished.output
    assert 'Traceback' not in finished.output
    for words in (
        'restitutions are those of contacts alone: the trays file does not tell the container',
        'free beads accelerate by',
        'floor: 0.',
    ):
        assert words in finished.output
    graph.until(lambda: arrays.final_cors())
    (final,) = arrays.final_cors()
    assert_ball(final)
    assert len(arrays.records(Rebound)) == final.rebounds


def test_separate_nodes_publish_it_while_the_film_runs(graph, film):
    bag, trays_file = film
    arrays = ResultArrays(graph.node)
    told = f'trays_file:={trays_file}'
    stages = {name: graph.start(name, told) for name in STAGES}
    name = graph.node.resolve_topic_name(topics.SPEED.of(1))
    graph.until(lambda: graph.node.count_subscribers(name) >= 2, _PATIENCE_S)
    player = graph.start('bag_player', f'bag:={bag}', 'rate:=0.0', 'listeners:=3')
    finished = end_of(graph, player)
    assert finished.code == 0, finished.output
    graph.until(lambda: any(cor.rebounds > 3 for cor in arrays.records(CorEstimate)))
    assert_ball(arrays.records(CorEstimate)[-1])
    assert arrays.records(CorEstimate)[-1].status is CorStatus.COOLING
    for stage in stages.values():
        ended = graph.interrupt(stage)
        assert ended.code == 0, ended.output
        assert 'Traceback' not in ended.output
