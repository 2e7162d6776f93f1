"""Message definitions of hostile bags end in one line."""

from __future__ import annotations

import pytest
from rosbags.typesys import TypesysError

from nanorocks_ros.recordings.messages.message_types import register_type, standard_types

SEPARATOR = '\n' + '=' * 80 + '\nMSG: '


def chain(levels, width=1):
    """Types T0 to Tn, each with fields of the next."""
    parts = []
    for level in range(levels):
        fields = '\n'.join(f'my_msgs/T{level + 1} f{k}' for k in range(width))
        parts.append(fields if level == 0 else f'my_msgs/T{level}\n{fields}')
    parts.append(f'my_msgs/T{levels}\nfloat64 x')
    return SEPARATOR.join(parts)


@pytest.mark.parametrize(('text', 'reason'), [
    (chain(40), 'NANOROCKS_MAX_TYPE_DEPTH raises it'),
    (chain(10, width=6), 'NANOROCKS_MAX_TYPE_FIELDS raises it'),
    ('float64 x\n' * 30_000, 'NANOROCKS_MAX_TYPE_BYTES raises it'),
    (f'my_msgs/T1 a{SEPARATOR}my_msgs/T1\nmy_msgs/T0 b{SEPARATOR}my_msgs/T0\nmy_msgs/T1 c',
     'holds itself'),
])  # fmt: skip
def test_definitions_beyond_the_limits_are_refused(text, reason):
    with pytest.raises(TypesysError, match=reason):
        register_type(standard_types(), 'my_msgs/msg/T0', text, 'ros2msg')


def test_usual_definitions_are_registered(monkeypatch):
    store = standard_types()
    register_type(store, 'my_msgs/msg/T0', chain(3, width=2), 'ros2msg')
    assert 'my_msgs/msg/T3' in store.fielddefs
    monkeypatch.setenv('NANOROCKS_MAX_TYPE_DEPTH', '50')
    register_type(store, 'deep_msgs/msg/T0', chain(40).replace('my_', 'deep_'), 'ros2msg')
