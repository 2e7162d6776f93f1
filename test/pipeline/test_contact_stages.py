"""Trays of which too little is known for the decay: contacts in the pipeline, in words, too."""

from __future__ import annotations

import re

import cv2
import pytest

from benchmarks.flat_discs import FlatBox, flat_pictures, flat_run
from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import OpenTrayStages, Pipeline, TrayStages, Wanted
from nanorocks_ros.pipeline.open_trays import estimator_of, measurement_of, reason_for_contacts
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import (
    CorEstimate,
    CorStatus,
    Frame,
    Notice,
    Rebound,
    Tracks,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.contact_restitution.contact_estimator import ContactEstimator
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator
from nanorocks_ros.studies.measure.film_tray import FilmedBeads, FilmedTray, described_tray

SCALE, RATE = 5000.0, 60.0
# A ball that bounces, and rolls for half of the film.
BALL = FlatBox(count=1, gravity=(0.0, 0.4), speed=0.05, wall_restitution=0.8)
STEEL = (
    'materials:\n  steel: {density_g_cm3: 7.8, color_bgr: [90, 90, 90]}\n'
    'trays:\n  1:\n    dimensions_mm: [60, 45, 4]\n    species:\n'
    '      - {material: steel, diameter_mm: 3, count: 8}\n'
)


def settings_of(text):
    told = with_values(PipelineSettings(), {'trays_file': text}, 'test')
    return recorded_settings(told, {'trays_file'}, {}, 'test').settings


def ball_settings():
    size = tuple(round(side * SCALE) for side in BALL.sides)
    filmed = FilmedTray(beads=(FilmedBeads(diameter_px=2.0 * BALL.radius * SCALE),))
    return settings_of(described_tray(filmed, size).text)


def frames_of(pictures):
    for k, picture in enumerate(pictures):
        yield Frame(stamp_ns=1 + round(k * 1e9 / RATE), encoding='bgr8', image=picture)


@pytest.fixture(scope='module')
def pictures():
    return list(flat_pictures(flat_run(BALL, 8.0, rate=RATE, seed=3), BALL, SCALE))


@pytest.fixture(scope='module')
def followed(pictures):
    """What the pipeline gives of the ball."""
    pipeline = Pipeline(ball_settings(), 'test', contacts_suffice=True)
    records = [record for frame in frames_of(pictures) for record in pipeline.push(frame)]
    return [*records, *pipeline.flush()]


def test_a_ball_that_falls_gives_the_restitution_of_the_floor_live(followed):
    (final,) = (
        record
        for record in followed
        if isinstance(record, CorEstimate) and record.status is CorStatus.FINAL
    )
    walls = final.contact_wall_restitution
    assert final.rebounds > 5
    assert walls.lower < BALL.wall_restitution < walls.upper
    assert walls.upper - walls.lower < 0.05
    assert (final.restitution.lower, final.restitution.upper) == (0.0, 1.0)
    assert sum(isinstance(record, Rebound) for record in followed) == final.rebounds
    running = [record for record in followed if isinstance(record, CorEstimate)]
    assert running[0].stamp_ns < 5e9


def test_the_words_are_those_of_measure(followed, pictures, tmp_path, capsys):
    folder = tmp_path / 'ball'
    folder.mkdir()
    for k, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f'{k:04d}.png'), picture)
    bag = tmp_path / 'bag'
    assert main(['import', str(folder), '--rate', f'{RATE:g}', '-o', str(bag)]) == 0
    capsys.readouterr()
    size = f'{2.0 * BALL.radius * SCALE:g}'
    assert main(['measure', str(bag), '--diameter-px', size, '-o', str(tmp_path / 'out')]) == 0
    offline = capsys.readouterr().out
    live = [record.text for record in followed if isinstance(record, Notice)]
    assert 'contacts alone: the trays file does not tell the container' in live[0]
    for words in ('free beads accelerate', 'beads: no restitution', 'floor: 0.', 'rebounds from'):
        (of_measure,) = (line for line in offline.splitlines() if words in line)
        last = [line for line in live if words in line][-1].removeprefix('tray 1: ')
        assert re.sub(r'[\d.]+', '', last) == re.sub(r'[\d.]+', '', of_measure)


def test_tracks_are_emitted_when_they_are_wanted(pictures):
    stages = OpenTrayStages(ball_settings(), load_trays(ball_settings().trays_file)[1])
    stages.emit(Wanted(tracks=True))
    records = [
        record
        for k, picture in enumerate(pictures[:9])
        for record in stages.push(
            TrayImage(
                stamp_ns=1 + round(k * 1e9 / RATE),
                tray=1,
                gray=picture[:, :, 0].copy(),
                color=picture,
            )
        )
    ]
    assert sum(isinstance(record, Tracks) for record in records) > 5


def test_only_what_cannot_be_compared_with_a_library_is_left_to_contacts():
    flown = PipelineSettings()
    assert reason_for_contacts(flown, load_trays()[1]) == ''
    assert isinstance(measurement_of(flown, load_trays()[1]), TrayMeasurement)
    assert isinstance(estimator_of(flown, load_trays()[1]), RestitutionEstimator)
    steel = settings_of(STEEL)
    tray = load_trays(STEEL)[1]
    assert 'nanorocks library --tray 1' in reason_for_contacts(steel, tray)
    assert isinstance(estimator_of(steel, tray), ContactEstimator)
    flat = STEEL.replace(', 4]', ']')
    reason = reason_for_contacts(settings_of(flat), load_trays(flat)[1])
    assert 'height' in reason
    paper = with_values(steel, {'cooling.relation': 'paper'}, 'test')
    assert reason_for_contacts(paper, tray) == ''


def test_a_library_that_is_told_must_be_one(tmp_path):
    steel = with_values(
        settings_of(STEEL), {'cooling.decay_library': str(tmp_path / 'no.npz')}, 'test'
    )
    with pytest.raises(ConfigurationError, match=r'no\.npz'):
        Pipeline(steel, 'test', contacts_suffice=True)


def test_an_analysis_refuses_what_the_pipeline_measures_by_contacts():
    settings = ball_settings()
    with pytest.raises(ConfigurationError, match='does not tell'):
        Pipeline(settings, 'test')
    stages = Pipeline(settings, 'test', contacts_suffice=True)
    assert isinstance(stages.trays[1], OpenTrayStages)
    assert not stages.cooling_trays
    assert isinstance(TrayStages.of(PipelineSettings(), load_trays()[1]), TrayStages)
