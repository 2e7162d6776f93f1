"""PyAV, which decodes and encodes videos, where it is installed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from nanorocks_ros.errors import ConfigurationError


def pyav(what: str, otherwise: str = '') -> Any:
    """The library ``av``.

    Parameters
    ----------
    what : str
        Needs it: a file or a setting.
    otherwise : str
        What would do without it, for the remedy.

    Raises
    ------
    ConfigurationError
        When it is not installed.
    """
    try:
        return import_module('av')
    except ImportError as error:
        remedy = f'{otherwise}, or run' if otherwise else 'run'
        raise ConfigurationError(
            what,
            'needs PyAV, which is not installed',
            f"{remedy}: pip install 'nanorocks_ros[video]'",
        ) from error
