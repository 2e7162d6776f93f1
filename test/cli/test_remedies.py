"""Commands in remedies repeat the user's own files."""

from __future__ import annotations

from argparse import Namespace

import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.cli.remedies import with_own_files

TEXT = 'make one: nanorocks library --tray 3 -o tray_3.npz, and pass it'
TRAY = """materials:
  steel: {density_g_cm3: 7.85, color_bgr: [90, 90, 90]}
trays:
  1:
    dimensions_mm: [60, 40, 4]
    species:
      - {material: steel, diameter_mm: 2, count: COUNT}
"""


def test_the_trays_file_is_repeated_and_quoted():
    own = with_own_files(TEXT, Namespace(trays_file='my trays.yaml'))
    assert "nanorocks library --tray 3 --trays-file 'my trays.yaml' -o tray_3.npz" in own


@pytest.mark.parametrize('options', [None, Namespace(), Namespace(trays_file='a: 1\nb: 2\n')])
def test_without_a_file_the_remedy_stays(options):
    assert with_own_files(TEXT, options) == TEXT


def test_a_library_of_a_single_bead_is_refused_in_one_line(tmp_path, capsys):
    (tmp_path / 't.yaml').write_text(TRAY.replace('COUNT', '1'))
    arguments = ['--tray', '1', '--trays-file', str(tmp_path / 't.yaml')]
    code = main(['library', *arguments, '-o', str(tmp_path / 'a.npz')])
    printed = capsys.readouterr().err
    assert code == 2
    assert 'nanorocks measure' in printed
    assert 'Traceback' not in printed
