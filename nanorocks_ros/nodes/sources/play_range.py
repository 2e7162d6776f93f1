"""The range of a bag that is played, once or in a loop, and what is lost of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.recordings.bag.played_range import played_range
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from rclpy.node import Node

    from nanorocks_ros.recordings.bag.reader import BagReader
    from nanorocks_ros.settings import BagSettings

# Positions are shown in milliseconds, so one beyond an end by less means the end.
_TOLERANCE_NS = NS // 1000


class PlayRange:
    """The range of a bag that is played.

    Parameters
    ----------
    node : rclpy.node.Node
        That logs what is lost.
    reader : BagReader
    settings : BagSettings
    duration : float, [s]
        0: to the end of the bag.

    Attributes
    ----------
    first_ns, last_ns : int, [ns]
        Log times at its ends.

    Raises
    ------
    ConfigurationError
        When the recording ends before the range begins.
    """

    def __init__(
        self, node: Node, reader: BagReader, settings: BagSettings, duration: float
    ) -> None:
        self._node, self._reader = node, reader
        self._loop = settings.loop
        self._logged: set[str] = set()
        self._is_whole = settings.start == 0.0 and duration == 0.0
        self.first_ns, self.last_ns = played_range(reader, settings.start, duration)

    def require(self, names: Collection[str], kind: str) -> None:
        """Refuse a range without anything to play.

        Parameters
        ----------
        names : collection of str
            The topics that are played.
        kind : str
            What their messages are called.

        Raises
        ------
        RecordingError
            When there are no topics, or nothing in the range can be read.
        ConfigurationError
            When the range is empty.
        """
        if next(self._reader.messages(names, self.first_ns, self.last_ns), None) is not None:
            return
        if not names:
            raise RecordingError(
                str(self._reader.path), 'none of its topics can be played', 'pass another bag'
            )
        lost = self._reader.messages_lost
        if lost or self._is_whole:
            damage = f' (at least {lost} messages are lost)' if lost else ''
            raise RecordingError(
                str(self._reader.path),
                f'no {kind} can be read from {self.description}{damage}',
                'play another range or another bag',
            )
        raise ConfigurationError(
            'parameters start and duration',
            f'{self._reader.path} holds no {kind} from {self.description}',
            'give another start or a longer duration',
        )

    def starts(self, first_ns: int | None = None) -> Iterator[int]:
        """Where each pass through the range begins; what is lost is logged after each.

        Parameters
        ----------
        first_ns : int, optional, [ns]
            Where the first pass begins, when not at the beginning of the range.

        Yields
        ------
        int, [ns]
        """
        yield self.first_ns if first_ns is None else first_ns
        self.log_damage()
        while self._loop:
            yield self.first_ns
            self.log_damage()

    def log_damage(self) -> None:
        """Log the notices of the reader, each once."""
        for notice in self._reader.notices:
            if notice not in self._logged:
                self._logged.add(notice)
                self._node.get_logger().warning(notice)

    @property
    def description(self) -> str:
        """Both ends, in seconds since the first message of the bag."""
        return f'{self.seconds(self.first_ns):.3f} to {self.seconds(self.last_ns):.3f} s'

    def stamp_at(self, seconds: float) -> int | None:
        """The log time [ns] of a position since the first message; None outside the range."""
        stamp_ns = self._reader.start_ns + round(seconds * NS)
        inside_ns = min(max(stamp_ns, self.first_ns), self.last_ns)
        return inside_ns if abs(inside_ns - stamp_ns) < _TOLERANCE_NS else None

    def seconds(self, stamp_ns: int) -> float:
        """A log time in seconds since the first message of the bag."""
        return (stamp_ns - self._reader.start_ns) / NS
