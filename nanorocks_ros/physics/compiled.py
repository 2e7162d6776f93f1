"""How every compiled function here is compiled: one place, so that results agree everywhere.

No ``fastmath``: together with the rule that compiled code uses only ``+ - * /``, square roots
and integers, this makes states and pictures bit-identical on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba

if TYPE_CHECKING:
    from collections.abc import Callable
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
