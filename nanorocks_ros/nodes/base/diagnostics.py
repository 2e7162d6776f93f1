"""What a node counts and measures of itself, published once a second on ``/diagnostics``."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes.base.problems import FRAMES_LOST, Level, Losses, Problem, Refusals
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.records import CorEstimate, Headline, SpeedEstimate, TrayImage
from nanorocks_ros.settings import PriorSettings, priors_in_words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rclpy.node import Node

_FASTER = (
    "take JPEGs (transport:='compressed'), follow fewer trays, or give the graph more workers"
)
_REPEAT_ERROR_S = 5.0
_REPEAT_MISSING_S = 30.0
# Numbers in a message: stamps and sizes differ from frame to frame.
_NUMBER = re.compile(r'\d+')
_LEVELS = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.ERROR: DiagnosticStatus.ERROR,
}


class Diagnostics:
    """Counts, processing times and problems of a node.

    Parameters
    ----------
    node : rclpy.node.Node

    Attributes
    ----------
    counts : dict of str to int
        Messages received, published and refused.
    values : dict of str to object
        Further values to publish, by name.
    watched : list of callable
        Each gives a `Problem` that the node has now, or None.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._logged_at: dict[str, float] = {}
        self._processing_s: list[float] = []
        self._last_report = (time.monotonic(), 0)
        self.counts = {'received': 0, 'published': 0, 'refused': 0}
        self.values: dict[str, object] = {}
        self._refusals, self._missing = Refusals(), Losses()
        self.watched: list[Callable[[], Problem | None]] = [
            self._refusals.problem,
            self._missing_frames,
        ]

    def process(self, work: Callable[[Any], object], message: Any) -> None:
        """Call `work(message)`, measure how long it takes, and refuse an unusable message."""
        start = time.perf_counter()
        self.counts['received'] += 1
        try:
            work(message)
        except FrameError as error:
            self.refuse(error)
        self._processing_s.append(time.perf_counter() - start)

    def refuse(self, error: FrameError) -> None:
        """Count and log an unusable input; alike ones at most once every 5 s."""
        self.counts['refused'] += 1
        text = str(error)
        self._refusals.add(text)
        if self._is_due(_NUMBER.sub('0', text), _REPEAT_ERROR_S):
            self._node.get_logger().error(text)
        self.values['last refusal'] = text

    def report_missing_frames(self, topic: str, missing: int, count: int) -> None:
        """Log, at most once every 30 s, how many frames are missing so far.

        Parameters
        ----------
        topic : str
        missing : int
            Number of frames before the last one.
        count : int
            Number so far.
        """
        self._missing.add(missing)
        self.values['frames missing'] = count
        if self._is_due('frames missing', _REPEAT_MISSING_S):
            self._node.get_logger().warning(
                f'{topic}: {counted(count, "frame")} missing so far (gaps between the time '
                f'stamps): lost in transport, or this machine is too slow; {_FASTER}'
            )

    def _missing_frames(self) -> Problem | None:
        rate = self._missing.rate()
        if rate == 0.0:
            return None
        return Problem(
            Level.WARN,
            f'{rate:.1f} frames/s are missing: lost in transport, or this machine is too slow; '
            f'{_FASTER}',
            FRAMES_LOST,
        )

    def _is_due(self, text: str, pause_s: float) -> bool:
        """Whether a text was not logged during the pause; from now on it was."""
        now = time.monotonic()
        due = now - self._logged_at.get(text, -pause_s) >= pause_s
        if due:
            self._logged_at[text] = now
        return due

    def note_result(self, record: object) -> None:
        """Keep quality, speed and COR of a tray for the next report."""
        if isinstance(record, SpeedEstimate | TrayImage):
            quality = ', '.join(record.quality.names()) or 'good'
            self.values[f'tray {record.tray} quality'] = quality
        if isinstance(record, SpeedEstimate):
            method = record.method.name.lower().replace('_', ' ')
            speed = f'{1e3 * record.mean_projected_speed.value:.3f} mm/s by {method}'
            if record.quality:
                speed += f' ({", ".join(record.quality.names())})'
            self.values[f'tray {record.tray} speed'] = speed
        if isinstance(record, CorEstimate):
            cor = f'{record.restitution.value:.4f} {record.status.name.lower()}'
            if record.headline is Headline.CONTACTS:
                cor += ' by contacts alone'
            self.values[f'tray {record.tray} COR'] = cor

    def note_priors(self, prior: PriorSettings) -> None:
        """Keep what the node assumes of restitutions, for the next reports."""
        self.values['priors'] = priors_in_words(prior)

    def publish(self, of_topics: Iterable[Problem]) -> None:
        """Publish everything.

        Parameters
        ----------
        of_topics : iterable of Problem
            With the topics of the node.
        """
        status = DiagnosticStatus(name=self._node.get_fully_qualified_name())
        own = [problem for watched in self.watched if (problem := watched()) is not None]
        # The most serious first, of equal ones the first.
        problems = sorted([*own, *of_topics], key=lambda problem: -problem.level)
        worst = problems[0] if problems else Problem(Level.OK, 'working')
        status.level, status.message = _LEVELS[worst.level], worst.text
        further = {
            f'problem {number}': problem.text for number, problem in enumerate(problems[1:], 2)
        }
        alarms = {f'alarm: {problem.alarm}': problem.text for problem in problems if problem.alarm}
        status.hardware_id = 'nanorocks'
        status.values = [
            KeyValue(key=key, value=str(value))
            for key, value in {
                **self.counts,
                **self._timing(),
                **self.values,
                **further,
                **alarms,
            }.items()
        ]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _timing(self) -> dict[str, str]:
        """Message rate and processing times since the last report."""
        now = time.monotonic()
        last_report, received_before = self._last_report
        received = self.counts['received']
        rate = (received - received_before) / max(now - last_report, 1e-9)
        self._last_report = (now, received)
        seconds, self._processing_s = self._processing_s, []
        mean = f'{1e3 * sum(seconds) / len(seconds):.2f}' if seconds else ''
        longest = f'{1e3 * max(seconds):.2f}' if seconds else ''
        return {
            'rate [1/s]': f'{rate:.2f}',
            'processing, mean [ms]': mean,
            'processing, longest [ms]': longest,
        }
