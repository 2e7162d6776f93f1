"""The one writer of figures: drawn in the one style, complete or not at all.

Tested by ``test/outputs/test_figure_files.py``.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.outputs.command_line import command_line, program_name

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

PICTURES = ('.png', '.pdf', '.svg')
"""Suffixes of figures: pixels for a page, vectors for a journal."""


@contextmanager
def figure_file(
    path: Path | None, width: float, height: float, command: str | None = None
) -> Iterator[Figure]:
    """An empty figure to draw on, which is written when the block ends.

    Parameters
    ----------
    path : Path or None
        ``.png`` (200 dpi), ``.pdf`` or ``.svg`` (with their fonts); a file there is replaced.
        None: the figure is drawn and not written.
    width, height : float, [mm]
    command : str, optional
        Written into the file with the version; by default that of this process.

    Yields
    ------
    Figure
        With the layout of `constrained`, in the style of `figure_style`.

    Raises
    ------
    ConfigurationError
        For another suffix, before anything is drawn.
    RecordingError
        When the file cannot be written.
    """
    if path is not None:
        check_picture(path)
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from nanorocks_ros.outputs.figure_style import STYLE, inches

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=inches(width, height), layout='constrained')
        yield figure
        if path is None:
            return
        told = command or command_line() or program_name()
        with atomic_file(path) as part:
            figure.savefig(part, metadata=_metadata(path.suffix, told))


def check_picture(path: Path, flag: str = 'figure') -> None:
    """Raise for a suffix that no figure has.

    Raises
    ------
    ConfigurationError
    """
    if path.suffix not in PICTURES:
        raise ConfigurationError(
            flag, f'{path} ends in none of {", ".join(PICTURES)}', 'name such a file'
        )


def _metadata(suffix: str, command: str) -> dict[str, str]:
    """Version and command, in the words of the format."""
    version = f'nanorocks_ros {__version__}'
    if suffix == '.pdf':
        return {'Creator': version, 'Subject': command}
    if suffix == '.svg':
        return {'Creator': version, 'Description': command}
    return {'Software': version, 'Description': command}
