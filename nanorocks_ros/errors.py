"""One tree of exceptions: each says where, what, and what to do about it, in one line.

Tested by ``test/nodes/base/test_diagnostics.py``.
"""

from __future__ import annotations


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
