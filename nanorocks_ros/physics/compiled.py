"""How every compiled function here is compiled: one place, so that results agree everywhere.

No ``fastmath``: together with the rule that compiled code uses only ``+ - * /``, square roots
and integers, this makes states and pictures bit-identical on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar, cast

import numba

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

Function = TypeVar('Function', bound='Callable[..., Any]')


def compiled(function: Function) -> Function:
    """Compile a function when first called, and keep the result on disk where possible."""
    try:
        return _njit(function, cache=True)
    except RuntimeError:
        # numba refuses to cache where neither the package nor the home can be written.
        return _njit(function, cache=False)


def _njit(function: Function, *, cache: bool) -> Function:
    decorator = numba.njit(error_model='numpy', nogil=True, cache=cache)
    return cast('Function', decorator(function))
