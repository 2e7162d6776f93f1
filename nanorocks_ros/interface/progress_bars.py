"""Progress bars: in a terminal, and in a notebook."""

from __future__ import annotations

import sys
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from nanorocks_ros.jobs.progress import Progress

_FORMAT = '{desc}: {percentage:3.0f} %|{bar}| {elapsed}, {remaining} left'


@contextmanager
def part_bar(label: str, *, shown: bool) -> Iterator[Callable[[float], None]]:
    """A bar that is told the part that is done, 0 to 1.

    Parameters
    ----------
    label : str
    shown : bool
        Whether to show it where somebody may look: in a notebook, or on a terminal.
    """
    if not (shown and (_in_notebook() or sys.stderr.isatty())):
        yield lambda _: None
        return
    with warnings.catch_warnings():
        # Without ipywidgets the bar is text.
        warnings.simplefilter('ignore')
        from tqdm.auto import tqdm
    bar: Any = tqdm(total=1.0, desc=label, delay=1.0, leave=False, bar_format=_FORMAT)
    try:
        yield lambda done: bar.update(done - bar.n)
    finally:
        bar.close()


@contextmanager
def count_bar(label: str, *, shown: bool) -> Iterator[Progress]:
    """As `part_bar`, told the steps that are done and their number."""
    with part_bar(label, shown=shown) as show:
        yield lambda done, total: show(done / max(total, 1))


def _in_notebook() -> bool:
    """Whether a Jupyter kernel runs this."""
    # Whoever runs a kernel has imported it.
    module = sys.modules.get('IPython')
    shell = None if module is None else module.get_ipython()
    return hasattr(shell, 'kernel')
