"""What commands and nodes use is compiled before, in several processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from numba.core import types

from nanorocks_ros.cli.main import build_parser
from nanorocks_ros.numerics.compilation.compiled_versions import CompiledVersion, argument_type
from nanorocks_ros.tools.compilation import function_list
from nanorocks_ros.tools.compilation.parallel_compilation import listed_versions, missing_versions

SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'

LISTED = listed_versions()


def test_the_list_names_each_version_once():
    assert max(Counter(LISTED).values()) == 1


@pytest.mark.parametrize('version', LISTED, ids=lambda version: version.function)
def test_a_listed_function_and_its_types_exist(version):
    function = version.dispatcher
    assert function.py_func.__code__.co_argcount == len(version.arguments)
    for text in version.arguments:
        assert isinstance(argument_type(text), types.Type)


# In a process of its own: what other tests called would count as well.
CALLED = """
import sys
from nanorocks_ros.cli.main import main
from nanorocks_ros.numerics.compilation.compiled_versions import versions_in_use
from nanorocks_ros.tools.compilation.parallel_compilation import listed_versions

if sys.argv[1:]:
    assert main(sys.argv[1:]) in (0, 3)
else:
    from nanorocks_ros.pipeline import warm_up

    for name in [name for name in vars(warm_up) if name.startswith('warm_up')]:
        getattr(warm_up, name)()
used = versions_in_use()
print(len(used), file=sys.stderr)
print(*sorted(used - set(listed_versions())), sep='\\n', file=sys.stderr)
"""


@pytest.fixture(scope='module')
def films(tmp_path_factory):
    """A folder with a film of a ball, imported, and one of beads that stick."""
    folder = tmp_path_factory.mktemp('films')
    function_list.draw_ball(folder / 'ball')
    main = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'
    for command in ('import ball --rate 60 -o fall', function_list.STUCK):
        subprocess.run([sys.executable, '-c', main, *command.split()], cwd=folder, check=True)
    return folder


@pytest.mark.parametrize(
    ('words', 'fewest'),
    [
        ((), 70),
        (('analyse', str(SAMPLE), '--no-output'), 55),
        (('measure', 'fall', '--diameter-px', '24', '-o', 'out'), 25),
        (('simulate', '--sticking-speed', '0.005', '--duration', '2'), 10),
        (('measure', 'stuck.avi', '--trays', '1', '-o', 'stuck'), 55),
    ],
    ids=['nodes', 'analyse', 'measure', 'simulate', 'measure_stuck'],
)
def test_commands_and_nodes_call_only_what_is_listed(films, words, fewest):
    done = subprocess.run(
        [sys.executable, '-c', CALLED, *words], cwd=films, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    said = done.stderr.splitlines()
    count = max(place for place, line in enumerate(said) if line.isdigit())
    assert int(said[count]) >= fewest
    missing = [line for line in said[count + 1 :] if line]
    assert not missing, f'python -m {function_list.__name__} adds {missing}'


@pytest.mark.parametrize('command', function_list.COMMANDS, ids=lambda command: command.split()[0])
def test_the_commands_of_the_list_can_be_parsed(command):
    words = command.split()
    assert build_parser(words[0]).parse_args(words).run


# Each process has its own cache, whose folder it looks up once.
COMPILE = """
import json
from nanorocks_ros.numerics.compilation.compiled_versions import CompiledVersion
from nanorocks_ros.tools.compilation.parallel_compilation import (
    compile_versions, listed_versions, missing_versions)

if __name__ == '__main__':
    smallest = listed_versions()[-3:]
    wrong = CompiledVersion(smallest[0].module, 'nothing', ())
    said = []
    made = compile_versions((*smallest, wrong), 2, lambda *done: said.append(done))
    left = missing_versions((*smallest, wrong))
    print(json.dumps([made.functions, made.faults, said, [str(version) for version in left]]))
"""


def test_what_can_be_compiled_is_kept_and_the_rest_is_named(tmp_path):
    script = tmp_path / 'compile_some.py'
    script.write_text(COMPILE)
    done = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'kernels')},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    functions, faults, said, left = json.loads(done.stdout)
    assert functions == 3
    (fault,) = faults
    assert 'nothing is no compiled function' in fault
    assert [done for done, _ in said] == [1, 2, 3, 4]
    assert {total for _, total in said} == {4}
    (missing,) = left
    assert missing == f'{LISTED[-3].module} nothing'


def test_a_function_that_does_not_exist_is_missing():
    version = CompiledVersion('nanorocks_ros.numerics.median', 'nothing', ())
    assert missing_versions([version]) == (version,)
