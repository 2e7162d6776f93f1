"""A change of settings restarts the stages that read them, and no others."""

from __future__ import annotations

import itertools
from dataclasses import fields
from pathlib import Path

import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.changed_settings import Part, changed_parts
from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import CorEstimate, CorStatus, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'
BEFORE = PipelineSettings()


@pytest.mark.parametrize(
    ('name', 'value', 'parts'),
    [
        ('prior.scale_error', 0.02, Part.RESTITUTION),
        ('cooling.duration', 10.0, Part.RESTITUTION),
        ('cooling.rebounds', False, Part.RESTITUTION | Part.MEASUREMENT),
        ('prior.drag', 0.5, Part.RESTITUTION | Part.MEASUREMENT),
        ('clusters.level', 0.6, Part.CLUSTERS),
        ('sticking.measure', 'total', Part.CLUSTERS | Part.RESTITUTION),
        ('bodies.delay', 2.0, Part.MEASUREMENT),
        ('speed.interval', 0.2, Part.IMAGES),
        ('tracking.window', 0.5, Part.IMAGES),
        ('preprocess.stabilise', False, Part.IMAGES),
    ],
)
def test_a_change_concerns_the_parts_that_read_it(name, value, parts):
    after = with_values(BEFORE, {name: value}, 'test')
    assert after != BEFORE
    assert changed_parts(BEFORE, after) == parts


def test_equal_settings_concern_nothing():
    assert changed_parts(BEFORE, PipelineSettings()) == Part(0)


class Reads:
    """Settings that note the names that are read of them."""

    def __init__(self, settings, prefix, names):
        self._settings, self._prefix, self._names = settings, prefix, names

    def __getattr__(self, name):
        value = getattr(self._settings, name)
        path = self._prefix + name
        if hasattr(value, '__dataclass_fields__'):
            return Reads(value, path + '.', self._names)
        self._names.add(path)
        return value


def test_the_measurement_reads_no_setting_that_is_said_to_concern_others_alone():
    names = set()
    stage = TrayMeasurement(Reads(BEFORE, '', names), load_trays()[1])
    preprocessor = Pipeline(BEFORE, 'sample').preprocessor
    for frame in itertools.islice(BagFrames(SAMPLE).frames(), 90):
        for image in preprocessor.push(frame):
            if isinstance(image, TrayImage):
                stage.push(image)
    groups = {name.split('.')[0] for name in names}
    assert {'speed', 'tracking', 'preprocess'} <= groups <= {item.name for item in fields(BEFORE)}
    for name in names:
        group, _, own = name.partition('.')
        value = getattr(getattr(BEFORE, group), own) if own else None
        if own and isinstance(value, bool | float):
            other = (not value) if isinstance(value, bool) else 1.1 * value + 0.01
            after = with_values(BEFORE, {name: other}, 'test')
            assert changed_parts(BEFORE, after) & (Part.IMAGES | Part.MEASUREMENT), name


def last_restitution(settings, change_after=None, later=None):
    """The last estimate of the sample, with other settings from some frame on."""
    pipeline, estimates = Pipeline(settings, 'sample'), []
    for number, frame in enumerate(BagFrames(SAMPLE).frames()):
        if number == change_after:
            pipeline.adopt(later, changed_parts(settings, later))
        estimates += pipeline.push(frame)
    estimates += pipeline.flush()
    return [record for record in estimates if isinstance(record, CorEstimate)][-1]


def test_a_prior_changed_in_a_cycle_gives_what_it_gives_from_the_start():
    # Each live estimate takes as long as the last one.
    before = with_values(BEFORE, {'cooling.update_interval': 20.0}, 'test')
    after = with_values(before, {'prior.min_wall_restitution': 0.96}, 'test')
    changed = last_restitution(before, 400, after)
    assert changed.status is CorStatus.FINAL
    assert changed == last_restitution(after)
    assert changed.wall_restitution != last_restitution(before).wall_restitution
