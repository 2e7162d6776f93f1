"""A report in a browser: nothing is cut on a phone or in the dark; pages have numbers."""

from __future__ import annotations

import re
import zlib

import cv2
import numpy as np
import pytest

from nanorocks_ros import __version__
from nanorocks_ros.outputs.html_report import Picture, Section, Table, write_report

CONCLUSION = 'Tray 1: restitution 0.880 [0.850, 0.907].'
CONTRAST = """() => {
  const light = (text) => {
    const parts = text.match(/[\\d.]+/g).slice(0, 3).map((part) => part / 255);
    const linear = parts.map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const dark = matchMedia('(prefers-color-scheme: dark)').matches;
  const ratios = [...document.querySelectorAll('p, h1, h2, a, td, figcaption')].map((element) => {
    const [a, b] = [light(getComputedStyle(element).color), dark ? 0.006 : 1.0];
    return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  });
  return Math.min(...ratios);
}"""


@pytest.fixture(scope='module')
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp('report')
    cv2.imwrite(str(folder / 'wide.png'), np.full((500, 1377, 3), 255, np.uint8))
    head = [f'a column of measured values {k} [mm/s]' for k in range(12)]
    table = Table(head=head, rows=[['0.8800 [0.8500, 0.9070]'] * 12] * 60, caption='what it is')
    parts = [table, Picture(path=folder / 'wide.png', caption='a figure'), 'a_long_word' * 30]
    write_report(
        folder / 'report.html', 'A title', CONCLUSION, [Section(title='one', parts=parts)]
    )
    return folder / 'report.html'


def test_the_conclusion_stands_first_then_date_version_and_command(report):
    page = report.read_text('utf-8')
    made = re.search(
        rf'Made on \d{{4}}-\d\d-\d\d \d\d:\d\d UTC with nanorocks_ros {__version__} by <code>',
        page,
    )
    assert page.index('<h1>') < page.index(CONCLUSION) < made.start() < page.index('<nav>')


def test_a_command_in_backticks_is_code_whose_options_are_not_broken(tmp_path):
    parts = ['run `nanorocks look my_film --at 2` <again>']
    write_report(tmp_path / 'r.html', 'T', 'C', [Section(title='one', parts=parts)])
    page = (tmp_path / 'r.html').read_text('utf-8')
    code = '<code>nanorocks look my_film <span>--at</span> 2</code>'
    assert f'<p>run {code} &lt;again&gt;</p>' in page


@pytest.mark.parametrize('scheme', ['light', 'dark'])
@pytest.mark.parametrize('width', [390, 820, 1400])
def test_nothing_is_cut_on_a_screen(browser, report, width, scheme):
    page = browser.new_page(viewport={'width': width, 'height': 900}, color_scheme=scheme)
    page.goto(report.as_uri())
    root = 'document.documentElement'
    assert page.evaluate(f'{root}.scrollWidth <= {root}.clientWidth')
    assert page.evaluate(CONTRAST) > 4.5
    # What is wider than the screen scrolls inside.
    table = page.locator('.scroll').first
    assert table.evaluate('(it) => it.scrollWidth > it.clientWidth')
    page.close()


def test_paper_has_the_numbers_of_its_pages(browser, report, tmp_path):
    page = browser.new_page()
    page.goto(report.as_uri())
    numbered = page.pdf(prefer_css_page_size=True)
    pages = len(re.findall(rb'/Type\s*/Page\b', numbered))
    page.add_style_tag(content='@page { @bottom-center { content: none; } }')
    bare = page.pdf(prefer_css_page_size=True)
    page.close()
    assert pages > 1
    # The same pages with something more on each of them.
    assert drawn(numbered) > drawn(bare) + 10 * pages


def drawn(pdf):
    """Bytes of all that is drawn, uncompressed."""
    total = 0
    for stream in re.findall(rb'stream\r?\n(.*?)endstream', pdf, re.DOTALL):
        try:
            total += len(zlib.decompress(stream))
        except zlib.error:
            continue
    return total
