"""One tree of exceptions: each says where, what, and what to do about it, in one line.

Tested by ``test/nodes/base/test_diagnostics.py``.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path


class NanorocksError(Exception):
    """An input that cannot be used, as one sentence: ``where: what; do``.

    Parameters
    ----------
    where : str
        The file, topic or parameter at fault, as the user would name it.
    what : str
        The fact, with the offending value and what was expected.
    do : str
        The remedy.
    """

    def __init__(self, where: str, what: str, do: str) -> None:
        super().__init__(where, what, do)
        self.where = where
        self.what = what
        self.do = do

    def __str__(self) -> str:
        return f'{self.where}: {self.what}; {self.do}'


class ConfigurationError(NanorocksError):
    """A parameter, option or configuration file that cannot be used."""


class RecordingError(NanorocksError):
    """A bag or video that cannot be read or written."""


class UnwritableError(RecordingError):
    """Results for which there is no room, or no permission."""


class FrameError(NanorocksError):
    """A camera frame that cannot be used: encoding, size, stamp."""


class FitError(NanorocksError):
    """Data to which the model cannot be fitted."""


class SimulationError(NanorocksError):
    """A gas that cannot be prepared or followed."""


class DashboardError(NanorocksError):
    """A live page that cannot be served: its address, its port."""


def did_you_mean(word: str, known: Iterable[str] | Mapping[str, str]) -> str:
    """A question with the words nearest to one that is not known; empty where none is near.

    Parameters
    ----------
    word : str
        As the user wrote it.
    known : iterable of str, or mapping of str to str
        All words that are known; of a mapping the values are proposed.
    """
    from difflib import get_close_matches

    proposed = known if isinstance(known, Mapping) else {name: name for name in known}
    # The dashes of all options are alike.
    by_letters = {name.casefold().lstrip('-'): proposal for name, proposal in proposed.items()}
    nearest = get_close_matches(word.casefold().lstrip('-'), by_letters, n=2, cutoff=0.7)
    proposals = dict.fromkeys(by_letters[name] for name in nearest)
    return f'did you mean {" or ".join(proposals)}?' if proposals else ''


def did_you_mean_file(path: Path) -> str:
    """A question with the files beside a missing one whose names are nearest; empty if none is."""
    beside: dict[str, str] = {}
    with suppress(OSError):
        names = [entry.name for entry in path.parent.iterdir() if not entry.name.startswith('.')]
        beside = {name: shlex.quote(str(path.with_name(name))) for name in names}
    return did_you_mean(path.name, beside)
