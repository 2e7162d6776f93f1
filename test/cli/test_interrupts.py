"""Ctrl-C ends a command in one line, in every phase."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from nanorocks_ros.cli.interrupts import Interrupts

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'
RUN = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'
SIMULATE = ('simulate', '--runs', '400', '--duration', '600', '--tray', '8', '--workers', '2')

# An interruption while LLVM calls Python is printed and lost by ctypes.
IN_A_CALL_FROM_C = """
import ctypes, signal, sys, time
import nanorocks_ros.cli.main as command

def run(options):
    call = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))
    call()
    time.sleep(60)

import nanorocks_ros.cli.recordings.info as info
info.run = run
sys.exit(command.main(['info', sys.argv[1]]))
"""
AS_ANOTHER_ERROR = """
import signal, sys
import nanorocks_ros.cli.main as command
import nanorocks_ros.cli.recordings.info as info

def run(options):
    try:
        signal.raise_signal(signal.SIGINT)
    except BaseException:
        raise ImportError('numpy failed to import')

info.run = run
sys.exit(command.main(['info', sys.argv[1]]))
"""


def started(words, cache, code=RUN):
    return subprocess.Popen(
        [sys.executable, '-c', code, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, 'NUMBA_CACHE_DIR': str(cache)},
        # A group of its own: Ctrl-C reaches the workers as well.
        start_new_session=True,
    )


def check_one_line(process):
    _, said = process.communicate(timeout=60)
    (line,) = said.splitlines()
    assert line.startswith('nanorocks: interrupted; ')
    assert process.returncode == 130


def wait_for(condition, process):
    while not condition():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.005)


# Cold caches: the moments are those of loading, compiling and running.
@pytest.mark.parametrize('delay', [0.0, 0.4, 1.5, 4.0])
def test_an_interruption_at_any_moment_is_one_line(tmp_path, delay):
    loaded = tmp_path / 'loaded'
    code = f'import nanorocks_ros.cli.main as m; open({str(loaded)!r}, "w").close(); '
    process = started(SIMULATE, tmp_path / 'cache', code + 'import sys; sys.exit(m.main())')
    wait_for(loaded.exists, process)
    # `main` sets its handler at once.
    time.sleep(0.02 + delay)
    os.killpg(process.pid, signal.SIGINT)
    check_one_line(process)


def test_an_interruption_while_functions_are_compiled_is_one_line(tmp_path):
    cache = tmp_path / 'cache'
    process = started(SIMULATE, cache)
    wait_for(lambda: any(cache.rglob('*.nbi')), process)
    os.killpg(process.pid, signal.SIGINT)
    check_one_line(process)


@pytest.mark.parametrize('code', [IN_A_CALL_FROM_C, AS_ANOTHER_ERROR])
def test_an_interruption_that_other_code_would_lose_ends_the_command(tmp_path, code):
    check_one_line(started((str(SAMPLE),), tmp_path, code))


def test_what_ignores_interruptions_goes_on_ignoring_them():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with Interrupts() as interrupts:
            signal.raise_signal(signal.SIGINT)
        assert not interrupts.seen
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_without_an_interruption_all_is_as_before():
    hook, handler = sys.unraisablehook, signal.getsignal(signal.SIGINT)
    with Interrupts() as interrupts:
        assert signal.getsignal(signal.SIGINT) is not handler
    assert not interrupts.seen
    assert (sys.unraisablehook, signal.getsignal(signal.SIGINT)) == (hook, handler)
