"""Figures are written in one style: complete, with their fonts, and with their origin."""

from __future__ import annotations

import subprocess
import sys

import cv2
import pytest
from PIL import Image

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.figure_files import figure_file


def drawn(path, **more):
    with figure_file(path, 85.0, 60.0, **more) as figure:
        axes = figure.subplots()
        axes.plot([1, 2], [1, 2], label=r'$\tau$ and text')
        axes.set_xlabel('time [s]')
        axes.legend()
    return path


def test_a_png_has_the_width_of_a_column_at_200_dots_per_inch(tmp_path):
    picture = drawn(tmp_path / 'a.png')
    assert cv2.imread(str(picture)).shape[:2] == (472, 669)
    assert Image.open(picture).info['dpi'] == pytest.approx((200.0, 200.0), abs=0.1)


def test_a_pdf_holds_its_fonts_and_none_of_type_3(tmp_path):
    content = drawn(tmp_path / 'a.pdf').read_bytes()
    assert b'/Type3' not in content
    assert b'/FontFile2' in content


def test_an_svg_needs_no_font(tmp_path):
    content = drawn(tmp_path / 'a.svg').read_text()
    assert '<text' not in content
    assert '<path' in content


@pytest.mark.parametrize('suffix', ['.png', '.pdf', '.svg'])
def test_a_figure_says_which_version_and_command_made_it(tmp_path, suffix):
    path = drawn(tmp_path / f'a{suffix}', command='nanorocks figure decay results')
    content = path.read_bytes()
    assert f'nanorocks_ros {__version__}'.encode() in content
    assert b'nanorocks figure decay results' in content


def test_the_command_is_that_of_the_process_without_the_folder_of_its_program(tmp_path):
    code = (
        'import sys; from nanorocks_ros.outputs.command_line import command_line; '
        "sys.argv = ['/opt/bin/nanorocks', 'figure', 'a b']; print(command_line())"
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == "nanorocks figure 'a b'\n"


def test_an_unknown_suffix_is_refused_before_anything_is_drawn(tmp_path):
    with (
        pytest.raises(ConfigurationError, match=r'ends in none of \.png, \.pdf, \.svg'),
        figure_file(tmp_path / 'a.jpg', 85.0, 60.0),
    ):
        pytest.fail('the figure was begun')
    assert not list(tmp_path.iterdir())


def test_a_figure_that_fails_leaves_the_earlier_one(tmp_path):
    path = tmp_path / 'a.png'
    path.write_text('earlier')
    with pytest.raises(ZeroDivisionError), figure_file(path, 85.0, 60.0):
        raise ZeroDivisionError
    assert path.read_text() == 'earlier'
    assert [file.name for file in tmp_path.iterdir()] == ['a.png']
