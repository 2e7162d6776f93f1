"""The reference of the Python interface: everything that a package exports, for Sphinx."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType


def exported_names(module: ModuleType) -> list[str]:
    """Public names of a module: those of ``__all__``, else all that it defines."""
    if hasattr(module, '__all__'):
        return list(module.__all__)
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith('_') and getattr(value, '__module__', None) == module.__name__
    ]


def python_page(module: ModuleType) -> str:
    """The body of the page: a directive of autodoc for each exported name.

    Parameters
    ----------
    module : module
        `nanorocks_ros`

    Returns
    -------
    str
        Markdown with reStructuredText inside.
    """
    return '\n'.join(_entry(module, name) for name in exported_names(module))


def _entry(module: ModuleType, name: str) -> str:
    value = getattr(module, name)
    target = f'{module.__name__}.{name}'
    if inspect.isclass(value):
        members = '' if issubclass(value, BaseException) else '\n   :members:'
        directive = f'.. autoclass:: {target}{members}'
    elif inspect.isroutine(value):
        directive = f'.. autofunction:: {target}'
    elif inspect.ismodule(value):
        directive = f'.. automodule:: {value.__name__}\n   :members:'
    else:
        directive = f'.. autodata:: {target}\n   :no-value:'
    return f'## {name}\n\n```{{eval-rst}}\n{directive}\n```\n'
