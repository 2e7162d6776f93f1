"""``nanorocks tray FILM --browse`` in a real browser: marked, recognised, saved."""

from __future__ import annotations

import argparse
import re
import signal
import subprocess
import sys

import cv2
import pytest
from drawn_discs import SIZE, disc_frames

from nanorocks_ros.cli.films.tray_page import options_of
from nanorocks_ros.cli.main import EXIT_INTERRUPTED, main
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import load_trays

DARK, RED = (40, 40, 40), (30, 30, 190)
COMMAND = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'
SIZES = {'phone': (390, 844), 'tablet': (820, 1180), 'desk': (1400, 900)}


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    """A bag of red and dark discs."""
    folder = tmp_path_factory.mktemp('film') / 'discs'
    folder.mkdir()
    for number, frame in enumerate(disc_frames([RED, DARK], count=10)):
        cv2.imwrite(str(folder / f'{number}.png'), frame)
    bag = folder.parent / 'bag'
    assert main(['import', str(folder), '--rate', '30', '-o', str(bag)]) == 0
    return str(bag)


@pytest.fixture
def browsed(film, tmp_path):
    """The command, the address of its page, and the file that it writes."""
    output = tmp_path / 'mine.yaml'
    arguments = ['tray', film, '--browse', '-o', str(output)]
    with subprocess.Popen(
        [sys.executable, '-c', COMMAND, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        url = re.search(r'http://127\.0\.0\.1:\d+/\?token=\S+', process.stdout.readline())
        yield process, url[0], output
        process.kill()


def state_is(page, text):
    page.wait_for_function('(text) => link.innerText === text', arg=text)


def drag(page, start, end):
    """Drag in the picture, by pixels of the film."""
    page.evaluate('() => scrollTo(0, 0)')
    box = page.locator('#picture').bounding_box()
    scale = box['width'] / SIZE[0]
    for k, (x, y) in enumerate((start, end)):
        page.mouse.move(box['x'] + scale * x, box['y'] + scale * y, steps=4)
        if k == 0:
            page.mouse.down()
    page.mouse.up()


def test_what_is_marked_and_typed_is_recognised_and_saved(look, browsed):
    process, url, output = browsed
    page = look(url)
    state_is(page, 'recognised')
    assert 'token' not in page.url
    assert '10 found' in page.locator('#frames').inner_text()
    assert 'the diameter is guessed' in page.locator('#notices').inner_text()
    # One species of each colour: the circle that is there to a red disc, a second to a dark one.
    column, row, _ = (
        float(one.input_value()) for one in page.locator('#species .four input').all()
    )
    drag(page, (column, row), (40, 45))
    page.locator('#add').click()
    drag(page, (SIZE[0] / 2, SIZE[1] / 2), (90, 45))
    for k, name in enumerate(('garnet', 'steel')):
        fields = page.locator('#species fieldset').nth(k)
        fields.locator('[data-field=material]').fill(name)
        fields.locator('[data-field=diameter_mm]').fill('2')
        fields.locator('[data-field=count]').fill('5')
        fields.locator('[data-field=density_g_cm3]').fill(str(3 + k))
    drag(page, (2, 2), (10, 10))
    page.fill('#length', '35')
    page.fill('#width', '23')
    page.fill('#height', '2,5')
    page.wait_for_function(
        "() => document.querySelector('#frames').innerText.includes('5 + 5 found')"
    )
    page.wait_for_function("() => document.querySelector('#text').textContent.includes('steel')")
    state_is(page, 'recognised')
    text = page.locator('#text').text_content()
    assert 'all 5 beads seen' in page.locator('#verdicts').inner_text()
    page.locator('#save').click()
    state_is(page, 'saved')
    printed, said = process.communicate(timeout=20)
    assert process.returncode == 0, said
    assert f'--tray {output}' in printed or f'--trays-file {output}' in printed
    assert output.read_text() == text
    tray, section = load_trays(output)[1], film_section(output)
    assert [kind.material for kind in tray.species] == ['garnet', 'steel']
    assert section.region_px == (10, 10, SIZE[0] - 10, SIZE[1] - 10)
    assert section.container_known
    red, dark = (kind.appearance.colour for kind in tray.species)
    assert red[2] > 150.0 > dark[2]


def test_what_cannot_be_is_said_in_the_words_of_the_options(look, browsed):
    _, url, output = browsed
    page = look(url)
    state_is(page, 'recognised')
    page.fill('[data-field=diameter_mm]', '-2')
    state_is(page, 'not usable as described')
    assert page.locator('#error').inner_text() == '--diameter-mm: -2; give numbers above 0'
    assert page.locator('#save').is_disabled()
    page.fill('[data-field=diameter_mm]', '2')
    state_is(page, 'recognised')
    page.fill('#length', 'wide')
    state_is(page, 'not usable as described')
    assert "--sides-mm: 'wide' is no number" in page.locator('#error').inner_text()
    page.fill('#length', '')
    state_is(page, 'recognised')
    assert not output.exists()


def test_the_corners_are_clicked_and_forgotten(look, browsed):
    _, url, _ = browsed
    page = look(url)
    state_is(page, 'recognised')
    page.locator('#click-corners').click()
    box = page.locator('#picture').bounding_box()
    scale = box['width'] / SIZE[0]
    for x, y in ((12, 15), (350, 16), (352, 230), (11, 229)):
        page.mouse.click(box['x'] + scale * x, box['y'] + scale * y)
    corners = [float(page.locator(f'#{side}').input_value()) for side in ('left', 'bottom')]
    assert corners == pytest.approx([11, 230], abs=1)
    page.locator('#no-corners').click()
    assert float(page.locator('#bottom').input_value()) == SIZE[1]


def test_corners_in_perspective_are_refused_in_words_until_sides_are_told(look, browsed):
    _, url, _ = browsed
    page = look(url)
    state_is(page, 'recognised')
    page.locator('#click-corners').click()
    box = page.locator('#picture').bounding_box()
    scale = box['width'] / SIZE[0]
    for x, y in ((50, 15), (310, 16), (352, 230), (11, 229)):
        page.mouse.click(box['x'] + scale * x, box['y'] + scale * y)
    state_is(page, 'not usable as described')
    words = page.locator('#error').inner_text()
    assert '--corners: form no upright rectangle: one is 42 px off' in words
    assert 'calibrate' in words
    assert page.locator('#save').is_disabled()
    # Each corner is dragged where it is drawn.
    drag(page, (310, 16), (338, 20))
    drag(page, (50, 15), (24, 18))
    page.fill('#length', '35')
    page.fill('#width', '23')
    corners_told = "document.querySelector('#text').textContent.includes('corners_px')"
    page.wait_for_function(f'() => {corners_told}')
    state_is(page, 'recognised')
    corners = film_section(page.locator('#text').text_content()).corners_px
    for corner, place in zip(corners, ((24, 18), (338, 20), (352, 230), (11, 229)), strict=True):
        assert corner == pytest.approx(place, abs=1)
    # A side that is told makes the container upright again.
    page.fill('#length', '')
    page.fill('#width', '')
    page.fill('#bottom', '232')
    page.locator('#top').focus()
    page.wait_for_function(f'() => !{corners_told}')
    state_is(page, 'recognised')
    assert page.locator('#save').is_enabled()


@pytest.mark.parametrize('name', SIZES)
def test_nothing_sticks_out_at_any_size(look, browsed, name):
    width, height = SIZES[name]
    _, url, _ = browsed
    page = look(url, viewport={'width': width, 'height': height})
    state_is(page, 'recognised')
    assert page.evaluate('document.documentElement.scrollWidth - innerWidth') <= 0


def test_an_interrupt_ends_without_a_file_and_without_a_traceback(browsed):
    process, _, output = browsed
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == EXIT_INTERRUPTED
    assert said == 'nanorocks: interrupted; nothing was written\n'
    assert not output.exists()


def test_options_that_the_page_tells_are_refused(film, tmp_path, capsys):
    arguments = ['tray', film, '--browse', '--count', '5', '-o', str(tmp_path / 'mine.yaml')]
    assert main(arguments) == 2
    assert '--count: is given in the browser' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('form', 'message'),
    [
        ({}, 'species'),
        ({'species': 3}, 'species'),
        ({'species': [3]}, 'species'),
        ({'species': [{}]}, '--bead'),
        ({'species': [{'bead': [1, 2, 'x']}]}, "'x' is no number"),
        ({'species': [{'bead': [1, 2, float('nan')]}]}, 'no number'),
        ({'species': [{'bead': [1, 2, 3], 'count': 1.5}]}, '--count: 1.5'),
        ({'species': [], 'corners': list(range(99))}, 'corners'),
        ({'species': [], 'sides_mm': [5, None]}, 'one of two'),
        ({'species': [], 'height_mm': True}, "'True' is no number"),
    ],
)
def test_a_form_that_no_page_sends_is_refused(form, message):
    with pytest.raises(ConfigurationError, match=re.escape(message)):
        options_of(form, argparse.Namespace())
