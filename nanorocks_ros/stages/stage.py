"""The protocol of a stage, and the one place that notices when time went back."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Generic, Protocol, TypeVar


class Stamped(Protocol):
    """A record of an instant."""

    @property
    def stamp_ns(self) -> int:
        """The instant, [ns]."""


Taken = TypeVar('Taken', bound=Stamped)
Given = TypeVar('Given', covariant=True)
_Taken_contra = TypeVar('_Taken_contra', contravariant=True)


class Stage(Protocol[_Taken_contra, Given]):
    """A step from records to records; it neither reads a clock nor knows of ROS."""

    def push(self, record: _Taken_contra, /) -> tuple[Given, ...]:
        """Take the next record; returns the records that became known with it."""

    def flush(self) -> tuple[Given, ...]:
        """Everything that is held back, at the end of the recording."""

    def reset(self, stamp_ns: int | None = None) -> None:
        """Start afresh, at a stamp that time went back to, [ns], if there is one."""


class RestartingStage(ABC, Generic[Taken, Given]):
    """A stage that starts afresh when time goes back: a recording that loops, or a seek.

    A subclass names the records by which it tells the time in `clock`. A record of that kind
    whose stamp is not later than the one before resets the stage; records of other kinds may
    come in any order.
    """

    clock: ClassVar[type | tuple[type, ...]]
    _last_ns: int | None = None

    def push(self, record: Taken, /) -> tuple[Given, ...]:
        """Take the next record; returns the records that became known with it."""
        interrupted: tuple[Given, ...] = ()
        if isinstance(record, self.clock):
            if self._last_ns is not None and record.stamp_ns <= self._last_ns:
                interrupted = self._interrupted()
                self.reset(record.stamp_ns)
            self._last_ns = record.stamp_ns
        return (*interrupted, *self._process(record))

    def flush(self) -> tuple[Given, ...]:
        """Everything that is held back, at the end of the recording."""
        return ()

    def reset(self, stamp_ns: int | None = None) -> None:
        """Start afresh.

        Parameters
        ----------
        stamp_ns : int, [ns], optional
            The stamp that time went back to. Records that arrived ahead of it, with a stamp no
            later, belong to the new start and are kept.
        """
        self._last_ns = None
        self._restart(stamp_ns)

    @abstractmethod
    def _process(self, record: Taken) -> tuple[Given, ...]:
        """Take a record that continues the ones before, or is the first."""

    @abstractmethod
    def _restart(self, stamp_ns: int | None = None) -> None:
        """Forget all records; see `reset`."""

    def _interrupted(self) -> tuple[Given, ...]:
        """The results that are given out when time goes back; the others are dropped."""
        return ()
