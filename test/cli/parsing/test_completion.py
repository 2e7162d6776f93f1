"""The script of a shell completes commands, options and choices."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from nanorocks_ros.cli.main import main

pytest.importorskip('shtab')

COMPLETE = """
source {script}
COMP_WORDS=({words}); COMP_CWORD={last}; COMP_LINE="{words}"; COMP_POINT=${{#COMP_LINE}}
$(complete -p nanorocks | sed 's/.*-F \\([^ ]*\\).*/\\1/')
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture
def script(tmp_path, capsys):
    assert main(['completion', 'bash']) == 0
    path = tmp_path / 'nanorocks.bash'
    path.write_text(capsys.readouterr().out)
    return path


@pytest.mark.skipif(shutil.which('bash') is None, reason='needs bash')
@pytest.mark.parametrize(
    ('words', 'offered'),
    [
        ('nanorocks anal', {'analyse'}),
        ('nanorocks figure de', {'decay'}),
        ('nanorocks analyse --speed-meth', {'--speed-method'}),
        ('nanorocks analyse --speed-method tr', {'tracking'}),
        ('nanorocks analyse --preprocess-stabilise o', {'on', 'off'}),
        ('nanorocks analyse --format par', {'parquet'}),
        ('nanorocks completion z', {'zsh'}),
    ],
)
def test_bash_offers_what_fits(script, words, offered):
    code = COMPLETE.format(script=script, words=words, last=len(words.split()) - 1)
    done = subprocess.run(
        ['bash', '--norc', '-c', code], capture_output=True, text=True, check=False
    )
    assert not done.stderr
    assert set(done.stdout.split()) == offered


def test_the_script_for_zsh_is_complete(tmp_path, capsys):
    assert main(['completion', 'zsh']) == 0
    script = capsys.readouterr().out
    assert script.startswith('#compdef nanorocks')
    assert '--speed-method' in script
    if shutil.which('zsh'):
        (tmp_path / '_nanorocks').write_text(script)
        subprocess.run(['zsh', '-n', str(tmp_path / '_nanorocks')], check=True)


def test_another_shell_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['completion', 'fish'])
    assert ended.value.code == 2
    assert "'fish' is none of bash, zsh" in capsys.readouterr().err
