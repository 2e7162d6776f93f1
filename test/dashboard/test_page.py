"""The page in a real browser: what it says, to whom, and in which light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.dashboard.tray_pictures import encoded
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import CorStatus, Interval, Measured, MeasuredInterval, Quality
from nanorocks_ros.settings import PriorSettings, priors_in_words

WIDE = {'width': 1440, 'height': 900}
TABLET = {'width': 768, 'height': 1024}
PHONE = {'width': 390, 'height': 844}
NARROW = {'width': 320, 'height': 568}
TOKEN = 'correct-horse-battery'

# Every text that is seen, with its colour and what lies behind it, as a contrast (WCAG 2).
CONTRASTS = """
() => {
  const light = (colour) => {
    const [r, g, b] = colour.match(/[\\d.]+/g).slice(0, 3).map((one) => {
      const c = one / 255;
      return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    for (let one = element; one; one = one.parentElement) {
      const colour = getComputedStyle(one).backgroundColor;
      if (!/rgba\\(.*, 0\\)|transparent/.test(colour)) return colour;
    }
    return 'rgb(255, 255, 255)';
  };
  const found = {};
  for (const element of document.body.querySelectorAll('*')) {
    const own = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !element.checkVisibility() || element.matches('.unseen, .skip')) continue;
    const [a, b] = [light(getComputedStyle(element).color), light(behind(element))];
    found[element.textContent.trim().slice(0, 30)] =
      (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  }
  return found;
}
"""


# Cards whose text goes beyond their border.
OVERFLOWING = """
() => [...document.querySelectorAll('.card')]
  .filter((card) => card.scrollWidth > card.clientWidth)
  .map((card) => card.textContent)
"""


def text_is(page, selector, text):
    page.wait_for_function(
        '([selector, text]) => document.querySelector(selector)?.innerText.includes(text)',
        arg=[selector, text],
    )


def shown(cor):
    """The estimate as the page writes it."""
    return (
        f'{cor.restitution.value:.3f} [{cor.restitution.lower:.3f}, {cor.restitution.upper:.3f}]',
        f'{cor.wall_restitution.value:.3f}',
        f'[{cor.wall_restitution.lower:.3f}, {cor.wall_restitution.upper:.3f}]',
    )


@pytest.fixture
def full(serve, results):
    """A server that was told everything about three trays."""
    server = serve()
    for number in (1, 2, 5):
        for record in results.all:
            server.take(replace(record, tray=number))
    server.diagnose([('/nanorocks/pipeline', 0, 'working', [('rate [1/s]', '30.00')])])
    return server


def test_numbers_are_those_of_the_estimate_with_units(look, full, results):
    page = look(full.url)
    cor, speed, cluster = results.cors[-1], results.speeds[-1], results.clusters[-1]
    value, wall, wall_interval = shown(cor)
    text_is(page, '#cor', value)
    text_is(page, '#walls', wall)
    text_is(page, '#walls', wall_interval)
    text_is(page, '#speed', f'{1e3 * speed.mean_projected_speed.value:.2f} mm/s')
    text_is(page, '#haff', f'{cor.haff_time.value:.2f} s')
    text_is(page, '#cluster', f'{cluster.combined_size.value:.2f}')
    text_is(page, '#cluster', f'±\u00a0{cluster.combined_size.error:.2f}')
    text_is(page, '#drag', f'{cor.drag.value:.4f} 1/s'.replace('-', '−'))
    text_is(page, '#drag', f'±\u00a0{cor.drag.error:.4f}')
    text_is(page, '#acceleration', f'< {1e3 * cor.acceleration.upper:.3f} mm/s²')
    text_is(page, '#about', '15 acrylic 2 mm')
    text_is(page, '#health', '1 node, well')
    for chart in ('speed', 'cor', 'cluster'):
        assert page.locator(f'#{chart}-chart canvas').count() == 1
    label = page.locator('#speed-chart .plot').get_attribute('aria-label')
    assert f'{1e3 * speed.mean_projected_speed.value:.2f} mm/s now' in label
    label = page.locator('#cor-chart .plot').get_attribute('aria-label')
    assert f'{cor.restitution.value:.3f}' in label


def test_the_estimate_tightens_while_one_looks(look, serve, results):
    server = serve()
    page = look(server.url)
    text_is(page, '#nothing', 'No tray yet')
    server.expect(1)
    text_is(page, '#state', 'nothing measured yet')
    server.take(results.speeds[0])
    text_is(page, '#cor', 'no shaking event yet')
    for record in results.speeds:
        server.take(record)
    text_is(page, '#cor', 'no estimate yet')
    estimates = [cor for cor in results.cors if cor.status.name == 'COOLING']
    for record in (estimates[0], estimates[len(estimates) // 2], estimates[-1]):
        server.take(record)
        text_is(page, '#cor', shown(record)[0])
        text_is(page, '#cor', 'provisional')
    server.take(results.cors[-1])
    text_is(page, '#cor', 'final for this cycle')
    assert shown(results.cors[-1])[0] in page.locator('#finals').inner_text()


def test_what_is_wrong_or_not_told_is_said_in_words(look, serve, results):
    server = serve()
    for number in (1, 2):
        for record in (*results.speeds, results.cors[-1]):
            server.take(replace(record, tray=number))
    page = look(server.url)
    text_is(page, '#cor', shown(results.cors[-1])[0])
    server.take(replace(results.cors[-1], quality=Quality.INCONSISTENT | Quality.LOW_CONTRAST))
    text_is(page, '#state', 'over, low contrast, inconsistent')
    text_is(page, '.card', 'low contrast')
    assert 'contradict each other' in page.locator('#state').get_attribute('title')
    server.take(replace(results.cors[-1], status=CorStatus.UNDETERMINED))
    text_is(page, '#cor', 'the decay tells too little yet')
    server.diagnose([('/n', 0, 'working', [('frames waiting for the trays', '29')])])
    text_is(page, '#health', '1 behind')
    text_is(page, '.node', '29 frames waiting')
    published = [('received', '0'), ('published', '31'), ('rate [1/s]', '0.00')]
    server.diagnose([('/n', 0, 'working', published)])
    text_is(page, '.node', '31 published')
    server.diagnose([('/n', 0, 'working', [('frames waiting for the trays', '1')])])
    text_is(page, '.node', '1 frame waiting')
    # Nothing of a node that is not heard any more is told as if it were so now.
    text_is(page, '.node', 'silent for 4 s')
    text_is(page, '.node', 'before: 1 frame waiting')
    assert 'working' not in page.locator('.node summary').inner_text()


def test_an_acceleration_that_matters_is_told_by_its_size(look, serve, results):
    server = serve()
    server.take(results.speeds[-1])
    accelerated = replace(
        results.cors[-1],
        quality=Quality.ACCELERATED,
        acceleration=MeasuredInterval(2e-3, 1e-4, 1.8e-3, 2.2e-3),
        drag=Measured(0.0312, 0.0121),
        restitution_exponent=Interval(0.55, 0.41, 0.7),
        impact_speed=1.42e-3,
        wall_restitution_exponent=Interval(-0.02, -0.2, 0.16),
    )
    server.take(accelerated)
    page = look(server.url)
    text_is(page, '#acceleration', '2.0 mm/s²')
    text_is(page, '#acceleration', '[1.8, 2.2]')
    text_is(page, '#drag', '0.031 1/s')
    text_is(page, '#exponent', '[0.41, 0.70] at 1.42 mm/s, walls −0.02 [−0.20, 0.16]')
    server.take(replace(results.cors[-1], drag=Measured(), acceleration=MeasuredInterval()))
    text_is(page, '#acceleration', 'not known yet')
    text_is(page, '#drag', 'not known yet')


def test_the_priors_are_those_of_the_node_that_estimates_this_tray(look, full):
    page = look(full.url)
    text_is(page, '#cor', 'final')
    assert not page.locator('#priors').is_visible()
    of_graph, of_other = (
        priors_in_words(replace(PriorSettings(), friction=friction)) for friction in (0.0, 0.05)
    )
    full.diagnose(
        (name, 0, 'working', [(f'tray {tray} COR', '0.9'), ('priors', priors)])
        for name, tray, priors in (
            ('/other/pipeline', 1, of_other),
            ('/nanorocks/haff_fitter', 1, of_graph),
            ('/nanorocks/other', 2, of_other),
        )
    )
    text_is(page, '#priors', of_graph.replace('+-', '±'))
    page.keyboard.press('2')
    text_is(page, '#priors', of_other.replace('+-', '±'))
    page.keyboard.press('5')
    text_is(page, '#title', 'Tray 5')
    page.wait_for_selector('#priors', state='hidden')


def test_whoever_opens_the_page_late_sees_the_same(look, full):
    pages = [look(full.url), look(full.url)]
    for page in pages:
        text_is(page, '#cor', 'final')
    first, second = [page.locator('#numbers').inner_text() for page in pages]
    assert first == second


def test_trays_are_chosen_by_keys_by_clicks_and_by_the_address(look, full):
    page = look(f'{full.url}#tray-5')
    text_is(page, '#title', 'Tray 5')
    page.keyboard.press('ArrowRight')
    text_is(page, '#title', 'Tray 1')
    page.keyboard.press('ArrowLeft')
    text_is(page, '#title', 'Tray 5')
    page.keyboard.press('2')
    text_is(page, '#title', 'Tray 2')
    page.keyboard.press('7')
    assert page.locator('#title').inner_text() == 'Tray 2'
    page.locator('.card', has_text='Tray 5').click()
    text_is(page, '#title', 'Tray 5')
    assert page.url.endswith('#tray-5')
    current = page.locator('.card[aria-current=true]')
    assert current.count() == 1
    assert 'Tray 5, ' in current.get_attribute('aria-label')


def test_everything_is_reached_by_the_tabulator_and_focus_is_seen(look, full):
    page = look(full.url)
    text_is(page, '#cor', 'final')
    reached = []
    for _ in range(36):
        page.keyboard.press('Tab')
        reached.append(
            page.evaluate(
                """() => {
                  const one = document.activeElement;
                  const outline = getComputedStyle(one);
                  const name = one.id || one.className || one.tagName.toLowerCase();
                  const width = outline.outlineStyle === 'none' ? 0 : outline.outlineWidth;
                  return [name, parseFloat(width) > 1];
                }"""
            )
        )
    names = [name for name, _ in reached]
    # After the last element the browser itself has its turn.
    assert all(visible for name, visible in reached if name != 'body')
    expected = 'compare freeze health card tracks motion log in csv png plot summary'
    for name in expected.split():
        assert name in names
    page.locator('#log').focus()
    page.keyboard.press('Enter')
    assert page.locator('#log').get_attribute('aria-pressed') == 'true'


def test_changes_are_said_to_those_who_listen(look, full, results):
    page = look(full.url)
    text_is(page, '#cor', 'final')
    announcement = page.locator('#said')
    assert announcement.get_attribute('aria-live') == 'polite'
    assert f'restitution {results.cors[-1].restitution.value:.3f}' in announcement.text_content()
    assert page.locator('#link').get_attribute('role') == 'status'


@pytest.mark.parametrize(
    'size', [WIDE, TABLET, PHONE, NARROW], ids=['wide', 'tablet', 'phone', 'narrow']
)
@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_text_is_readable_and_nothing_sticks_out(look, full, scheme, size):
    values = [('tray 1 COR', '0.9'), ('priors', priors_in_words(PriorSettings()))]
    full.diagnose(
        [
            ('/a', 1, 'a warning ' * 9, []),
            ('/b' * 30, 2, 'x' * 200, [('k' * 50, 'v' * 90)]),
            ('/nanorocks/pipeline', 0, 'working', values),
        ]
    )
    page = look(full.url, color_scheme=scheme, viewport=size)
    text_is(page, '#cor', 'final')
    text_is(page, '#health', '1 error')
    text_is(page, '#priors', 'beads 0 to 1')
    page.locator('summary').first.click()
    contrasts = page.evaluate(CONTRASTS)
    assert len(contrasts) > 30
    assert {text: ratio for text, ratio in contrasts.items() if ratio < 4.5} == {}
    wider = page.evaluate('document.documentElement.scrollWidth - innerWidth')
    assert wider <= 0
    assert page.evaluate(OVERFLOWING) == []


@pytest.mark.parametrize('size', [WIDE, TABLET], ids=['wide', 'tablet'])
def test_the_captions_of_plots_side_by_side_have_one_line(look, full, size):
    page = look(full.url, viewport=size)
    text_is(page, '#cor', 'final')
    lines = page.locator('#cor-chart figcaption, #cluster-chart figcaption')
    heights = [lines.nth(number).bounding_box()['height'] for number in range(2)]
    assert heights[0] == heights[1] < 40.0


def test_texts_from_outside_stay_texts(look, serve, results):
    evil = '<img src=x onerror="alert(1)"><script>alert(2)</script>'
    trays = load_trays()
    beads = trays[1].species[0]
    species = replace(beads, properties=replace(beads.properties, name=evil))
    server = serve(namespace=f'/{evil}', trays={1: replace(trays[1], species=(species,))})
    for record in results.all:
        server.take(record)
    server.diagnose([(evil, 2, f'{evil}\u202eevil', [(evil, evil), ('rate [1/s]', evil)])])
    page = look(server.url)
    text_is(page, '#about', evil)
    text_is(page, '#namespace', evil)
    page.locator('summary').click()
    for part in ('.name', '.text', '.rates', 'dt', 'dd'):
        text_is(page, f'.node {part}', '<img src=x')
    assert page.locator('img, iframe, body script').count() == 0
    assert '\u202e' not in page.locator('body').inner_text()


def test_tracks_and_motion_lie_over_the_tray(look, full):
    page = look(full.url)
    text_is(page, '#no-picture', 'no picture of this tray yet')
    gray = np.full((120, 160, 3), 128, dtype=np.uint8)
    mask = np.zeros((120, 160), dtype=np.uint8)
    mask[:, 80:] = 255
    wait_for_looks(page, full, {(1, 'tracks')})
    page.locator('#motion').click()
    wait_for_looks(page, full, {(1, 'tracks'), (1, 'motion')})
    full.show((1, 'tracks'), encoded('tracks', gray))
    full.show((1, 'motion'), encoded('motion', mask))
    page.wait_for_selector('#canvas:not([hidden])')
    still, moving = pixel(page, 40), pixel(page, 80)
    assert max(abs(level - 128) for level in still) < 6
    assert moving[0] > moving[2] + 30
    page.locator('#motion').click()
    assert max(abs(level - 128) for level in pixel(page, 80)) < 6
    page.locator('#tracks').click()
    wait_for_looks(page, full, {(1, 'tray')})


def pixel(page, column):
    page.wait_for_timeout(150)
    return page.evaluate(
        "(x) => [...canvas.getContext('2d').getImageData(x, 60, 1, 1).data].slice(0, 3)", column
    )


def wait_for_looks(page, server, looks):
    for _ in range(100):
        if server.wanted == looks:
            return
        page.wait_for_timeout(50)
    raise AssertionError(server.wanted)


def test_pictures_are_not_asked_for_by_a_page_that_is_gone(look, full):
    page = look(full.url)
    wait_for_looks(page, full, {(1, 'tracks')})
    page.close()
    other = look(f'{full.url}#tray-2')
    wait_for_looks(other, full, {(2, 'tracks')})


def test_a_lost_connection_is_said_and_found_again(look, full, serve, results):
    page = look(full.url)
    text_is(page, '#cor', shown(results.cors[-1])[0])
    port = full.port
    full.stop()
    text_is(page, '#link', 'connection lost, trying again')
    assert shown(results.cors[-1])[0] in page.locator('#cor').inner_text()
    again = serve(port=port)
    changed = replace(results.cors[-1], restitution=Interval(0.777, 0.7, 0.8))
    for record in (*results.speeds, changed):
        again.take(record)
    text_is(page, '#link', 'live')
    text_is(page, '#cor', '0.777')
    assert page.locator('.card').count() == 1


def test_the_token_is_asked_for_and_kept(look, serve, results):
    server = serve(host='0.0.0.0', token=TOKEN)
    for record in results.all:
        server.take(record)
    page = look(f'http://127.0.0.1:{server.port}/')
    assert page.url.endswith('/login')
    page.fill('#token', 'a wrong token')
    page.keyboard.press('Enter')
    page.wait_for_url('**/login#wrong')
    assert page.locator('#wrong').is_visible()
    page.fill('#token', TOKEN)
    page.keyboard.press('Enter')
    text_is(page, '#cor', shown(results.cors[-1])[0])
    page.reload()
    text_is(page, '#cor', shown(results.cors[-1])[0])
    assert page.evaluate('document.cookie') == ''


def test_the_token_does_not_stay_in_the_address(look, serve):
    server = serve(token=TOKEN)
    page = look(server.url)
    text_is(page, '#link', 'waiting for the pipeline')
    assert TOKEN not in page.url
