"""Archives of simulated calibrations (decay libraries, cluster curves), as users name them.

Tested by ``test/inference/decay/test_decay_library.py``.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from nanorocks_ros.archive_limits import check_archive
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.limits import require_regular_file

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

Content = TypeVar('Content')

# Raised by numpy, zipfile and `parse` for files of other content.
_DAMAGE = (
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    EOFError,
    RuntimeError,
    ArithmeticError,
    MemoryError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


def load_archive(
    name: str,
    package: str | None,
    parse: Callable[[Mapping[str, NDArray[Any]]], Content],
    *,
    kind: str,
    command: str,
) -> Content:
    """Read an ``.npz`` file of a simulated calibration.

    Parameters
    ----------
    name : str
        Path; relative to the folder of `package` where one is given.
    package : str or None
        Package that the file comes with.
    parse : callable
        Takes the arrays by name, returns the content; raises ValueError or KeyError for arrays of
        another kind or release.
    kind : str
        What the file holds, for messages.
    command : str
        Command that makes such a file, for messages.

    Raises
    ------
    ConfigurationError
        When the file cannot be read, is damaged or holds something else.
    """
    remedy = f'make it again with `{command}`'
    source: Any = resources.files(package).joinpath(name) if package else Path(name)
    if not package:
        require_regular_file(name, ConfigurationError)
    try:
        with source.open('rb') as stream:
            check_archive(stream, name, ConfigurationError)
        with source.open('rb') as stream, np.load(stream, allow_pickle=False) as arrays:
            return parse(arrays)
    except FileNotFoundError as error:
        raise ConfigurationError(name, f'there is no such {kind}', remedy) from error
    except OSError as error:
        raise ConfigurationError(name, f'cannot be read ({error.strerror})', remedy) from error
    except _DAMAGE as error:
        raise ConfigurationError(name, f'is damaged, or no {kind}', remedy) from error
