"""How every compiled function here is compiled: one place, so that results agree everywhere.

No ``fastmath``: together with the rule that compiled code uses only ``+ - * /``, square roots
and integers, this makes states and pictures bit-identical on every machine.
"""

from __future__ import annotations

import logging
import re
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
from numba.core import event

if TYPE_CHECKING:
    from collections.abc import Callable

LOGGER = logging.getLogger('nanorocks_ros')

# The functions that take longest to compile, and what they belong to.
_SLOWEST = {'run_until': 'the simulation', 'cover': 'the tracking'}

# At the left margin: what is imported for the type checker alone is not compiled.
_IMPORT = re.compile(r'^(?:from|import) ([\w.]+)', re.MULTILINE)

Function = TypeVar('Function', bound='Callable[..., Any]')


def compiled(function: Function) -> Function:
    """Compile a function when first called, and keep the result on disk where possible."""
    return _compiled(function, {})


def kernel(function: Function) -> Function:
    """The same for a long loop over many arrays that makes no new ones.

    Counting the references to the arrays of a tuple at each use costs more than the physics, so
    they are not counted.
    """
    return _compiled(function, {'_nrt': False})


class _Announcer(event.Listener):
    """Tells the log once when what takes its time must be compiled."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def on_start(self, event: event.Event) -> None:
        name = event.data['dispatcher'].py_func.__name__
        if name in _SLOWEST and name not in self._told:
            self._told.add(name)
            LOGGER.info('compiling %s, once on this machine: about half a minute', _SLOWEST[name])

    def on_end(self, event: event.Event) -> None:
        pass


event.register('numba:compile', _Announcer())  # type: ignore[no-untyped-call]


def inlined(function: Function) -> Function:
    """Compile a function into every place in a kernel that calls it.

    The arrays of a tuple are handed over one by one at a call, which takes longer than most
    of these functions.
    """
    return _njit(function, {'forceinline': True, '_nrt': False})


def _compiled(function: Function, options: dict[str, Any]) -> Function:
    try:
        dispatcher: Any = _njit(function, {**options, 'cache': True})
    except RuntimeError:
        # numba refuses to cache where neither the package nor the home can be written.
        return _njit(function, options)
    # numba looks at the file of the function only, but what that calls, and the constants that it
    # uses, are compiled into it: after an update there would be old code in new. The stamp is made
    # part of the version, which numba compares before it unpickles an index: unpickling fails when
    # the module of an argument's type has been moved.
    with suppress(AttributeError):
        file = dispatcher._cache._cache_file
        file._version = (file._version, _stamp(function.__module__))
    return cast('Function', dispatcher)


@cache
def _stamp(module: str) -> tuple[tuple[str, int, int], ...]:
    """Name, time and size of a module and all of its package that it imports, also indirectly."""
    package = module.partition('.')[0]
    found: dict[str, tuple[str, int, int]] = {}
    left = [module]
    while left:
        name = left.pop()
        path = getattr(sys.modules.get(name), '__file__', None)
        if name in found or path is None:
            continue
        status = Path(path).stat()
        found[name] = name, status.st_mtime_ns, status.st_size
        left += [one for one in _imports(path) if one.partition('.')[0] == package]
    return tuple(found[name] for name in sorted(found))


@cache
def _imports(path: str) -> tuple[str, ...]:
    try:
        return tuple(_IMPORT.findall(Path(path).read_text('utf-8')))
    except (OSError, UnicodeDecodeError):
        return ()


def _njit(function: Function, options: dict[str, Any]) -> Function:
    decorator: Any = numba.njit(**{'error_model': 'numpy', 'nogil': True, **options})
    return cast('Function', decorator(function))
