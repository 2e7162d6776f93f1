"""Keeps and loads compiled functions without what only further compilation needs.

numba prepares to compile before it loads a function: it installs all that it implements, and
parses the function's intermediate code, which is there for other compiled functions to call it. A
start that loads sixty functions needed 1 s and 70 MB for that. Here the machine code is loaded
alone, and the intermediate code is parsed when numba asks for it.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from llvmlite import binding
from numba.core import caching, codegen, compiler, environment, runtime

# Parts of numba without types.
_new_library: Any = codegen.CodeLibrary.__init__
_environment_of: Any = environment.Environment
_lookup: Any = environment.lookup_environment
_result_of: Any = compiler.compile_result
_memory: Any = runtime


class _Constants(NamedTuple):
    """Python objects that compiled code refers to, as kept on disk.

    numba keeps the name of a module, too, and imports it: only functions that are not compiled
    look names up there.
    """

    name: str
    module: str
    values: list[Any]

    def environment(self) -> Any:
        """The object of numba that holds them."""
        known = _lookup(self.name)
        if known is not None:
            return known
        made = _environment_of({'__name__': self.module})
        made.consts[:] = self.values
        made.env_name = self.name
        environment.Environment._memo[self.name] = made
        return made


def _constants(holder: Any) -> _Constants:
    return _Constants(holder.env_name, holder.globals['__name__'], list(holder.consts))


class _Code(NamedTuple):
    """Code of a function and of all that it calls."""

    name: str
    machine_code: bytes
    bitcode: bytes


def _code_of(library: Any) -> _Code:
    """The code of a library, whose functions may be linked into several others.

    numba copies the intermediate code before it says so; but it is translated already.
    """
    module = library._final_module
    for function in module.functions:
        if not function.is_declaration and function.linkage == binding.Linkage.external:
            function.linkage = 'linkonce_odr'
    return _Code(library.name, library._get_compiled_object(), module.as_bitcode())


class _Kept(NamedTuple):
    """A compiled version of a function, as kept on disk."""

    code: _Code
    description: Any
    constants: _Constants
    signature: Any
    reload_init: Any
    called: tuple[_Constants, ...]


class _LoadedLibrary(codegen.JITCodeLibrary):
    """Machine code of a function, and its intermediate code, not parsed yet."""

    def __init__(self, owner: Any, kept: _Kept) -> None:
        _new_library(self, owner, kept.code.name)
        self._bitcode = kept.code.bitcode
        self._linking_libraries: list[Any] = []
        self._shared_module: Any = None
        self._disable_inspection = self._finalized = True
        engine = owner._engine
        engine._ee.add_object_file(binding.ObjectFileRef.from_data(kept.code.machine_code))
        described = kept.description
        engine._defined_symbols |= {described.llvm_func_name, described.llvm_cpython_wrapper_name}
        engine.finalize_object()

    @property
    def _final_module(self) -> Any:
        """The code that other functions are compiled with."""
        if self._shared_module is None:
            self._shared_module = binding.parse_bitcode(self._bitcode)
        return self._shared_module


class _Format(caching.CompileResultCacheImpl):
    """What is kept of a compiled version, and how it becomes one again."""

    def reduce(self, result: Any) -> _Kept:
        """What is kept; not the printed types of its variables."""
        described = result.fndesc
        # numba leaves them out as well: they are not needed any more, and may not be picklable.
        described.typemap = described.calltypes = None
        return _Kept(
            code=_code_of(result.library),
            description=described,
            constants=_constants(result.environment),
            signature=result.signature,
            reload_init=result.reload_init,
            called=tuple(map(_constants, result._find_referenced_environments())),
        )

    def rebuild(self, target_context: Any, kept: _Kept) -> Any:
        """The version, ready to be called."""
        for function in kept.reload_init:
            function()
        owner = target_context.codegen()
        library = _LoadedLibrary(owner, kept)
        holder = kept.constants.environment()
        called = [constants.environment() for constants in kept.called]
        for other in called:
            owner.set_env(other.env_name, other)
        return _result_of(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            environment=holder,
            entry_point=target_context.get_executable(library, kept.description, holder),
            fndesc=kept.description,
            type_annotation='',
            signature=kept.signature,
            objectmode=False,
            lifted=(),
            reload_init=kept.reload_init,
            referenced_envs=called,
        )


def use_kernel_cache(dispatcher: Any) -> None:
    """Keep the compiled versions of a function on disk in this way."""
    kept: Any = _Cache
    dispatcher._cache = kept(dispatcher.py_func)


class _Cache(caching.FunctionCache):
    """The compiled versions of one function on disk."""

    _impl_class = _Format

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The version for types of arguments, or None."""
        _add_symbols()
        return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]


@cache
def _add_symbols() -> None:
    """Tell LLVM where the functions are that compiled code calls to get and free memory.

    numba does so when it prepares to compile.
    """
    for name, address in _memory._nrt_python.c_helpers.items():
        binding.add_symbol(name if name.startswith('_') else f'NRT_{name}', address)
