"""``nanorocks compile``: compile now, not at the first start; after Ctrl-C, the rest."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

# Three small functions, and one that takes longer than all else here.
COMMAND = """
import sys
from nanorocks_ros.cli.main import main
from nanorocks_ros.tools.compilation import parallel_compilation

if __name__ == '__main__':
    versions = parallel_compilation.listed_versions()
    longest = next(version for version in versions if version.function == 'run_until')
    wrong = longest._replace(function='nothing')
    chosen = (*versions[-3:], wrong if '--wrong' in sys.argv else longest)[:int(sys.argv[1])]
    parallel_compilation.listed_versions = lambda: chosen
    sys.exit(main(['compile', *(word for word in sys.argv[2:] if word != '--wrong')]))
"""


@pytest.fixture
def compile_some(tmp_path):
    """Start the command with some functions of the list, and an empty folder of kernels."""
    script = tmp_path / 'compile_some.py'
    script.write_text(COMMAND)

    def start(number, *words):
        return subprocess.Popen(
            [sys.executable, str(script), str(number), *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'kernels')},
            start_new_session=True,
        )

    return start


def said_by(process):
    said, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    return said.splitlines()


def test_a_second_call_finds_everything(compile_some, tmp_path):
    first, where = said_by(compile_some(3))
    assert first.startswith('3 of 3 functions compiled in ')
    assert where == f'kept in {tmp_path / "kernels"}'
    (second,) = said_by(compile_some(3))
    assert second == f'all 3 functions are compiled already, in {tmp_path / "kernels"}'


def test_the_summary_is_an_object(compile_some, tmp_path):
    (line,) = said_by(compile_some(2, '--workers', '1', '--json'))
    summary = json.loads(line)
    assert summary['functions'] == summary['compiled'] == 2
    assert summary['faults'] == []
    assert summary['folder'] == str(tmp_path / 'kernels')
    assert summary['processor_seconds'] > 0.0
    (line,) = said_by(compile_some(2, '--json'))
    assert json.loads(line)['compiled'] == 0


def test_an_interruption_keeps_what_was_compiled(compile_some, tmp_path):
    process = compile_some(4, '--workers', '1')
    # The code of a function is written when it is compiled, after the index that names it.
    while len(list(tmp_path.glob('kernels/*/*.nbc'))) < 3:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    (line,) = errors.splitlines()
    assert line.startswith('nanorocks: interrupted; 3 of 4 functions are compiled and stay in ')
    (line,) = said_by(compile_some(3))
    assert line.startswith('all 3 functions are compiled already')


def test_what_cannot_be_compiled_is_said_and_stops_nothing(compile_some):
    process = compile_some(4, '--workers', '2', '--wrong')
    said, errors = process.communicate(timeout=300)
    assert process.returncode == 1
    assert said.startswith('3 of 4 functions compiled in ')
    (line,) = errors.splitlines()
    assert 'nothing is no compiled function; it is compiled when it is first used' in line
