"""The repository is a colcon workspace."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest.importorskip('colcon_core', reason='there is no colcon here')
pytest.importorskip('ament_index_python', reason='there is no ROS here')

COLCON = shutil.which('colcon', path=str(Path(sys.executable).parent)) or 'colcon'
ROOT = Path(__file__).resolve().parent.parent
EXECUTABLES = sorted(path.name for path in (ROOT / 'scripts').iterdir())
# The search of `ros2 run` for an executable.
RESOLVE = """
import os, sys
from ament_index_python.packages import get_package_prefix
import nanorocks_ros
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import CorEstimate
from nanorocks_ros.wire.array_layouts import layout

assert len(load_trays()) == 8
assert layout(CorEstimate).fields[0].name == 'time'
print(nanorocks_ros.__file__)
for name in sys.argv[1:]:
    path = os.path.join(get_package_prefix('nanorocks_ros'), 'lib', 'nanorocks_ros', name)
    if not os.access(path, os.X_OK):
        sys.exit(f'{path} is no executable')
    print(path)
"""


def colcon(*arguments, cwd):
    """Run colcon on a workspace, and return its output."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in {'AMENT_PREFIX_PATH', 'COLCON_PREFIX_PATH', 'PYTHONPATH'}
    }
    environment['COLCON_HOME'] = str(cwd / 'colcon_home')
    # A sourced ROS has to remain visible.
    if 'ROS_DISTRO' in os.environ:
        environment = {**os.environ, 'COLCON_HOME': environment['COLCON_HOME']}
    result = subprocess.run(
        [COLCON, *arguments], cwd=cwd, env=environment, capture_output=True, text=True, timeout=300
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def in_workspace(command, cwd):
    """Run a command in a shell that has sourced the workspace."""
    environment = dict(os.environ, PATH=f'{Path(sys.executable).parent}:{os.environ["PATH"]}')
    environment.pop('AMENT_PREFIX_PATH', None)
    return subprocess.run(
        ['sh', '-c', f'. install/local_setup.sh && exec {command}'],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.fixture(scope='module', params=[(), ('--symlink-install',)], ids=['copied', 'symlinked'])
def workspace(request, source_copy, tmp_path_factory):
    """A built copy of the repository."""
    path = tmp_path_factory.mktemp('colcon') / 'workspace'
    shutil.copytree(source_copy, path, symlinks=True)
    select = ('--packages-select', 'nanorocks_ros')
    colcon('build', '--base-paths', '.', 'msg_defs', *select, *request.param, cwd=path)
    return path


def test_colcon_finds_both_packages(source_copy):
    packages = colcon('list', '--names-only', '--base-paths', '.', 'msg_defs', cwd=source_copy)
    assert packages.split() == ['nanorocks_msgs', 'nanorocks_ros']


def test_colcon_finds_both_packages_of_a_clone_in_src(source_copy, tmp_path):
    """As the documentation says for a workspace; the shell expands the star."""
    source = tmp_path / 'src'
    source.mkdir()
    (source / 'nanorocks_ros').symlink_to(source_copy)
    below = sorted(str(path.relative_to(tmp_path)) for path in source.glob('*/msg_defs'))
    packages = colcon('list', '--names-only', '--base-paths', 'src', *below, cwd=tmp_path)
    assert packages.split() == ['nanorocks_msgs', 'nanorocks_ros']


def test_both_packages_have_what_a_release_needs(source_copy):
    """Licence file, changes and the same version, in each: they are released one by one."""
    versions = set()
    for folder in (source_copy, source_copy / 'msg_defs' / 'nanorocks_msgs'):
        package = ElementTree.parse(folder / 'package.xml').getroot()
        versions.add(package.findtext('version'))
        licence = package.find('license')
        assert licence is not None
        assert (folder / licence.attrib['file']).read_text() == (ROOT / 'LICENSE').read_text()
        name = package.findtext('name')
        assert f'Changelog for package {name}' in (folder / 'CHANGELOG.rst').read_text()
        assert package.findtext('author')
    assert len(versions) == 1


def test_ros2_run_finds_every_executable(workspace):
    (workspace / 'resolve.py').write_text(RESOLVE)
    result = in_workspace(f'python3 resolve.py {" ".join(EXECUTABLES)}', cwd=workspace)
    assert result.returncode == 0, result.stderr
    paths = [Path(line) for line in result.stdout.split()]
    assert [path.name for path in paths[1:]] == EXECUTABLES
    assert all(path.is_relative_to(workspace) for path in paths)


def test_shared_files_are_installed(workspace):
    share = workspace / 'install' / 'nanorocks_ros' / 'share' / 'nanorocks_ros'
    for folder in ('config', 'launch'):
        names = sorted(path.name for path in (workspace / folder).iterdir())
        assert sorted(path.name for path in (share / folder).iterdir()) == names
    assert (share / 'package.xml').is_file()
    trays = workspace / 'nanorocks_ros' / 'experiment' / 'trays.yaml'
    assert (share / 'config' / 'trays.yaml').read_bytes() == trays.read_bytes()


def test_an_executable_runs(workspace):
    # A remapping without a target is rejected after the imports and before any topic.
    path = 'install/nanorocks_ros/lib/nanorocks_ros/haff_fitter'
    result = in_workspace(f'{path} --ros-args --remap nonsense', cwd=workspace)
    assert result.returncode == 2, result.stderr
    assert 'nonsense' in result.stderr


def test_the_command_is_on_the_path(workspace):
    result = in_workspace('sh -c "command -v nanorocks"', cwd=workspace)
    assert result.returncode == 0
    assert Path(result.stdout.strip()).is_relative_to(workspace)
