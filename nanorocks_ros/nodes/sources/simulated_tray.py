"""One simulated tray as a source of frames, with the true state of its beads.

Tested by ``test/nodes/test_graph.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.nodes.base.communication.ros_messages import image_message
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.records import Frame, GroundTruth
    from nanorocks_ros.settings import SimulationSettings


class TrayMoment(NamedTuple):
    """A frame of a simulated tray and what is true of it."""

    frame: Frame
    truth: GroundTruth


class SimulatedTray:
    """Simulated frames, stamped from the time when the first is sent.

    Compiling takes seconds, and listeners may have to be waited for: a stamp taken before
    would make every frame look late.

    Parameters
    ----------
    node : NanorocksNode
    simulation : SimulationSettings
    trays_file : str
        Empty: the trays of the experiment.
    """

    def __init__(
        self, node: NanorocksNode, simulation: SimulationSettings, trays_file: str
    ) -> None:
        self._node = node
        self._start_ns: int | None = None
        tray = tray_by_number(load_trays(trays_file), simulation.tray)
        # Compile what the first shaking event needs, or the frames after it would be late.
        for _ in film(replace(simulation, first_shake=0.0), tray, 2):
            pass
        self._film = film(simulation, tray)

    def moments(self) -> Iterator[tuple[int, TrayMoment]]:
        """Stamp from 0 [ns] and each moment."""
        for frame, truth in self._film:
            yield frame.stamp_ns, TrayMoment(frame, truth)

    def stamped(self, moment: TrayMoment) -> TrayMoment:
        """The moment with stamps of the node's clock."""
        if self._start_ns is None:
            self._start_ns = self._node.get_clock().now().nanoseconds - moment.frame.stamp_ns
        return TrayMoment(
            replace(moment.frame, stamp_ns=moment.frame.stamp_ns + self._start_ns),
            replace(moment.truth, stamp_ns=moment.truth.stamp_ns + self._start_ns),
        )

    def publish(self, moment: TrayMoment, epoch_ns: int) -> None:
        """Publish the frame, if anybody subscribes, and the truth."""
        publish_frame(self._node, moment.frame)
        self._node.outputs.publish_result(moment.truth, epoch_ns)


def publish_frame(node: NanorocksNode, frame: Frame) -> None:
    """Publish a frame on the camera topic, if anybody subscribes."""
    if node.outputs.has_subscribers(topics.RAW):
        message = image_message(frame.stamp_ns, 'camera', frame.image, frame.encoding)
        node.outputs.send(topics.RAW, message)
