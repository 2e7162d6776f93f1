"""Decorators for numba functions: one set of options, so that results agree everywhere.

No ``fastmath``: together with the rule that compiled code uses only ``+ - * /``, square roots
and integers, this makes states and pictures bit-identical on every machine.
"""

from __future__ import annotations

import logging
from functools import update_wrapper
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
from numba import extending
from numba.core import event

from nanorocks_ros.numerics.compilation.kernel_cache import SharedCache

if TYPE_CHECKING:
    from collections.abc import Callable

LOGGER = logging.getLogger('nanorocks_ros')

# Functions that take longest to compile, and the part of the program they belong to.
_SLOWEST = {'run_until': 'the simulation', 'cover_with_discs': 'the tracking'}

_OPTIONS = {'error_model': 'numpy', 'nogil': True}

# `lean_compilation` and `kernel_loading` replace parts of numba that no version promises to keep.
# They were tested with the first and the last of these; with others numba compiles and loads in
# its own way, which takes twice as long and gives the same numbers.
_IS_LEAN = (0, 59) <= numba.version_info.short < (0, 69)
if _IS_LEAN:
    from nanorocks_ros.numerics.compilation.kernel_loading import use_kernel_cache
    from nanorocks_ros.numerics.compilation.lean_compilation import compile_lean

Function = TypeVar('Function', bound='Callable[..., Any]')


def compiled(function: Function) -> Function:
    """Compile a function at its first call, and cache the result on disk if possible.

    Where Python calls it, it returns no named tuple but a plain one, such as ``state[:]``: a named
    one is made by Python code, in which an interrupt would end the process.
    """
    return _compiled(function, {})


def kernel(function: Function) -> Function:
    """Compile a long loop over many arrays that allocates none, as `compiled`.

    References to arrays are not counted: counting those of a tuple at each use would cost more
    than the physics.
    """
    return _compiled(function, {'_nrt': False})


class _Announcer(event.Listener):
    """Logs once that a long compilation starts."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def on_start(self, event: event.Event) -> None:
        name = event.data['dispatcher'].py_func.__name__
        if name in _SLOWEST and name not in self._told:
            self._told.add(name)
            LOGGER.info('compiling %s, once on this machine', _SLOWEST[name])

    def on_end(self, event: event.Event) -> None:
        pass


event.register('numba:compile', _Announcer())  # type: ignore[no-untyped-call]


def kernel_where(
    applies: Callable[[Any], bool], otherwise: object
) -> Callable[[Function], Function]:
    """Compile a kernel only for some types of its first argument.

    For all others a call gives a constant, and the kernel and what it calls are not compiled: a
    branch that a type rules out costs no time, neither when it runs nor to compile.

    Parameters
    ----------
    applies : callable
        Whether the kernel applies, from the numba type of the first argument.
    otherwise : object
        A value of the type that the kernel returns.
    """

    def decorate(function: Function) -> Function:
        compiled_kernel = kernel(function)

        def entry(*arguments: Any) -> Any:
            return compiled_kernel(*arguments)

        def call(*arguments: Any) -> Any:
            return compiled_kernel(*arguments)

        def give_constant(*arguments: Any) -> Any:
            return otherwise

        def choose(*arguments: Any) -> Callable[..., Any]:
            return call if applies(arguments[0]) else give_constant

        overload: Any = extending.overload
        overload(entry, jit_options={**_OPTIONS, '_nrt': False, 'forceinline': True})(choose)
        return cast('Function', update_wrapper(entry, function))

    return decorate


def inlined(function: Function) -> Function:
    """Compile a function into every place in a kernel that calls it.

    A call passes the arrays of a tuple one by one, which takes longer than most of these
    functions.
    """
    return _njit(function, {'forceinline': True, '_nrt': False})


def _compiled(function: Function, options: dict[str, Any]) -> Function:
    dispatcher: Any = _njit(function, options)
    SharedCache(dispatcher, function.__module__, _enable_cache)
    return cast('Function', dispatcher)


def _enable_cache(dispatcher: Any) -> None:
    if _IS_LEAN:
        use_kernel_cache(dispatcher)
    else:
        dispatcher.enable_caching()


def _njit(function: Function, options: dict[str, Any]) -> Function:
    decorator: Any = numba.njit(**{**_OPTIONS, **options})
    dispatcher = decorator(function)
    if _IS_LEAN:
        compile_lean(dispatcher)
    return cast('Function', dispatcher)
