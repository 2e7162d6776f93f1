"""JSON has no NaN and no infinity: both become null."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.json_values import (
    finite_or_none,
    json_values,
    parse_object,
    read_object,
)


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf, np.float32('nan')])
def test_a_value_that_is_not_finite_becomes_none(value):
    assert finite_or_none(value) is None
    assert json_values(value) is None


@pytest.mark.parametrize('value', [0.1, -0.0, np.float64(0.1), 5e-324])
def test_a_finite_value_stays(value):
    assert finite_or_none(value) == value
    assert type(json_values(value)) is float
    assert json_values(value) == value


def test_nested_values_can_be_written_as_strict_json():
    values = {
        'speeds': np.array([[1.0, math.nan], [math.inf, 2.5]]),
        'interval': (0.5, math.nan),
        'counts': np.arange(3),
        'cycle': {'name': 'NaN', 'beads': 4, 'complete': True, 'error': math.nan, 'size': None},
    }
    assert json.loads(json.dumps(json_values(values), allow_nan=False)) == {
        'speeds': [[1.0, None], [None, 2.5]],
        'interval': [0.5, None],
        'counts': [0, 1, 2],
        'cycle': {'name': 'NaN', 'beads': 4, 'complete': True, 'error': None, 'size': None},
    }


@pytest.mark.parametrize('text', ['', '[1]', '3', '[' * 100_000, '{"a":' * 100_000, '9' * 5000])
def test_anything_but_an_object_is_a_value_error(tmp_path, text):
    with pytest.raises(ValueError, match=r'.*'):
        parse_object(text)
    (tmp_path / 'x.json').write_text(text)
    with pytest.raises(ValueError, match=r'.*'):
        read_object(tmp_path / 'x.json')


def test_an_object_is_read_within_the_limit(tmp_path, monkeypatch):
    (tmp_path / 'x.json').write_text('{"a": [1, null]}')
    assert read_object(tmp_path / 'x.json') == {'a': [1, None]}
    monkeypatch.setenv('NANOROCKS_MAX_TEXT_BYTES', '5')
    with pytest.raises(RecordingError, match='NANOROCKS_MAX_TEXT_BYTES'):
        read_object(tmp_path / 'x.json')
