"""How the node that serves the page is called."""

from __future__ import annotations

import pytest

from nanorocks_ros.dashboard.page_process import full_namespace
from nanorocks_ros.errors import ConfigurationError


@pytest.mark.parametrize(
    ('given', 'full'),
    [('', ''), ('/', '/'), ('lab', '/lab'), ('/lab', '/lab'), ('lab/a_1/', '/lab/a_1')],
)
def test_a_namespace_may_be_given_without_its_slash(given, full):
    assert full_namespace(given) == full


@pytest.mark.parametrize('given', ['//', 'no name', '1a', 'a//b', 'a__b', 'ä', 'a' * 245])
def test_what_cannot_be_a_namespace_is_refused_in_one_line(given):
    with pytest.raises(ConfigurationError) as refused:
        full_namespace(given)
    assert str(refused.value).startswith(f'--namespace: {given!r} is no namespace of ROS; give')
