"""What an interrupted command says: what is kept, and how to go on."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def interruption_says(message: Callable[[], str] | str) -> Iterator[None]:
    """Give an interruption of the block a text.

    Ctrl-C in a call between Python and compiled code arrives as a SystemError, and in the middle
    of a file as an error of its format: both count, since a KeyboardInterrupt caused them.

    Parameters
    ----------
    message : str or callable
        What is kept and how to go on; a callable is called when the block was interrupted.

    Raises
    ------
    KeyboardInterrupt
        With the text, for any exception that an interruption caused.
    """
    try:
        yield
    except BaseException as error:
        if not _was_interrupted(error):
            raise
        raise KeyboardInterrupt(message if isinstance(message, str) else message()) from None


def _was_interrupted(error: BaseException) -> bool:
    """Whether an exception, or one that it came from, is an interruption."""
    earlier: BaseException | None = error
    while earlier is not None:
        if isinstance(earlier, KeyboardInterrupt):
            return True
        earlier = earlier.__cause__ or earlier.__context__
    return False
