"""Who is let in."""

from __future__ import annotations

import pytest

from nanorocks_ros.dashboard.access import Access
from nanorocks_ros.errors import ConfigurationError, DashboardError

TOKEN = 'correct-horse-battery'


def test_this_machine_alone_needs_no_token_and_others_get_one_made_up():
    assert Access('127.0.0.1', '').token == ''
    assert Access('localhost', '').token == ''
    made_up = {Access('0.0.0.0', '').token for _ in range(20)}
    assert len(made_up) == 20
    assert min(map(len, made_up)) >= 20


def test_a_token_that_is_chosen_is_asked_for_everywhere():
    access = Access('127.0.0.1', TOKEN)
    assert not access.is_known({}, '')
    assert not access.is_known({'Authorization': f'Bearer {TOKEN}x'}, '')
    assert access.is_known({'Authorization': f'Bearer {TOKEN}'}, '')
    assert access.is_known({}, access.cookie)
    assert not access.is_known({}, TOKEN)


def test_the_cookie_is_not_the_token_and_outlives_a_restart():
    assert TOKEN not in Access('127.0.0.1', TOKEN).cookie
    assert Access('127.0.0.1', TOKEN).cookie == Access('0.0.0.0', TOKEN).cookie


@pytest.mark.parametrize('token', ['short', 'twelve and a space', 'zwölf-und-mehr'])
def test_a_token_that_can_be_guessed_or_not_be_sent_is_refused(token):
    with pytest.raises(ConfigurationError, match='choose 12 or more'):
        Access('127.0.0.1', token)


def test_a_host_without_an_address_is_named():
    with pytest.raises(DashboardError, match=r"host 'no such host': has no address here"):
        Access('no such host', '')


@pytest.mark.parametrize(
    ('host', 'ours'),
    [
        ('127.0.0.1:8321', True),
        ('localhost', True),
        ('LOCALHOST:1', True),
        ('[::1]:8321', True),
        ('127.8.8.8:8321', True),
        ('evil.example:8321', False),
        ('127.0.0.1.evil.example', False),
        ('evil.example@127.0.0.1', True),
        ('', False),
        ('[::1', False),
    ],
)
def test_a_name_that_points_here_is_not_ours(host, ours):
    assert Access('127.0.0.1', '').host_is_ours(host) is ours


def test_where_a_token_is_asked_for_every_name_of_the_machine_does():
    assert Access('0.0.0.0', TOKEN).host_is_ours('lab.example:8321')


@pytest.mark.parametrize(
    ('origin', 'ours'),
    [
        (None, True),
        ('http://127.0.0.1:8321', True),
        ('http://127.0.0.1:9999', False),
        ('http://evil.example', False),
        ('null', False),
        ('http://[', False),
    ],
)
def test_only_our_own_page_may_ask(origin, ours):
    assert Access('127.0.0.1', '').origin_is_ours(origin, '127.0.0.1:8321') is ours


def test_after_many_wrong_tokens_even_the_right_one_has_to_wait():
    access = Access('0.0.0.0', TOKEN)
    for k in range(30):
        assert not access.is_known({'Authorization': f'Bearer guess-number-{k}'}, '', 'outside')
    assert access.is_locked_out('outside')
    assert not access.is_known({'Authorization': f'Bearer {TOKEN}'}, '', 'outside')
    # Nobody else is locked out by that.
    assert access.is_known({'Authorization': f'Bearer {TOKEN}'}, '', 'inside')
    assert access.is_known({}, access.cookie)
