"""What a node counts and measures of itself, published once a second on ``/diagnostics``."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from nanorocks_ros.errors import FrameError
from nanorocks_ros.records import CorEstimate, Headline, SpeedEstimate, TrayImage
from nanorocks_ros.settings import PriorSettings, priors_in_words

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rclpy.node import Node

_REPEAT_ERROR_S = 5.0
_REPEAT_MISSING_S = 30.0


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
    warning : str
        A problem that does not stop the node; empty: none.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._logged_at: dict[str, float] = {}
        self._processing_s: list[float] = []
        self._last_report = (time.monotonic(), 0)
        self.counts = {'received': 0, 'published': 0, 'refused': 0}
        self.values: dict[str, object] = {}
        self.warning = ''

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
        """Count and log an unusable input; the same text at most once every 5 s."""
        self.counts['refused'] += 1
        text = str(error)
        if self._is_due(text, _REPEAT_ERROR_S):
            self._node.get_logger().error(text)
        self.values['last refusal'] = text

    def report_missing_frames(self, topic: str, count: int) -> None:
        """Log, at most once every 30 s, how many frames are missing so far."""
        self.values['frames missing'] = count
        if self._is_due('frames missing', _REPEAT_MISSING_S):
            self._node.get_logger().warning(
                f'{topic}: {count} frames missing so far (gaps between the time stamps): lost in '
                'transport, or this machine is too slow; follow fewer trays, '
                'see docs/start/doctor.md'
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

    def publish(self, missing_publishers: Sequence[str]) -> None:
        """Publish everything.

        Parameters
        ----------
        missing_publishers : sequence of str
            Topics that the node subscribes to and that nobody publishes.
        """
        status = DiagnosticStatus(name=self._node.get_fully_qualified_name())
        status.level, status.message = self._summary(missing_publishers)
        status.hardware_id = 'nanorocks'
        status.values = [
            KeyValue(key=key, value=str(value))
            for key, value in {**self.counts, **self._timing(), **self.values}.items()
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

    def _summary(self, missing_publishers: Sequence[str]) -> tuple[bytes, str]:
        """Level and text of the most serious problem."""
        if self.counts['refused']:
            return DiagnosticStatus.ERROR, str(self.values['last refusal'])
        if self.warning:
            return DiagnosticStatus.WARN, self.warning
        if missing_publishers:
            return DiagnosticStatus.WARN, f'no publisher on {", ".join(missing_publishers)}'
        return DiagnosticStatus.OK, 'working'
