"""What several tests need."""

import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NOT_PACKAGED = ('.*', '__pycache__', '*.egg-info', 'build', 'install', 'log', 'dist')


@pytest.fixture(scope='session')
def root():
    """The source tree."""
    return ROOT


@pytest.fixture(scope='session')
def source_copy(tmp_path_factory):
    """A copy of the source tree that may be built in, without what earlier builds left."""
    copy = tmp_path_factory.mktemp('workspace') / 'nanorocks_ros'
    unneeded = shutil.ignore_patterns(*NOT_PACKAGED, 'bags', 'benchmarks', 'docs', 'test')
    shutil.copytree(ROOT, copy, symlinks=True, ignore=unneeded)
    return copy
