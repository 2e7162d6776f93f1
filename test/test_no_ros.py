"""The package without its nodes works without ROS."""

import subprocess
import sys

IMPORT_THE_CORE = """
import importlib
import pkgutil
import sys

ROS = {'ament_index_python', 'builtin_interfaces', 'diagnostic_msgs', 'rcl_interfaces', 'rclpy',
       'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs'}


class NoRos:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in ROS:
            raise ImportError(f'no ROS here: {name}')


sys.meta_path.insert(0, NoRos())


def import_all(name):
    module = importlib.import_module(name)
    print(name)
    for child in pkgutil.iter_modules(getattr(module, '__path__', ()), name + '.'):
        if child.name != 'nanorocks_ros.nodes' and not child.name.endswith('.__main__'):
            import_all(child.name)


import_all('nanorocks_ros')
"""


def test_every_module_but_the_nodes_imports_without_ros():
    result = subprocess.run(
        [sys.executable, '-c', IMPORT_THE_CORE], capture_output=True, text=True, timeout=300
    )
    assert result.returncode == 0, result.stderr
    imported = set(result.stdout.split())
    assert {'nanorocks_ros.cli.main', 'nanorocks_ros.pipeline.composition'} <= imported
    assert not any(name.startswith('nanorocks_ros.nodes') for name in imported)


def test_an_import_of_ros_fails_when_it_is_hidden():
    # Checks the method of the test above.
    hidden = IMPORT_THE_CORE.replace("import_all('nanorocks_ros')", "import_all('rclpy')")
    result = subprocess.run([sys.executable, '-c', hidden], capture_output=True, text=True)
    assert result.returncode == 1
    assert 'no ROS here: rclpy' in result.stderr
