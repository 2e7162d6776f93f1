"""Reader of the ``.npz`` files with decay libraries and cluster curves.

Tested in test/inference/decay/test_decay_library.py and
test/inference/cluster_size/test_cluster_curve.py.
"""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

Content = TypeVar('Content')


def read_archive(
    name: str,
    source: Any,
    kind: str,
    command: str,
    parse: Callable[[Mapping[str, NDArray[Any]]], Content],
) -> Content:
    """Content of an ``.npz`` file.

    Parameters
    ----------
    name : str
        Name of the file in errors.
    source : Path or importlib.resources.abc.Traversable
    kind : str
        Kind of content, in errors.
    command : str
        Command that makes such a file, in errors.
    parse : callable
        Makes the content from the arrays; a ValueError or KeyError means a damaged file.

    Raises
    ------
    ConfigurationError
        When the file cannot be read.
    """
    remedy = f'make it again with `{command}`'
    try:
        with source.open('rb') as stream, np.load(stream, allow_pickle=False) as arrays:
            return parse(arrays)
    except FileNotFoundError as error:
        raise ConfigurationError(name, f'there is no such {kind}', remedy) from error
    except OSError as error:
        raise ConfigurationError(name, f'cannot be read ({error.strerror})', remedy) from error
    except (ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile) as error:
        raise ConfigurationError(name, f'is damaged, or no {kind}', remedy) from error
