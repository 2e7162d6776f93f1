"""How every compiled function here is compiled: one place, so that results agree everywhere.

No ``fastmath``: together with the rule that compiled code uses only ``+ - * /``, square roots
and integers, this makes states and pictures bit-identical on every machine.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
from numba.core import event

if TYPE_CHECKING:
    from collections.abc import Callable

LOGGER = logging.getLogger('nanorocks_ros')

# The functions that take longest to compile, and what they belong to.
_SLOWEST = {'run_until': 'the simulation', 'cover': 'the tracking'}

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
        return _njit(function, {**options, 'cache': True})
    except RuntimeError:
        # numba refuses to cache where neither the package nor the home can be written.
        return _njit(function, options)


def _njit(function: Function, options: dict[str, Any]) -> Function:
    decorator: Any = numba.njit(**{'error_model': 'numpy', 'nogil': True, **options})
    return cast('Function', decorator(function))
