"""Import of PyAV, an optional library that decodes and encodes videos.

Tested by ``test/studies/synthetic/test_film_video.py``.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from nanorocks_ros.errors import ConfigurationError


def pyav(where: str, alternative: str = '') -> Any:
    """The module ``av``.

    Parameters
    ----------
    where : str
        The file or setting that needs it, for the error message.
    alternative : str
        An action that does not need it, for the error message.

    Raises
    ------
    ConfigurationError
        If it is not installed.
    """
    try:
        return import_module('av')
    except ImportError as error:
        remedy = f'{alternative}, or run' if alternative else 'run'
        raise ConfigurationError(
            where,
            'needs PyAV, which is not installed',
            f'{remedy}: pip install av',
        ) from error
