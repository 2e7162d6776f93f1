"""The priors in words."""

from __future__ import annotations

from nanorocks_ros.settings import PriorSettings, priors_in_words


def test_the_ends_and_errors_that_are_set_are_told():
    prior = PriorSettings(
        min_wall_restitution=0.7, max_wall_restitution=0.9, drag=0.02, drag_error=0.1,
        friction=0.05, friction_error=0.01, scale_error=0.003, height_error=0.2e-3,
        initial_speed=0.05, initial_speed_spread=1.1,
    )  # fmt: skip
    text = priors_in_words(prior)
    for part in (
        'walls 0.7 to 0.9;',
        'scale 0.003,',
        'height 0.2 mm;',
        'drag 0.02 +- 0.1 /s;',
        'friction 0.05, as likely as not within 0.01;',
        'mean speed at the start 50 mm/s within a factor of 3',
    ):
        assert part in text


def test_what_is_known_is_told_without_an_error():
    prior = PriorSettings(
        min_wall_restitution=0.97, max_wall_restitution=0.97, drag_error=0.0, friction_error=0.0
    )
    text = priors_in_words(prior)
    assert 'walls 0.97, known;' in text
    assert 'drag 0 /s, known; friction 0, known' in text
    assert '+-' not in text
