"""The curves of the page in a real browser: the truth beside what is measured, and their axes."""

from __future__ import annotations

from dataclasses import replace

from nanorocks_ros.records import GroundTruth


def text_is(page, selector, text):
    page.wait_for_function(
        '([selector, text]) => document.querySelector(selector)?.innerText.includes(text)',
        arg=[selector, text],
    )


def test_what_is_measured_from_the_middle_of_a_run_is_shown_beside_its_truth(look, serve, results):
    server = serve()
    page = look(server.url)
    for speed in results.speeds[::10]:
        server.take(truth_at(speed.stamp_ns))
    text_is(page, '#state', 'nothing measured yet')
    joined = [replace(speed, cycle=0, cycle_start_ns=None) for speed in results.speeds[20:60]]
    for speed in joined:
        server.take(truth_at(speed.stamp_ns))
        server.take(speed)
    text_is(page, '#state', 'no shaking event yet')
    text_is(page, '#speed', f'{1e3 * joined[-1].mean_projected_speed.value:.2f} mm/s')
    page.wait_for_selector('#speed-chart canvas')
    assert page.locator('#speed-chart .only-truth').is_visible()


def truth_at(stamp_ns):
    return GroundTruth(
        stamp_ns=stamp_ns,
        tray=1,
        cycle=1,
        mean_projected_speed=0.003,
        mean_speed=0.004,
        bodies=15,
        restitution=0.9,
        wall_restitution=0.8,
        sticking_speed=0.0,
    )


def test_a_logarithmic_axis_has_round_numbers(look, serve, results):
    server = serve()
    for speed in results.speeds:
        server.take(speed)
    page = look(server.url)
    page.wait_for_selector('#speed-chart canvas')
    labels = page.evaluate(
        """async () => {
          const { roundNumbers } = await import('./words.js');
          return [[1.659, 9.3], [2.1, 3.9], [0.4, 30], [0.012, 800]].map(
            ([low, high]) => roundNumbers(low, high));
        }"""
    )
    assert labels == [
        [2, 3, 4, 5, 7],
        [2.5, 3, 3.5],
        [0.5, 1, 2, 5, 10, 20],
        [0.1, 1, 10, 100],
    ]
    page.locator('#log').click()
    page.wait_for_selector('#speed-chart canvas')
