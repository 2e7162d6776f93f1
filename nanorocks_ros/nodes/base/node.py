"""What all nodes of the graph share: parameters, publishers, diagnostics, topic checks.

Tested by ``test/nodes/base/test_diagnostics.py``.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from nanorocks_ros.nodes.base.communication.ros_messages import message_class, qos_of
from nanorocks_ros.nodes.base.communication.topic_monitor import TopicMonitor
from nanorocks_ros.nodes.base.compile_progress import CompileProgress
from nanorocks_ros.nodes.base.diagnostics import Diagnostics
from nanorocks_ros.nodes.base.parameters import NodeParameters
from nanorocks_ros.nodes.base.problems import Level, Problem
from nanorocks_ros.nodes.base.publishing import QOS_OVERRIDES, Outputs
from nanorocks_ros.nodes.base.throttled_callbacks import ThrottledCallbacks
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.subscription import Subscription

    from nanorocks_ros.wire.topics import Topic

_REPORT_S = 1.0


class NanorocksNode(Node):
    """A node under the namespace ``nanorocks``.

    Parameters
    ----------
    name : str

    Attributes
    ----------
    subscribes_later : bool
        Whether the node subscribes to dozens of topics while it runs. It must not use guard
        conditions then: the executor for many subscriptions does not support them.
    parameters : NodeParameters
    outputs : Outputs
    diagnostics : Diagnostics
    topic_monitor : TopicMonitor
    steady_clock : rclpy.clock.Clock
    done : bool
        Whether the node is to end.
    exit_code : int
        Of the process.

    Raises
    ------
    ConfigurationError
        When an override of a quality of service is invalid.
    """

    subscribes_later = False

    def __init__(self, name: str) -> None:
        super().__init__(name, namespace=topics.NAMESPACE.strip('/'))
        self.steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._publisher_events = ThrottledCallbacks()
        self.parameters = NodeParameters(self)
        self.diagnostics = Diagnostics(self)
        self.outputs = Outputs(self, self.diagnostics, self._publisher_events)
        self.topic_monitor = TopicMonitor(self, self.steady_clock)
        self.done = False
        self.exit_code = 0
        self._compile_progress = CompileProgress(self.tell_progress)
        self.create_timer(_REPORT_S, self._report, clock=self.steady_clock)

    def listen(
        self,
        topic: Topic,
        callback: Callable[[Any], object],
        tray: int = 0,
        *,
        required: bool = True,
    ) -> Subscription:
        """Subscribe to a topic; messages are counted, timed, and refused when unusable.

        Parameters
        ----------
        topic : Topic
        callback : callable
            Called with each message; raises FrameError when it is unusable.
        tray : int
        required : bool
            Warn when nobody publishes the topic.
        """
        name = topic.of(tray)
        subscription = self.create_subscription(
            message_class(topic.type),
            name,
            partial(self.diagnostics.process, callback),
            qos_of(topic),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=partial(self.topic_monitor.report_incompatible_qos, name)
            ),
            qos_overriding_options=QOS_OVERRIDES,
        )
        self.topic_monitor.require_type(subscription.topic_name, topic.type)
        if required:
            self.topic_monitor.require_publisher(subscription.topic_name)
        return subscription

    def tell_progress(self, text: str) -> None:
        """Tell what a start that takes long is at; later reports tell the state again."""
        self.get_logger().info(text)
        self.diagnostics.publish([Problem(Level.OK, text)])

    def check_parameters(self) -> None:
        """Refuse unknown parameters, once the node is complete; tell what it does without.

        Raises
        ------
        ConfigurationError
            With the name or the topic that comes nearest.
        """
        self.parameters.refuse_unknown()
        later = topics.TOPICS if self.subscribes_later else (topics.EPOCH, topics.TAKEN)
        names = {
            self.resolve_topic_name(topic.of(tray)) for topic in later for tray in range(1, 9)
        }
        self.parameters.refuse_overrides_of_unknown_topics({*names, '/clock'})
        if self.outputs.untyped:
            self.get_logger().info(self.outputs.untyped)

    def start_recording(self) -> None:
        """Open the recording of a node that makes one; from then on it has to be closed."""

    def interrupt(self) -> None:
        """Stop waiting: the node is to end. Called by a signal, so that it only sets flags."""

    def end_helpers(self) -> None:
        """Ask threads and processes that work for the node to end, and do not wait for it."""

    def end_recording(self) -> None:
        """Close the recording of a node that makes one, also twice."""

    def finish(self) -> None:
        """End the node once the subscriptions have what it published last."""
        self.outputs.wait_until_acknowledged()
        self.done = True

    def destroy_node(self) -> None:
        """Tell no progress any more."""
        self._compile_progress.close()
        super().destroy_node()

    def _report(self) -> None:
        self._publisher_events.open()
        self.diagnostics.publish(self.topic_monitor.problems())
