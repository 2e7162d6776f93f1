"""The command ``nanorocks library``; `test_decay_simulations` builds libraries."""

from __future__ import annotations

import pytest

from nanorocks_ros.cli.main import main

PAIRS = '--restitution-law', 'pairs', '--restitution-pairs'


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (('--tray', '9', '-o', 'a.npz'), 2, 'tray 9'),
        (('--tray', '1', '-o', 'a.txt'), 2, 'ends in none of .npz'),
        (('--tray', '1', '-o', 'nowhere/a.npz'), 1, 'there is no folder nowhere'),
        (('--tray', '1', '-o', 'a.npz', '--trays-file', 'no.yaml'), 2, 'no.yaml'),
        (('--tray', '1', '-o', 'a.npz', '--workers', '0'), 2, '--workers'),
        (('--tray', '1', '-o', 'a.npz', '--drag', '-1'), 2, 'drag'),
        (('--tray', '1', '-o', 'a.npz', '--restitution-law', 'linear'), 2, 'none of constant'),
        (
            ('--tray', '1', '-o', 'a.npz', *PAIRS, '0.9', '0.8'),
            1,
            'restitution_pairs: 2 restitutions for 1 species',
        ),
    ],
)
def test_a_wrong_call_is_one_line(tmp_path, monkeypatch, capsys, arguments, code, message):
    monkeypatch.chdir(tmp_path)
    assert main(['library', *arguments]) == code
    error = capsys.readouterr().err
    assert message in error
    assert error.count('\n') == 1
    assert not list(tmp_path.iterdir())
