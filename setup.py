"""Installs the package and, beside it, what ROS 2 looks for; the metadata stands in setup.cfg."""

from glob import glob
from os.path import isfile

from setuptools import Distribution, setup

PACKAGE = 'nanorocks_ros'
SHARED_FOLDERS = ('config', 'launch', 'foxglove', 'rviz', 'plotjuggler')


def files(pattern):
    """The files that match, in a fixed order."""
    return sorted(path for path in glob(pattern) if isfile(path))


class DistributionWithData(Distribution):
    """Lets `pip install --editable` install the data files as well."""

    def has_data(self):
        """What editable_wheel asks for; setuptools has it under the name has_data_files alone."""
        return self.has_data_files()


setup(
    distclass=DistributionWithData,
    # Here, since colcon cannot read what setuptools makes of it in setup.cfg.
    python_requires='>=3.10',
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        *((f'share/{PACKAGE}/{folder}', files(f'{folder}/*')) for folder in SHARED_FOLDERS),
        # Not entry points: pip ignores `install_scripts`, so only data files reach the folder
        # where `ros2 run` looks, and no generic name lands in anybody's bin/.
        (f'lib/{PACKAGE}', files('scripts/*')),
    ],
)
