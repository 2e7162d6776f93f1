"""Where compiled functions are kept: once for each machine and state of the code, for all users.

numba keeps them beside the source, so that every installation, environment and clone compiled for
a minute. Here the folder is named by what is compiled: the text of the module and of all modules
of its package that it imports. Equal code is found again wherever it is installed; other code is
in another folder.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.numerics.compilation.compile_lock import compile_once

if TYPE_CHECKING:
    from collections.abc import Callable

# Imports at the left margin; those for the type checker alone are indented and not compiled.
_IMPORT = re.compile(rb'^(?:from|import) ([\w.]+)', re.MULTILINE)
# How functions are compiled and kept; imported by a function, and not where numba does both.
_COMPILER = (
    'nanorocks_ros.numerics.compilation.lean_compilation',
    'nanorocks_ros.numerics.compilation.kernel_loading',
)
_DAY_S = 86_400.0
# Folders of code that was not used for so long are removed, [s].
_UNUSED_S = 30.0 * _DAY_S


def cache_root() -> Path:
    """The folder of all compiled functions: that of numba, where it is told, or of the user."""
    told = os.environ.get('NUMBA_CACHE_DIR')
    if told:
        return Path(told)
    caches = os.environ.get('XDG_CACHE_HOME')
    return (Path(caches) if caches else Path.home() / '.cache') / 'nanorocks_ros' / 'kernels'


class SharedCache:
    """The compiled versions of a function on disk, in the folder of its code.

    It is made when Python calls the function: most functions are called by compiled ones alone.
    Where the folder cannot be made, they stay where numba keeps them.

    Parameters
    ----------
    dispatcher : numba dispatcher
        Its cache is replaced by this one.
    module : str
        Name of the module of the function.
    enable : callable
        Gives the dispatcher a cache of numba.
    """

    def __init__(self, dispatcher: Any, module: str, enable: Callable[[Any], None]) -> None:
        self._dispatcher, self._module, self._enable = dispatcher, module, enable
        # Read now: a file that is changed later is not what was imported.
        self._code = code_key(module)
        dispatcher._cache = self

    def __getattr__(self, name: str) -> Any:
        """What numba asks a cache for, of the one that is made now."""
        return getattr(self._made(), name)

    def _made(self) -> Any:
        if self._dispatcher._cache is self:
            # The doctor asks for the folder where numba may be missing.
            from numba.core.caching import NullCache

            self._dispatcher._cache = NullCache()
            # numba does not cache if neither the package nor the home is writable; one that keeps
            # its cache in another way keeps it where it wants to.
            with suppress(RuntimeError, AttributeError):
                self._enable(self._dispatcher)
                _share(self._dispatcher, self._module, self._code)
        return self._dispatcher._cache


def _share(dispatcher: Any, module: str, code: str) -> None:
    """Keep the compiled versions of a function in the folder of its code."""
    from numba.core.caching import IndexDataCacheFile

    own = dispatcher._cache
    try:
        folder = _folder(module, code)
    except (OSError, RuntimeError):
        # numba checks the file of the function only, but called functions and constants are
        # compiled into it: after an update its cache would mix old and new code.
        file = own._cache_file
    else:
        own._cache_path = str(folder)
        file = own._cache_file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            cache_path=str(folder), filename_base=own._impl.filename_base, source_stamp=code
        )
        compile_once(dispatcher, folder)
    # numba compares the version before it unpickles an index: unpickling fails when the module of
    # an argument's type has been moved.
    file._version = (file._version, code)


@cache
def code_key(module: str) -> str:
    """A short hash of a module, of all of its package that it imports, and of the compiler."""
    package = module.partition('.')[0]
    texts: dict[str, bytes] = {}
    pending = [module, *_COMPILER]
    while pending:
        name = pending.pop()
        path = getattr(sys.modules.get(name), '__file__', None)
        if name in texts or path is None:
            continue
        text, imports = _source(path)
        texts[name] = text
        pending += [other for other in imports if other.partition('.')[0] == package]
    total = hashlib.sha256()
    for name in sorted(texts):
        total.update(name.encode() + b'\0' + texts[name])
    return total.hexdigest()[:16]


@cache
def _source(path: str) -> tuple[bytes, tuple[str, ...]]:
    """Hash of a file, and the modules that it imports."""
    try:
        content = Path(path).read_bytes()
    except OSError:
        return b'', ()
    imports = tuple(name.decode() for name in _IMPORT.findall(content))
    return hashlib.sha256(content).digest(), imports


@cache
def _folder(module: str, code: str) -> Path:
    """The folder of a module, made where it is missing; old ones of the module are removed."""
    root = cache_root()
    folder = root / f'{module}-{code}'
    now = time.time()
    if folder.is_dir():
        if now - folder.stat().st_mtime > _DAY_S:
            # Other users' folders cannot be touched, but used.
            with suppress(OSError):
                os.utime(folder)
        return folder
    folder.mkdir(parents=True)
    for other in root.glob(f'{module}-*'):
        if now - other.stat().st_mtime > _UNUSED_S:
            shutil.rmtree(other, ignore_errors=True)
    return folder
