"""Versions of compiled functions as text: which exist in this process, and compiling one by name.

A version is a function and the types of its arguments. numba compiles it when Python first calls
the function with such arguments; by its text it can be compiled before, and in another process.

| text | type |
| --- | --- |
| `float64`, `bool`, `none` | a number, ``None`` |
| `float64[2C]`, `uint8[3A,const]` | a contiguous array of 2 dimensions; a read-only one of 3 |
| `(int64,float64[1C])` | a tuple |
| `module:Name(int64,float64)` | a named tuple |
| `=float64:1.5`, `=none`, `=bool:True` | an argument that is left out, with its default |
"""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from numba.core import types as numba_types
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher

from nanorocks_ros.numerics.compilation.kernel_cache import cache_root

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

# Without types, or with some of them.
types: Any = numba_types
_Dispatcher: Any = Dispatcher

_PACKAGE = 'nanorocks_ros'
_ARRAY = re.compile(r'(\w+)\[(\d+)([ACF])(,const)?\]')
_TOKEN = re.compile(r'=(?:none|\w+:[^,()\s]+)|\w+\[[^\]]*\]|[\w.]+:\w+|\w+|[(),]')


class CompiledVersion(NamedTuple):
    """A function, and the types of its arguments.

    Attributes
    ----------
    module, function : str
    arguments : tuple of str
        See the module.
    """

    module: str
    function: str
    arguments: tuple[str, ...]

    @classmethod
    def of(cls, name: str, function: Any, arguments: Iterable[Any]) -> CompiledVersion:
        """A version of a function of that name, from the numba types of its arguments."""
        module: str = function.py_func.__module__
        return cls(module, name, tuple(map(argument_text, arguments)))

    @classmethod
    def parse(cls, line: str) -> CompiledVersion:
        """The version that a line of `str` names."""
        module, function, *arguments = line.split()
        return cls(module, function, tuple(arguments))

    def __str__(self) -> str:
        return ' '.join((self.module, self.function, *self.arguments))

    @property
    def dispatcher(self) -> Any:
        """The function.

        Raises
        ------
        LookupError
            Where there is no such compiled function.
        """
        function = getattr(import_module(self.module), self.function, None)
        if not isinstance(function, Dispatcher):
            raise LookupError(f'{self.module}.{self.function} is no compiled function')
        return function

    def is_kept(self) -> bool:
        """Whether the version is on disk, compiled for this processor.

        Raises
        ------
        LookupError
            For a function or a type that does not exist.
        """
        function, arguments = self._resolved()
        kept = function._cache
        try:
            index = kept._cache_file._load_index()
            key = kept._index_key(arguments, function.targetctx.codegen())
            return Path(kept._cache_path, index[key]).is_file()
        except (KeyError, OSError, AttributeError):
            # Nothing is kept where no folder can be written.
            return False

    def compile(self) -> None:
        """Load the version, or compile and keep it.

        Raises
        ------
        LookupError
            For a function or a type that does not exist.
        """
        function, arguments = self._resolved()
        function.compile(arguments)

    def _resolved(self) -> tuple[Any, tuple[Any, ...]]:
        return self.dispatcher, tuple(argument_type(text) for text in self.arguments)


def versions_in_use() -> set[CompiledVersion]:
    """All versions that Python called in this process, of functions that are kept on disk."""
    return {
        CompiledVersion.of(name, function, arguments)
        for name, function in _functions(sys.modules)
        for arguments in list(function.overloads)
    }


def versions_on_disk() -> dict[CompiledVersion, int]:
    """All versions that are kept on disk for this state of the code, and their sizes in bytes."""
    modules = {path.name.rpartition('-')[0] for path in cache_root().glob(f'{_PACKAGE}.*')}
    for module in modules:
        import_module(module)
    sizes = {}
    for name, function in _functions(modules):
        kept = function._cache
        for (arguments, *_), file in kept._cache_file._load_index().items():
            version = CompiledVersion.of(name, function, arguments)
            sizes[version] = Path(kept._cache_path, file).stat().st_size
    return sizes


def _functions(modules: Iterable[str]) -> Iterator[tuple[str, Any]]:
    """Names and functions; not those that are compiled into their callers alone."""
    for module_name in list(modules):
        if module_name.partition('.')[0] != _PACKAGE:
            continue
        for name, value in list(vars(sys.modules[module_name]).items()):
            if not isinstance(value, _Dispatcher) or isinstance(value._cache, NullCache):
                continue
            if value.py_func.__module__ == module_name:
                yield name, value


def argument_text(kind: Any) -> str:
    """The text of a numba type.

    Raises
    ------
    LookupError
        For a type that has none.
    """
    if isinstance(kind, types.Array):
        text = f'{kind.dtype}[{kind.ndim}{kind.layout}{"" if kind.mutable else ",const"}]'
    elif isinstance(kind, types.Omitted):
        value = kind.value
        text = '=none' if value is None else f'={type(value).__name__}:{value!r}'
    elif isinstance(kind, types.BaseTuple):
        inner = ','.join(argument_text(member) for member in kind)
        made = getattr(kind, 'instance_class', tuple)
        name = '' if made is tuple else f'{made.__module__}:{made.__qualname__}'
        text = f'{name}({inner})'
    else:
        text = str(kind)
    try:
        found = argument_type(text)
    except (LookupError, ImportError):
        found = None
    if found != kind:
        raise LookupError(f'the numba type {kind} has no text')
    return text


def argument_type(text: str) -> Any:
    """The numba type of a text.

    Raises
    ------
    LookupError
        For a text that names no type.
    """
    tokens = _TOKEN.findall(text)
    if ''.join(tokens) != text:
        raise LookupError(f'{text} names no type')
    tokens.reverse()
    kind = _taken(tokens)
    if tokens:
        raise LookupError(f'{text} names more than a type')
    return kind


def _taken(tokens: list[str]) -> Any:
    """The type that the last tokens name; removes them."""
    token = tokens.pop()
    if token == '(':
        return types.BaseTuple.from_types(_members(tokens))
    if token.startswith('='):
        return types.Omitted(_default(token[1:]))
    if ':' in token:
        module, _, name = token.partition(':')
        made = getattr(import_module(module), name)
        tokens.pop()
        return types.BaseTuple.from_types(_members(tokens), made)
    array = _ARRAY.fullmatch(token)
    if array is not None:
        dtype, dimensions, layout, constant = array.groups()
        return types.Array(_scalar(dtype), int(dimensions), layout, readonly=bool(constant))
    return _scalar(token)


def _members(tokens: list[str]) -> tuple[Any, ...]:
    members = []
    while tokens[-1] != ')':
        members.append(_taken(tokens))
        if tokens[-1] == ',':
            tokens.pop()
    tokens.pop()
    return tuple(members)


def _scalar(name: str) -> Any:
    kind = getattr(types, 'boolean' if name == 'bool' else name, None)
    if not isinstance(kind, types.Type):
        raise LookupError(f'{name} names no type')
    return kind


def _default(text: str) -> Any:
    if text == 'none':
        return None
    name, _, value = text.partition(':')
    readers: dict[str, Callable[[str], Any]] = {
        'bool': lambda word: word == 'True',
        'int': int,
        'float': float,
    }
    return readers[name](value)
