"""Files of an installation, for ROS 2 and for Python."""

import ast
import importlib.metadata
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

import nanorocks_ros

ROOT = Path(__file__).resolve().parent.parent
EXECUTABLES = sorted(path.name for path in (ROOT / 'scripts').iterdir())
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.xml'))
# Run by a Python with the installation, not the source tree, on its path.
READ_PACKAGE_DATA = """
from importlib import resources
import nanorocks_ros
from nanorocks_ros.records import CorEstimate
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.wire.array_layouts import layout

print(nanorocks_ros.__file__)
print(len(load_trays()), layout(CorEstimate).fields[0].name)
for name in ('page', 'film_page'):
    page = resources.files('nanorocks_ros.dashboard').joinpath(name)
    print(*sorted(path.name for path in page.iterdir()))
"""


def installed_prefix(monkeypatch):
    """The prefix of the package in the index of ROS, as `ros2 run` finds it."""
    packages = pytest.importorskip('ament_index_python.packages', reason='there is no ROS here')
    monkeypatch.setenv('AMENT_PREFIX_PATH', sys.prefix)
    return Path(packages.get_package_prefix('nanorocks_ros'))


@pytest.mark.parametrize('name', EXECUTABLES)
def test_ros2_run_finds_the_executable(monkeypatch, name):
    path = installed_prefix(monkeypatch) / 'lib' / 'nanorocks_ros' / name
    assert path.is_file()
    assert os.access(path, os.X_OK)
    assert path.read_text() == (ROOT / 'scripts' / name).read_text()


def test_every_node_is_an_executable():
    tree = ast.parse((ROOT / 'nanorocks_ros' / 'nodes' / 'run.py').read_text())
    (nodes,) = (
        ast.literal_eval(statement.value)
        for statement in tree.body
        if isinstance(statement, ast.Assign) and statement.targets[0].id == 'NODES'
    )
    assert sorted(nodes) == EXECUTABLES


@pytest.mark.parametrize('name', EXECUTABLES)
def test_an_executable_runs_the_node_of_its_name(name):
    text = (ROOT / 'scripts' / name).read_text()
    assert text.startswith('#!/usr/bin/env python3\n')
    assert f"main('{name}')" in text


def test_shared_files_are_installed_as_files(monkeypatch):
    share = installed_prefix(monkeypatch) / 'share' / 'nanorocks_ros'
    sources = [ROOT / 'package.xml', *LAUNCH_FILES]
    for folder in ('config', 'foxglove', 'rviz', 'plotjuggler'):
        sources += (ROOT / folder).iterdir()
    for source in sources:
        installed = share / source.relative_to(ROOT)
        assert not installed.is_symlink()
        assert installed.read_bytes() == source.read_bytes()


def test_the_only_command_is_nanorocks():
    scripts = importlib.metadata.distribution('nanorocks_ros').entry_points
    assert [script.name for script in scripts.select(group='console_scripts')] == ['nanorocks']


def test_the_version_is_the_same_everywhere():
    versions = {
        'distribution': importlib.metadata.version('nanorocks_ros'),
        'CITATION.cff': re.search(
            r'^version: (.+)$', (ROOT / 'CITATION.cff').read_text(), re.MULTILINE
        ).group(1),
    }
    for path in ('package.xml', 'msg_defs/nanorocks_msgs/package.xml'):
        versions[path] = ElementTree.parse(ROOT / path).findtext('version')
    assert versions == dict.fromkeys(versions, nanorocks_ros.__version__)


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_a_launch_file_names_existing_nodes_and_arguments(path):
    launch = ElementTree.parse(path).getroot()
    arguments = {argument.get('name') for argument in launch.iter('arg')}
    used = re.findall(r'\$\(var (\w+)\)', path.read_text())
    assert set(used) == arguments
    nodes = list(launch.iter('node'))
    assert nodes
    assert {node.get('exec') for node in nodes} <= set(EXECUTABLES)
    assert {node.get('pkg') for node in nodes} == {'nanorocks_ros'}
    for shared in re.findall(r'\$\(find-pkg-share nanorocks_ros\)/([\w./]+)', path.read_text()):
        assert (ROOT / shared).is_file()


