"""What one does with the page: open past cycles, zoom, freeze, compare, export; and its alarms."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from cycles_of_results import told

SIZES = {'phone': (390, 844), 'tablet': (820, 1180), 'desk': (1400, 900)}


def text_is(page, selector, text):
    page.wait_for_function(
        '([selector, text]) => document.querySelector(selector)?.innerText.includes(text)',
        arg=[selector, text],
    )


@pytest.fixture
def cycled(serve, results):
    """A server that was told two cycles of two trays, and the beginning of a third."""
    server = serve()
    for number in (1, 2):
        for record in told(results, (1, 2)):
            server.take(replace(record, tray=number))
        for record in told(results, (3,))[:30]:
            server.take(replace(record, tray=number))
    return server


def rows_of(download):
    with open(download.path(), encoding='utf-8') as stream:
        header, *lines = stream.read().splitlines()
    return header, np.array([[float(cell or 'nan') for cell in line.split(',')] for line in lines])


def table(page, figure):
    with page.expect_download() as download:
        page.locator(f'#{figure} .csv').click()
    return download.value.suggested_filename, *rows_of(download.value)


def test_a_cycle_that_is_over_is_opened_and_left(look, cycled, results):
    page = look(cycled.url)
    text_is(page, '#state', 'cycle 3, cooling')
    page.locator('#finals button', has_text='Cycle 1').click()
    text_is(page, '#state', 'cycle 1, as it was')
    text_is(page, '#cor', f'{results.cors[-1].restitution.value:.3f}')
    text_is(page, '#cor', 'final for this cycle')
    assert not page.locator('#picture').is_visible()
    name, header, rows = table(page, 'speed-chart')
    assert name == 'tray_1_cycle_1_speed.csv'
    assert header.startswith('time,mean_projected_speed,')
    speeds = [speed for speed in results.speeds if speed.cycle == 1]
    assert rows[:, 0] == pytest.approx([1e-9 * speed.stamp_ns for speed in speeds])
    values = [speed.mean_projected_speed.value for speed in speeds]
    assert rows[:, 1] == pytest.approx(values, nan_ok=True)
    page.locator('#finals button', has_text='Cycle 3').click()
    text_is(page, '#state', 'cycle 3, cooling')
    page.locator('#finals button', has_text='Cycle 2').click()
    text_is(page, '#state', 'cycle 2, as it was')
    page.keyboard.press('ArrowRight')
    text_is(page, '#title', 'Tray 2')
    text_is(page, '#state', 'cycle 3, cooling')


def test_past_cycles_stay_while_the_next_one_is_measured(look, cycled, results):
    page = look(cycled.url)
    text_is(page, '#finals', 'Cycle 2')
    changed = replace(told(results, (3,))[40].mean_projected_speed, value=0.0421)
    cycled.take(replace(told(results, (3,))[40], mean_projected_speed=changed))
    text_is(page, '#speed', '42.1 mm/s')
    page.locator('#finals button', has_text='Cycle 1').click()
    text_is(page, '#state', 'cycle 1, as it was')


def test_all_plots_of_a_tray_are_zoomed_and_moved_together(look, cycled):
    page = look(cycled.url)
    page.locator('#finals button', has_text='Cycle 1').click()
    text_is(page, '#state', 'as it was')
    _, _, whole = table(page, 'speed-chart')
    plot = page.locator('#speed-chart .u-over')
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    middle = box['y'] + box['height'] / 2
    page.mouse.move(box['x'] + 0.25 * box['width'], middle)
    page.mouse.down()
    page.mouse.move(box['x'] + 0.5 * box['width'], middle, steps=4)
    page.mouse.up()
    marked = spans(page)
    assert marked['speed'] == pytest.approx(0.25 * np.ptp(whole[:, 0]), rel=0.1)
    # The clusters are estimated as often as the speeds; each plot shows the same time.
    assert marked['cluster'] == pytest.approx(marked['speed'], rel=0.15)
    begin = table(page, 'speed-chart')[2][0, 0]
    page.locator('#speed-chart .plot').focus()
    page.keyboard.press('PageDown')
    later = table(page, 'speed-chart')[2]
    assert later[0, 0] > begin + 0.1 * marked['speed']
    assert np.ptp(later[:, 0]) == pytest.approx(marked['speed'], rel=0.1)
    page.mouse.move(box['x'] + 0.5 * box['width'], middle)
    page.keyboard.down('Control')
    page.mouse.wheel(0, 300)
    page.keyboard.up('Control')
    assert spans(page)['speed'] > 1.2 * marked['speed']
    plot.dblclick()
    assert spans(page)['speed'] == pytest.approx(np.ptp(whole[:, 0]))


def spans(page):
    page.wait_for_timeout(100)
    return {name: np.ptp(table(page, f'{name}-chart')[2][:, 0]) for name in ('speed', 'cluster')}


def test_fingers_zoom_and_move(look, cycled):
    page = look(cycled.url, viewport={'width': 390, 'height': 844}, has_touch=True)
    page.locator('#finals button', has_text='Cycle 1').click()
    text_is(page, '#state', 'as it was')
    before = spans(page)['speed']
    page.evaluate(
        """() => {
          const box = document.querySelector('#speed-chart .plot');
          const { left, width, top } = box.getBoundingClientRect();
          const touch = (type, pointerId, share) => box.dispatchEvent(new PointerEvent(type, {
            pointerId, pointerType: 'touch', bubbles: true,
            clientX: left + share * width, clientY: top + 40,
          }));
          touch('pointerdown', 1, 0.45);
          touch('pointerdown', 2, 0.55);
          touch('pointermove', 1, 0.35);
          touch('pointermove', 2, 0.65);
          touch('pointerup', 1, 0.35);
          touch('pointerup', 2, 0.65);
        }"""
    )
    assert spans(page)['speed'] == pytest.approx(before / 3, rel=0.2)
    page.locator('#speed-chart .whole').click()
    assert spans(page)['speed'] == pytest.approx(before)


def test_a_plot_is_saved_as_a_picture(look, cycled, tmp_path):
    page = look(cycled.url)
    page.wait_for_selector('#speed-chart canvas')
    with page.expect_download() as download:
        page.locator('#speed-chart .png').click()
    assert download.value.suggested_filename == 'tray_1_cycle_3_speed.png'
    path = tmp_path / 'speed.png'
    download.value.save_as(path)
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    box = page.locator('#speed-chart .plot').bounding_box()
    assert picture.shape[1] == pytest.approx(box['width'] + 24, abs=3)
    # A curve on an opaque ground.
    assert picture.std() > 3
    assert picture.shape[2] == 3 or picture[..., 3].min() == 255


def test_nothing_is_saved_before_there_is_a_plot(look, serve, results):
    server = serve()
    page = look(server.url)
    server.expect(1)
    text_is(page, '#title', 'Tray 1')
    assert page.locator('#speed-chart .csv').is_disabled()
    assert page.locator('#speed-chart .png').is_disabled()
    for record in results.speeds[-5:]:
        server.take(record)
    page.wait_for_selector('#speed-chart canvas')
    assert page.locator('#speed-chart .png').is_enabled()
    assert page.locator('#cor-chart .csv').is_disabled()


def test_what_is_frozen_stays_until_it_is_thawed(look, cycled, results):
    page = look(cycled.url)
    text_is(page, '#speed', 'mm/s')
    page.locator('#freeze').click()
    text_is(page, '#state', 'frozen at')
    before = page.locator('#speed').inner_text()
    last = told(results, (3,))[60]
    changed = replace(last.mean_projected_speed, value=0.0421)
    cycled.take(replace(last, mean_projected_speed=changed))
    page.wait_for_timeout(700)
    assert page.locator('#speed').inner_text() == before
    page.keyboard.press('f')
    text_is(page, '#speed', '42.1 mm/s')
    assert 'frozen' not in page.locator('#state').inner_text()


def test_trays_are_compared(look, cycled, results):
    page = look(cycled.url)
    text_is(page, '#title', 'Tray 1')
    assert not page.locator('#comparison').is_visible()
    page.keyboard.press('c')
    page.wait_for_selector('#cor-comparison canvas')
    assert page.url.endswith('#compare')
    assert not page.locator('#detail').is_visible()
    name, header, rows = table(page, 'cor-comparison')
    assert name == 'trays_cor_comparison.csv'
    assert header.startswith('tray,cycle,restitution,restitution_lower,')
    final = results.cors[-1].restitution
    assert rows[:, 0].tolist() == [1, 2]
    assert rows[:, 2:5] == pytest.approx(np.array([[final.value, final.lower, final.upper]] * 2))
    _, header, rows = table(page, 'speed-comparison')
    assert header.split(',')[2] == 'time_since_shake'
    first, second = (rows[rows[:, 0] == number] for number in (1, 2))
    assert first[:, 2] == pytest.approx(second[:, 2])
    assert first[0, 2] < 5.0
    text_is(page, '#speed-comparison .trays', 'tray 2')
    page.locator('.card', has_text='Tray 2').click()
    text_is(page, '#title', 'Tray 2')
    assert not page.locator('#comparison').is_visible()


def test_alarms_stand_above_everything_until_they_are_over(look, serve):
    server = serve()
    page = look(server.url)
    text_is(page, '#link', 'waiting for the pipeline')
    assert not page.locator('#alarms').is_visible()
    texts = {'camera silent': 'no frame for 4 s', 'disk low': '<b>0.9 GB left', 'frames lost': '9'}
    values = [(f'alarm: {name}', text) for name, text in texts.items()]
    server.diagnose([('/nanorocks/pipeline', 1, 'no frame for 4 s', values)])
    for name, text in texts.items():
        text_is(page, '#alarms', name.capitalize()[1:])
        text_is(page, '#alarms', text)
    assert page.locator('#alarms li').count() == len(texts)
    assert page.locator('#alarms').get_attribute('role') == 'alert'
    recording = [('alarm: recording stopped', 'bags/run: the disk is full')]
    server.diagnose([('/nanorocks/pipeline', 2, 'the disk is full', recording)])
    text_is(page, '#alarms', 'bags/run: the disk is full')
    assert page.locator('#alarms li').count() == 1
    server.diagnose([('/nanorocks/pipeline', 0, 'working', [])])
    page.wait_for_selector('#alarms', state='hidden')
    text_is(page, '#alarms', 'not heard for')


def test_the_page_says_what_it_waits_for(look, serve, results):
    server = serve()
    page = look(server.url)
    text_is(page, '#link', 'waiting for the pipeline')
    server.diagnose([('/nanorocks/dashboard', 0, 'working', [])])
    server.expect(1)
    text_is(page, '#link', 'compiling, waiting for the pipeline')
    assert page.locator('#link').get_attribute('data-state') == 'waiting'
    progress = 'compiling functions, once on this machine: push, 3 so far'
    server.diagnose([('/nanorocks/pipeline', 0, progress, [])])
    text_is(page, '#link', progress)
    server.diagnose([('/nanorocks/pipeline', 0, 'working', [])])
    text_is(page, '#link', 'waiting for the first results')
    server.take(results.speeds[-1])
    text_is(page, '#link', 'live')
    assert page.locator('#link').get_attribute('data-state') == 'ok'
    text_is(page, '#link', 'no results for')


def test_the_clock_goes(look, serve):
    page = look(serve().url)
    first = page.locator('#clock').inner_text()
    assert first.count(':') == 2
    page.wait_for_function('(first) => clock.innerText !== first', arg=first)


@pytest.mark.parametrize('name', SIZES)
@pytest.mark.parametrize('view', ['', '#compare'])
def test_no_view_leaves_a_half_empty_or_sticks_out(look, cycled, name, view):
    width, height = SIZES[name]
    page = look(f'{cycled.url}{view}', viewport={'width': width, 'height': height})
    page.wait_for_selector('#speed-comparison canvas' if view else '#speed-chart canvas')
    assert page.evaluate('document.documentElement.scrollWidth - innerWidth') <= 0
    right = page.evaluate(
        """() => [...document.querySelectorAll('.card, #numbers, figure, .node')]
          .filter((one) => one.checkVisibility())
          .map((one) => one.getBoundingClientRect().right)"""
    )
    # What ends a row ends at the margin.
    assert max(right) == pytest.approx(page.evaluate('document.body.clientWidth'), abs=24)
    figures = page.evaluate(
        """() => [...document.querySelectorAll('figure')].filter((one) => one.checkVisibility())
          .map((one) => { const { left, right, top } = one.getBoundingClientRect();
                          return [Math.round(top), left, right]; })"""
    )
    rows = {}
    for top, left, right in figures:
        low, high = rows.get(top, (left, right))
        rows[top] = min(low, left), max(high, right)
    whole = page.evaluate("document.querySelector('main').clientWidth")
    assert all(high - low == pytest.approx(whole, abs=4) for low, high in rows.values()), rows
