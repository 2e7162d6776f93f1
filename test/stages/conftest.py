"""The plate that several tests look at."""

import pytest
from plates import Plate


@pytest.fixture(scope='session')
def plate():
    """A plate under a straight lens."""
    return Plate()