def test_a_plain_installation_has_its_package_data(source_copy, tmp_path):
    pip = [sys.executable, '-m', 'pip', '--disable-pip-version-check', 'install', '--no-deps']
    # Without --ignore-installed pip would remove the installation that runs this test.
    options = ['--no-build-isolation', '--no-index', '--ignore-installed', '--prefix', tmp_path]
    subprocess.run([*pip, *options, source_copy], check=True, capture_output=True, timeout=300)
    (packages,) = tmp_path.glob('lib/python3*/site-packages')
    result = subprocess.run(
        [sys.executable, '-c', READ_PACKAGE_DATA],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(packages)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stderr
    module, data, *pages = result.stdout.splitlines()
    assert Path(module).is_relative_to(packages)
    assert data == '8 time'
    for page, name in zip(pages, ('page', 'film_page'), strict=True):
        source = ROOT / 'nanorocks_ros' / 'dashboard' / name
        assert page.split() == sorted(path.name for path in source.iterdir())
    for name in EXECUTABLES:
        assert os.access(tmp_path / 'lib' / 'nanorocks_ros' / name, os.X_OK)


@pytest.mark.parametrize('lock', ['wheels', 'jazzy', 'oldest'])
def test_every_locked_package_has_its_hashes(lock):
    text = (ROOT / 'requirements' / f'{lock}.txt').read_text()
    blocks = [block for block in re.split(r'\n(?=\S)', text) if not block.startswith('#')]
    assert len(blocks) > 50
    for block in blocks:
        assert re.match(r'[a-z0-9-]+==\S+', block), block[:80]
        assert re.search(r'--hash=sha256:[0-9a-f]{64}', block), block[:80]


def test_an_environment_is_made_with_hashes_alone():
    """Both installations from a lock file, and the lock files are made with them."""
    script = (ROOT / 'requirements' / 'set_up.sh').read_text()
    calls = re.findall(r'pip_install (.*) -r ', script)
    assert len(calls) == 2
    assert all('--require-hashes' in call for call in calls)
    # A release of tomorrow must not change what is installed, nor stop it.
    assert '--no-deps' in calls[1]
    makefile = (ROOT / 'Makefile').read_text()
    assert '--generate-hashes' in makefile


@pytest.mark.parametrize('ros', ['', 'jazzy'])
def test_an_installation_compiles_functions_but_not_in_ci(ros):
    calls = {}
    for ci in ('', 'true'):
        environment = {**os.environ, 'CI': ci, 'ROS_DISTRO': ros}
        made = subprocess.run(
            ['make', '--dry-run', 'venv'],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert made.returncode == 0, made.stderr
        calls[ci] = made.stdout.splitlines()[-1].split()
    assert calls[''] == [*calls['true'], 'compile']
    script = (ROOT / 'requirements' / 'set_up.sh').read_text()
    assert '"$folder/bin/nanorocks" compile' in script


def test_requirements_of_every_day_are_no_extras():
    requires = importlib.metadata.requires('nanorocks_ros')
    if not any(line.startswith('shtab') for line in requires):
        pytest.skip('the installed metadata are older than setup.cfg: make venv')
    for name in ('av', 'shtab'):
        lines = [line for line in requires if re.match(rf'{name}\b', line)]
        assert lines
        assert not any('extra' in line for line in lines)


def test_the_package_is_typed():
    assert (ROOT / 'nanorocks_ros' / 'py.typed').is_file()
    assert 'nanorocks_ros = py.typed' in (ROOT / 'setup.cfg').read_text()


def test_the_scripts_of_containers_are_valid():
    script = ROOT / '.devcontainer' / 'entrypoint'
    assert os.access(script, os.X_OK)
    for path in (script, ROOT / 'requirements' / 'test_package.sh', ROOT / '.ci' / 'run'):
        subprocess.run(['bash', '-n', str(path)], check=True)
    assert str(script.relative_to(ROOT)) in (ROOT / 'Dockerfile').read_text()
    settings = (ROOT / '.devcontainer' / 'devcontainer.json').read_text().splitlines()
    built = json.loads('\n'.join(line for line in settings if not line.strip().startswith('//')))
    assert (ROOT / '.devcontainer' / built['build']['dockerfile']).is_file()


def test_the_citation_is_that_of_this_version():
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text())
    assert citation['version'] == nanorocks_ros.__version__
    # Until there is one.
    assert 'doi' not in citation
