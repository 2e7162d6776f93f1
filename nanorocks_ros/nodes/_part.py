"""The part of a bag that is played, once or again and again, and what is missing of it."""

from __future__ import annotations

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.nodes._pace import NS
from nanorocks_ros.recordings.bag.played_range import played_range

_TOLD_NS = NS // 1000


class Part:
    """The part of a bag that is played.

    Parameters
    ----------
    node : NanorocksNode
        That tells what is missing.
    reader : BagReader
    settings : BagSettings
    duration : float, [s]
        0: to the end of the bag.

    Attributes
    ----------
    first_ns, last_ns : int, [ns]
        Log times between which it lies.

    Raises
    ------
    ConfigurationError
        When the recording is over before it begins.
    """

    def __init__(self, node, reader, settings, duration):
        self._node, self._reader = node, reader
        self._loop = settings.loop
        self._told = set()
        self._whole = settings.start == 0.0 and duration == 0.0
        self.first_ns, self.last_ns = played_range(reader, settings.start, duration)

    def require(self, names, kind):
        """Refuse a part in which there is nothing to play.

        Parameters
        ----------
        names : collection of str
            The topics that are played.
        kind : str
            What their messages are called.

        Raises
        ------
        RecordingError
            When nothing that is there can be read, or there are no topics.
        ConfigurationError
            When nothing is there.
        """
        if next(self._reader.messages(names, self.first_ns, self.last_ns), None) is not None:
            return
        if not names:
            raise RecordingError(
                str(self._reader.path), 'none of its topics can be played', 'pass another bag'
            )
        where = self.where
        lost = self._reader.messages_lost
        if lost or self._whole:
            damage = f' (at least {lost} messages are lost)' if lost else ''
            raise RecordingError(
                str(self._reader.path),
                f'no {kind} can be read from {where}{damage}',
                'play another part or another bag',
            )
        raise ConfigurationError(
            'parameters start and duration',
            f'{self._reader.path} holds no {kind} from {where}',
            'give another start or a longer duration',
        )

    def turns(self, first_ns=None):
        """Where each turn begins; what is missing is told after each.

        Parameters
        ----------
        first_ns : int, optional, [ns]
            Where the first one does, when not at the beginning of the part.

        Yields
        ------
        int, [ns]
        """
        yield self.first_ns if first_ns is None else first_ns
        self.tell_missing()
        while self._loop:
            yield self.first_ns
            self.tell_missing()

    def tell_missing(self):
        """Say what the reader says of the bag, each sentence once."""
        for notice in self._reader.notices:
            if notice not in self._told:
                self._told.add(notice)
                self._node.get_logger().warning(notice)

    @property
    def where(self):
        """From when to when it goes, in seconds since the first message of the bag."""
        return f'{self.seconds(self.first_ns):.3f} to {self.seconds(self.last_ns):.3f} s'

    def stamp_at(self, seconds):
        """The log time [ns] so long after the first message of the bag; None beyond the part.

        Times are told to the millisecond: who asks for one a bit beyond an end means the end.
        """
        stamp_ns = self._reader.start_ns + round(seconds * NS)
        placed_ns = min(max(stamp_ns, self.first_ns), self.last_ns)
        return placed_ns if abs(placed_ns - stamp_ns) < _TOLD_NS else None

    def seconds(self, stamp_ns):
        """A log time in seconds since the first message of the bag."""
        return (stamp_ns - self._reader.start_ns) / NS
