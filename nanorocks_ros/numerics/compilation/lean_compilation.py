"""Compiles a function and all that it calls as one unit, which takes a third of numba's time.

numba makes of every function that a compiled one calls a library of its own, be it of this package
or of its own implementation of NumPy: with wrappers for Python and C, optimised, translated into
machine code, and all of that once more as a part of its caller; once more, too, for an argument
that is a constant, and for callers with other options. Here called functions stay intermediate
code: one version for the types of the arguments, without wrappers, optimised and translated once,
with the function that Python calls. Only what their callers would otherwise simplify at each call
is simplified before, see `early_passes`.

numba has no option for that, so its ways to find a called function and to make a library are
replaced while a function of this package is compiled, under the lock of numba's compiler.
"""

from __future__ import annotations

import gc
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary, WeakSet

from numba.core import codegen, compiler, dispatcher, event, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.typing import templates

from nanorocks_ros.numerics.compilation.early_passes import has_loops, simplify

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_Types = tuple[Any, ...]

COMPILED = 'nanorocks:compile'
"""Event of numba: a version of a function, which compiled functions may call, is compiled."""


# Parts of numba without types.
_without_constants: Any = types.unliteral
_template_of: Any = templates.make_concrete_template
_compile_extra: Any = compiler.compile_extra


class _Library(codegen.JITCodeLibrary):
    """Code of a function that Python calls, and of all that it calls."""

    def _optimize_functions(self, ll_module: Any) -> None:
        """Leave that to the optimisation of the complete code."""

    def _optimize_final_module(self) -> None:
        """Optimise each function by itself, once, and then the complete code.

        Loops over variables that still lie in memory are not vectorised by the second step alone.
        """
        super()._optimize_functions(self._final_module)  # type: ignore[no-untyped-call]
        super()._optimize_final_module()  # type: ignore[no-untyped-call]


class _CalledLibrary(_Library):
    """Intermediate code of a function that compiled functions call, and of those it calls."""

    has_loops = True

    def _optimize_functions(self, ll_module: Any) -> None:
        """Simplify the code once, instead of in every caller."""
        if not self.has_loops:
            simplify(ll_module, self._codegen)

    def _optimize_final_module(self) -> None:
        """Leave that to the function that Python calls."""

    def _finalize_final_module(self) -> None:
        """Let callers link the code; it is not translated."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage.name == 'external':
                function.linkage = 'linkonce_odr'
        self._shared_module = self._final_module
        self._finalized = True


class _Flags(compiler.Flags):
    """Options of a compilation; equal where they give equal code of what numba implements."""

    __slots__ = ('_key',)

    def copy(self) -> _Flags:
        """Options that are equal to these."""
        other = type(self)(self)
        other._key = self._key
        return other

    def settle(self) -> _Flags:
        """The options, which are complete now."""
        self._key = (self.nrt, self.error_model, self.boundscheck, repr(self.fastmath))
        return self

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Flags) and self._key == other._key


class _CalledVersions:
    """The versions of one function that compiled functions call."""

    def __init__(self, function: Any) -> None:
        self._function = function
        self._versions: dict[_Types, tuple[object, Any]] = {}

    def call_template(
        self, args: Sequence[Any], kws: dict[str, Any]
    ) -> tuple[Any, Any, _Types, dict[str, Any]]:
        """What numba asks for to type a call; compiles the version where it is missing."""
        if self._function in _OWN:
            args = tuple(_without_constants(kind) for kind in args)
            kws = {name: _without_constants(kind) for name, kind in kws.items()}
        pysig, folded = self._function.fold_argument_types(args, kws)
        key = tuple(folded)
        if key not in self._versions:
            self._versions[key] = self._compiled(key)
        name = self._function.py_func.__name__
        signatures = [self._versions[key][1]]
        template = _template_of(f'call of {name}', name, signatures)
        return template, pysig, key, {}

    def code(self, args: _Types) -> object:
        """What numba finds the code of a version by."""
        return self._versions[args][0]

    def _compiled(self, args: _Types) -> tuple[object, Any]:
        flags = _flags(self._function)
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        result = _compile(self._function, args, flags, _CalledLibrary)
        key = object()
        self._function.targetctx.insert_user_function(key, result.fndesc, [result.library])
        return key, result.signature


_OWN: WeakSet[Any] = WeakSet()
_CALLED: WeakKeyDictionary[Any, _CalledVersions] = WeakKeyDictionary()


def compile_lean(function: Any) -> None:
    """Compile a function, and what it calls, as one unit.

    Parameters
    ----------
    function : numba dispatcher
    """
    _OWN.add(function)

    def compiled(args: _Types, return_type: Any) -> Any:
        with global_compiler_lock, _methods(function, *_LEAN), _no_collection():
            flags = _flags(function)
            flags.no_cfunc_wrapper = True
            return _compile(function, args, flags, _Library)

    function._compiler.compile = compiled


def _flags(function: Any) -> Any:
    flags_of: Any = _Flags
    flags = flags_of()
    function.targetdescr.options.parse_as_flags(flags, function.targetoptions)
    return flags


def _compile(function: Any, args: _Types, flags: Any, kind: type[_Library]) -> Any:
    context = function.targetctx
    library: Any = kind(context.codegen(), function.py_func.__qualname__)
    library.has_loops = has_loops(function.py_func)
    library.enable_object_caching()
    details = {'dispatcher': function, 'args': args, 'return_type': None}
    with event.trigger_event(COMPILED, data=details):
        return _compile_extra(
            function.typingctx,
            context,
            function.py_func,
            args=args,
            return_type=None,
            flags=flags.settle(),
            locals=function.locals,
            library=library,
        )


def _versions(function: Any) -> _CalledVersions:
    return _CALLED.setdefault(function, _CalledVersions(function))


def _get_call_template(self: Any, args: Sequence[Any], kws: dict[str, Any]) -> Any:
    if _is_recursive(self):
        with _methods(self, *_NUMBA):
            return _GET_CALL_TEMPLATE(self, args, kws)
    return _versions(self).call_template(args, kws)


def _get_overload(self: Any, signature: Any) -> object:
    if _is_recursive(self):
        return _GET_OVERLOAD(self, signature)
    return _versions(self).code(tuple(signature))


def _is_recursive(function: Any) -> bool:
    """Whether a function calls itself: numba resolves such calls in machine code only."""
    code = function.py_func.__code__
    return code.co_name in code.co_freevars or code.co_name in code.co_names


_GET_CALL_TEMPLATE = dispatcher.Dispatcher.get_call_template
_GET_OVERLOAD = dispatcher.Dispatcher.get_overload
_NUMBA = (_GET_CALL_TEMPLATE, _GET_OVERLOAD, codegen.JITCodeLibrary)
_LEAN = (_get_call_template, _get_overload, _CalledLibrary)


@contextmanager
def _methods(function: Any, template: Any, overload: Any, library: Any) -> Iterator[None]:
    """Let numba find called functions, and make libraries, in one of two ways."""
    code = function.targetctx.codegen()
    kind: Any = dispatcher.Dispatcher
    before = kind.get_call_template, kind.get_overload, code._library_class
    kind.get_call_template, kind.get_overload, code._library_class = template, overload, library
    try:
        yield
    finally:
        kind.get_call_template, kind.get_overload, code._library_class = before


@contextmanager
def _no_collection() -> Iterator[None]:
    """Do not look for garbage: a compilation makes many objects, and keeps most."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
