"""The kinds of input that are damaged."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

KINDS = {
    'bags': 'benchmarks.fuzzing.bag_targets:Bags',
    'salvage': 'benchmarks.fuzzing.bag_targets:Salvage',
    'films': 'benchmarks.fuzzing.file_targets:Films',
    'texts': 'benchmarks.fuzzing.file_targets:Texts',
    'results': 'benchmarks.fuzzing.file_targets:Results',
    'requests': 'benchmarks.fuzzing.page_target:Requests',
}
"""Module and class of each kind."""

SHARES = {'bags': 7, 'texts': 4, 'results': 3, 'films': 3, 'requests': 3, 'salvage': 5}
"""Of 25 mutations, how many are of each kind."""


def target_of(kind: str, folder: Path) -> Any:
    """Something with `run(number)`, which gives an `Outcome`.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    folder : Path
        For its files.
    """
    module, name = KINDS[kind].split(':')
    return getattr(import_module(module), name)(folder)
