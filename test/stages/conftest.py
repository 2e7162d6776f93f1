"""The plate that several tests look at."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from plates import Plate


@pytest.fixture(scope='session')
def plate():
    """A plate under a straight lens."""
    return Plate()
