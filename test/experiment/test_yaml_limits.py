"""YAML that claims too much is refused before it is built, in one line."""

from __future__ import annotations

import pytest
import yaml

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.yaml_limits import load_yaml


def bomb(levels, width=10):
    """Each level is a list of aliases of the one before."""
    lines = ['a0: &a0 [x]']
    lines += [f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * width)}]' for k in range(1, levels)]
    return '\n'.join(lines)


@pytest.mark.parametrize(('text', 'limit'), [
    (bomb(12), 'YAML_NODES'),
    ('[' * 100_000, 'YAML_DEPTH'),
    ('{a: ' * 1000, 'YAML_DEPTH'),
    ('a: ' + '9' * 5000, 'DIGITS'),
    ('a: 0x' + 'f' * 5000, 'DIGITS'),
    ('a: ' + '1:' * 3000 + '1', 'DIGITS'),
    ('a: "' + 'x' * (1 << 24) + '"', 'YAML_BYTES'),
])  # fmt: skip
def test_what_exceeds_a_limit_is_refused_with_its_setting(text, limit):
    with pytest.raises(ConfigurationError, match=f'set NANOROCKS_MAX_{limit} to more') as refusal:
        load_yaml('x.yaml', text)
    assert '\n' not in str(refusal.value)
    assert len(str(refusal.value)) < 300


def test_a_list_that_holds_itself_is_refused():
    with pytest.raises(ConfigurationError, match=r"x\.yaml:1: the alias 'a' stands inside"):
        load_yaml('x.yaml', 'k: &a [1, *a]')


def test_the_setting_raises_the_limit(monkeypatch):
    text = bomb(4)
    monkeypatch.setenv('NANOROCKS_MAX_YAML_NODES', '1000')
    with pytest.raises(ConfigurationError):
        load_yaml('x.yaml', text)
    monkeypatch.setenv('NANOROCKS_MAX_YAML_NODES', '10000')
    assert load_yaml('x.yaml', text) == yaml.safe_load(text)


@pytest.mark.parametrize('text', ['', 'a: 1', 'a: &x [1, 2]\nb: *x', '- {c: .nan}\n- "9"'])
def test_usual_yaml_is_read_as_it_stands(text):
    assert repr(load_yaml('x.yaml', text)) == repr(yaml.safe_load(text))


@pytest.mark.parametrize('text', ['[', 'a: b: c', '\0', 'a: 2001-99-99', '? [1]\n: 2'])
def test_what_is_no_yaml_is_one_line(text):
    with pytest.raises(ConfigurationError, match=r'^x.yaml: not YAML: .*; correct it$'):
        load_yaml('x.yaml', text)
