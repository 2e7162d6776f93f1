"""The folder of compiled functions: where it is, and what it is named by.

That code is found there again, and no old code, is tested by ``test_compiled.py``.
"""

from __future__ import annotations

import sys

import pytest

from nanorocks_ros.numerics.compilation.kernel_cache import cache_root, code_key


def test_the_folder_is_that_of_numba_where_it_is_told_or_of_the_user(monkeypatch, tmp_path):
    monkeypatch.setenv('HOME', str(tmp_path))
    monkeypatch.delenv('NUMBA_CACHE_DIR', raising=False)
    monkeypatch.delenv('XDG_CACHE_HOME', raising=False)
    assert cache_root() == tmp_path / '.cache' / 'nanorocks_ros' / 'kernels'
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'kept'))
    assert cache_root() == tmp_path / 'kept' / 'nanorocks_ros' / 'kernels'
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'told'))
    assert cache_root() == tmp_path / 'told'


@pytest.fixture
def keyed(tmp_path, monkeypatch):
    """Return a function: the key of a module that imports another, with these texts."""
    count = iter(range(10))

    def key(module, imported):
        package = f'keyed_{next(count)}'
        folder = tmp_path / package
        folder.mkdir()
        (folder / '__init__.py').touch()
        (folder / 'imported.py').write_text(imported)
        (folder / 'module.py').write_text(f'from {package}.imported import X\n{module}')
        monkeypatch.syspath_prepend(str(tmp_path))
        __import__(f'{package}.module')
        # Of another package nothing is the same, not even the name: only these texts may differ.
        for name in ('', '.module', '.imported'):
            sys.modules[f'keyed{name}'] = sys.modules.pop(package + name)
        text = (folder / 'module.py').read_text().replace(package, 'keyed')
        (folder / 'module.py').write_text(text)
        code_key.cache_clear()
        return code_key('keyed.module')

    yield key
    for name in ('', '.module', '.imported'):
        sys.modules.pop(f'keyed{name}', None)
    code_key.cache_clear()


def test_equal_texts_have_equal_keys_and_other_texts_others(keyed):
    first = keyed('Y = 1\n', 'X = 1\n')
    assert keyed('Y = 1\n', 'X = 1\n') == first
    assert keyed('Y = 2\n', 'X = 1\n') != first
    assert keyed('Y = 1\n', 'X = 2\n') != first
