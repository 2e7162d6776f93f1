"""Reports as one HTML file."""

from __future__ import annotations

import base64
from html.parser import HTMLParser

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.html_report import (
    Erratum,
    Picture,
    Section,
    Table,
    number,
    with_error,
    with_interval,
    write_report,
)

HOSTILE = '<script>alert("1")</script> & "more"'


class Page(HTMLParser):
    """Tags and texts of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.texts.append(data)


def page_of(tmp_path, sections, title='A title'):
    path = tmp_path / 'report.html'
    write_report(path, title, 'what it is', sections)
    return Page(path.read_text('utf-8'))


def test_pictures_are_inside_the_file(tmp_path):
    content = bytes(np.arange(200, dtype=np.uint8))
    (tmp_path / 'one.png').write_bytes(content)
    picture = Picture(path=tmp_path / 'one.png', caption='what it shows')
    page = page_of(tmp_path, [Section(title='one', parts=[picture])])
    ((_, attributes),) = [tag for tag in page.tags if tag[0] == 'img']
    kind, _, data = attributes['src'].partition(',')
    assert kind == 'data:image/png;base64'
    assert base64.b64decode(data) == content
    assert attributes['alt'] == 'what it shows'
    assert not any(name in ('script', 'link') for name, _ in page.tags)


@pytest.mark.parametrize('has_text', [True, False])
def test_only_a_picture_with_text_is_wider_than_a_phone(tmp_path, has_text):
    (tmp_path / 'a.png').write_bytes(b'')
    picture = Picture(path=tmp_path / 'a.png', caption='beads', has_text=has_text)
    page = page_of(tmp_path, [Section(title='beads', parts=[picture])])
    (attributes,) = [own for tag, own in page.tags if tag == 'figure']
    assert ('text' in attributes['class'].split()) == has_text


def test_a_line_of_the_terminal_is_set_in_the_letters_of_a_page(tmp_path):
    page = page_of(tmp_path, [Section(title='a', parts=['drag 0 +- 0.2 /s, below 3 um/s^2'])])
    assert 'drag 0 ± 0.2 /s, below 3 µm/s²' in page.texts


def test_whatever_texts_hold_is_text(tmp_path):
    table = Table(head=(HOSTILE,), rows=[(HOSTILE,)], caption=HOSTILE)
    parts = [HOSTILE, table, Erratum(text=HOSTILE)]
    page = page_of(tmp_path, [Section(title=HOSTILE, parts=parts)], title=HOSTILE)
    assert not any(name == 'script' for name, _ in page.tags)
    # In title, headline, contents, section, paragraph, head, cell, caption and erratum.
    assert sum(HOSTILE in text for text in page.texts) == 9


def test_the_contents_lead_to_every_section(tmp_path):
    page = page_of(tmp_path, [Section(title=name) for name in ('one', 'two', 'three')])
    links = [attributes['href'].removeprefix('#') for name, attributes in page.tags if name == 'a']
    ids = [attributes['id'] for name, attributes in page.tags if name == 'section']
    assert links == ids
    assert len(ids) == 3


def test_a_picture_that_is_missing_is_named(tmp_path):
    missing = Picture(path=tmp_path / 'none.png', caption='')
    with pytest.raises(RecordingError, match=r'none\.png'):
        page_of(tmp_path, [Section(title='one', parts=[missing])])
    assert not (tmp_path / 'report.html').exists()


def test_numbers_that_are_not_known_are_dashes():
    assert number(None) == number(float('nan')) == '–'
    assert number(0.0012345, 3, 1e3) == '1.23'
    assert number(1254.0) == '1250'


def test_a_number_has_the_digits_that_its_error_leaves():
    assert with_error(0.0123456, 0.000231, 1e3) == '12.35 ± 0.23'
    assert with_error(1234.5, 99.7) == '1234 ± 100'
    # The scatter of two cycles may be small by chance.
    assert with_error(0.962575, 0.000011) == '0.9626 ± 0.0001'
    assert with_error(799.4, float('nan')) == '800'
    assert with_error(799.0, 0.0) == '799'
    assert with_error(float('nan'), 1.0) == '–'


def test_an_interval_has_the_digits_that_its_length_leaves():
    assert with_interval(0.8931, (0.8652, 0.9191)) == '0.893 [0.865, 0.919]'
    assert with_interval(2.981e-3, (2.39e-3, 3.701e-3), 1e3) == '2.98 [2.39, 3.70]'
    assert with_interval(0.797, (0.2, 0.992)) == '0.80 [0.20, 0.99]'
    # Lengths of 0.0039 and 0.0041 leave the same digits.
    assert with_interval(0.98999, (0.98801, 0.99197)) == '0.9900 [0.9880, 0.9920]'
    assert with_interval(0.99, (0.98794, 0.99206)) == '0.9900 [0.9879, 0.9921]'
    assert with_interval(float('nan'), (0.0, 1.0)) == '–'
