"""Settings: ranges, coercion, and errors that list everything wrong at once."""

from __future__ import annotations

import math

import pytest

from nanorocks_ros import settings as st
from nanorocks_ros.errors import ConfigurationError

ALL = (
    st.PipelineSettings(),
    st.SimulationSettings(),
    st.CameraSettings(),
    st.PacingSettings(),
    st.BagSettings(),
    st.SourceSettings(),
)


@pytest.mark.parametrize('settings', ALL, ids=lambda settings: type(settings).__name__)
def test_every_default_lies_in_its_own_range_and_is_documented(settings):
    for row in st.rows(settings):
        assert st.problem(row, row.default) is None
        assert row.doc


@pytest.mark.parametrize('settings', ALL, ids=lambda settings: type(settings).__name__)
def test_nan_and_negative_numbers_are_refused_for_every_number(settings):
    numbers = [
        row
        for row in st.rows(settings)
        if isinstance(row.default, int | float) and not isinstance(row.default, bool)
    ]
    for row in numbers:
        # A tangential restitution is -1 for a smooth bead, and a difference may have either sign.
        signed = 'tangential' in row.name or 'difference' in row.name
        below = -1.5 if signed else -1.0
        for value in (math.nan, math.inf, below):
            with pytest.raises(ConfigurationError, match=row.name):
                st.with_values(settings, {row.name: value}, 'test')


def test_a_nested_value_is_replaced_and_nothing_else():
    changed = st.with_values(st.PipelineSettings(), {'speed.interval': 0.2}, 'test')
    assert changed.speed.interval == 0.2
    assert changed.cooling == st.CoolingSettings()


def test_a_whole_number_is_accepted_for_a_real_one_and_a_list_for_a_tuple():
    values = {'preprocess.pixels_per_metre': 13500, 'trays': [1.0, 3.0]}
    changed = st.with_values(st.PipelineSettings(), values, 'test')
    assert isinstance(changed.preprocess.pixels_per_metre, float)
    assert changed.trays == (1, 3)
    assert all(isinstance(tray, int) for tray in changed.trays)


def test_every_problem_is_listed_at_once():
    values = {'speed.method': 'guess', 'cooling.probability': 2.0, 'sped.interval': 1.0}
    with pytest.raises(ConfigurationError) as caught:
        st.with_values(st.PipelineSettings(), values, 'mine.yaml')
    text = str(caught.value)
    assert text.startswith('mine.yaml: ')
    assert "'guess' is none of auto, tracking, structure_function, binarised_area" in text
    assert '2.0 is outside [0.5, 0.999]' in text
    assert "no setting 'sped.interval'" in text


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('trays', 'one'),
        ('trays', [0]),
        ('trays', [math.nan]),
        ('trays_file', 3),
        ('speed.max_lag_frames', 2.5),
        ('speed.interval', True),
        ('speed.interval', 'fast'),
    ],
)
def test_a_value_of_the_wrong_kind_is_refused(name, value):
    with pytest.raises(ConfigurationError, match=name):
        st.with_values(st.PipelineSettings(), {name: value}, 'test')


def test_a_flag_is_true_or_false():
    assert st.with_values(st.BagSettings(), {'loop': True}, 'test').loop
    with pytest.raises(ConfigurationError, match='neither true nor false'):
        st.with_values(st.BagSettings(), {'loop': 1}, 'test')


def deprecated_rows():
    return [row for row in st.rows(st.PipelineSettings()) if row.deprecated]


@pytest.mark.parametrize('row', deprecated_rows(), ids=lambda row: row.deprecated)
def test_the_old_name_of_a_setting_sets_it_with_a_warning_that_names_the_new_one(row):
    value = False if isinstance(row.default, bool) else type(row.default)(row.bounds.high)
    with pytest.warns(FutureWarning, match=f"'{row.deprecated}' is now called '{row.name}'"):
        changed = st.with_values(st.PipelineSettings(), {row.deprecated: value}, 'mine.yaml')
    assert changed == st.with_values(st.PipelineSettings(), {row.name: value}, 'mine.yaml')


def test_no_old_name_is_the_name_of_another_setting():
    names = [row.name for row in st.rows(st.PipelineSettings())]
    names += [row.deprecated for row in deprecated_rows()]
    assert len(names) == len(set(names))


def test_a_setting_under_its_old_and_its_new_name_is_refused():
    values = {'tracking.fastest': 0.1, 'tracking.max_speed': 0.2}
    with pytest.raises(ConfigurationError) as caught:
        st.with_values(st.PipelineSettings(), values, 'mine.yaml')
    assert str(caught.value) == (
        "mine.yaml: 'tracking.fastest' and 'tracking.max_speed' are the same setting; "
        "give 'tracking.max_speed' alone"
    )


def test_a_wrong_value_under_an_old_name_is_refused_under_the_new_one():
    with (
        pytest.warns(FutureWarning),
        pytest.raises(ConfigurationError, match=r'tracking.max_speed: -1.0 is outside'),
    ):
        st.with_values(st.PipelineSettings(), {'tracking.fastest': -1.0}, 'test')


def test_names_with_a_prefix_are_renamed_with_it():
    values = {'stages.tracking.fastest': 0.1, 'tracking.fastest': 0.2}
    renamed, messages = st.with_current_names(st.PipelineSettings(), values, 'node', 'stages.')
    assert renamed == {'stages.tracking.max_speed': 0.1, 'tracking.fastest': 0.2}
    assert len(messages) == 1
