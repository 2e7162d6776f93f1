"""What every node of the graph shares: parameters, diagnostics, publishers, refusals."""

from __future__ import annotations

import time
from functools import partial

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Header

from nanorocks_ros.errors import ConfigurationError, FrameError, NanorocksError
from nanorocks_ros.nodes._names import on_the_command_line, require_text, unknown_parameters
from nanorocks_ros.nodes._now_and_then import NowAndThen
from nanorocks_ros.nodes._overrides import refuse_unheard_overrides, refuse_wrong_overrides
from nanorocks_ros.nodes._shell import (
    array_message,
    image_message,
    message_class,
    qos_of,
    time_message,
)
from nanorocks_ros.nodes._watch import Watch
from nanorocks_ros.records import (
    Autocorrelation,
    BodyEstimate,
    ClusterEstimate,
    CorEstimate,
    GroundTruth,
    Merge,
    MotionMask,
    Notice,
    PairCollision,
    Rebound,
    SpeedEstimate,
    TrayImage,
)
from nanorocks_ros.settings import rows, with_current_names, with_values
from nanorocks_ros.wire import topics

_ARRAYS = {
    SpeedEstimate: topics.SPEED,
    ClusterEstimate: topics.CLUSTER,
    CorEstimate: topics.COR,
    Rebound: topics.REBOUND,
    PairCollision: topics.COLLISION,
    BodyEstimate: topics.BODIES,
    Merge: topics.MERGE,
    GroundTruth: topics.TRUTH,
}
_IMAGES = {
    TrayImage: ((topics.GRAY, 'gray'), (topics.RECTIFIED, 'color')),
    MotionMask: ((topics.MOTION, 'mask'),),
    Autocorrelation: ((topics.AUTOCORRELATION, 'values'),),
}
RESULT_TOPICS = (
    *_ARRAYS.values(),
    topics.STATE,
    topics.TRACKS,
    *(topic for both in _IMAGES.values() for topic, _ in both),
)
_OVERRIDABLE = QoSOverridingOptions(
    policy_kinds=(
        QoSPolicyKind.HISTORY,
        QoSPolicyKind.DEPTH,
        QoSPolicyKind.RELIABILITY,
        QoSPolicyKind.DURABILITY,
    )
)
_BUILT_AROUND = {'trays', 'trays_file'}
_THROTTLE_S = 5.0
_MISSING_S = 30.0
_CONNECTED_S = 0.1
# Acknowledgements come with heartbeats, every 3 s.
_FAREWELL_S = 3.5


class NanorocksNode(Node):
    """A node under the namespace ``nanorocks`` that keeps count of what it does.

    Attributes
    ----------
    hears_much : bool
        Whether there are dozens of topics that it listens to, and no guard condition.
    """

    hears_much = False

    def __init__(self, name):
        super().__init__(name, namespace=topics.NAMESPACE.strip('/'))
        refuse_wrong_overrides(self._parameter_overrides)
        self.steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._outputs = {}
        self._events = NowAndThen()
        self._declared = {}
        self._said = {}
        self.done = False
        self.exit_code = 0
        self.counts = {'received': 0, 'published': 0, 'refused': 0}
        self.busy_s = []
        self.state = {}
        # Whether images are published, too.
        self.pictures = True
        # Whoever wants to keep what is sent.
        self.recorder = None
        # What is wrong, but keeps nothing from going on.
        self.trouble = ''
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._last_report = (time.monotonic(), 0)
        self.create_timer(1.0, self._report, clock=self.steady_clock)
        self.watch = Watch(self)

    # Parameters

    def declare(self, settings, prefix='', fixed=True):
        """Declare every setting as a parameter; the settings with the values it was given.

        Those that the node is built around, `fixed` and the trays, are read-only afterwards.
        """
        values = {}
        where = f'node {self.get_name()}'
        overrides = self._parameter_overrides
        self._parameter_overrides, messages = with_current_names(
            settings, overrides, where, prefix
        )
        for message in messages:
            self.get_logger().warning(message)
        for row in rows(settings):
            name = prefix + row.name
            try:
                read_only = fixed or row.name in _BUILT_AROUND
                values[row.name] = self._declare_one(name, row, read_only)
            except ParameterException as error:
                raise ConfigurationError(
                    f'parameter {name}',
                    str(error).split('Reason: ')[-1],
                    'see docs/reference/parameters.md',
                ) from error
            if isinstance(row.default, str) and not row.bounds.choices:
                require_text(name, values[row.name])
        checked = with_values(settings, values, where)
        self._declared.update({prefix + row.name: row for row in rows(settings)})
        return checked

    def refuse_unknown_parameters(self):
        """Refuse a name that nobody reads, rather than go on without what was meant.

        A file may serve the whole graph: what other nodes read may stand in it.

        Raises
        ------
        ConfigurationError
            With the name that comes nearest.
        """
        given = [name for name in self._parameter_overrides if not self.has_parameter(name)]
        problems = unknown_parameters(given, self._declared)
        if problems:
            raise ConfigurationError(
                f'node {self.get_name()}', '; '.join(problems), 'see docs/reference/parameters.md'
            )

    def refuse_unheard_overrides(self):
        """Refuse, of the command line, what overrides a topic that this node does not have.

        To be called when all topics are there but those that come later.

        Raises
        ------
        ConfigurationError
            With the topic that comes nearest.
        """
        known = topics.TOPICS if self.hears_much else (topics.EPOCH, topics.TAKEN)
        late = {self.resolve_topic_name(topic.of(k)) for topic in known for k in range(1, 9)}
        given = on_the_command_line().keys() & self._parameter_overrides.keys()
        refuse_unheard_overrides(given, self._parameters, {*late, '/clock'})

    def _declare_one(self, name, row, read_only):
        # Typed by the default, but 13500 in a YAML file has to do for 13500.0.
        descriptor = ParameterDescriptor(
            description=f'{row.doc} [{row.unit}]' if row.unit else row.doc,
            additional_constraints=', '.join(row.bounds.choices),
            dynamic_typing=True,
            read_only=read_only,
        )
        if isinstance(row.default, float):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=row.bounds.low, to_value=row.bounds.high)
            ]
        elif isinstance(row.default, int) and not isinstance(row.default, bool):
            descriptor.integer_range = [
                IntegerRange(from_value=int(row.bounds.low), to_value=int(row.bounds.high))
            ]
        default = list(row.default) if isinstance(row.default, tuple) else row.default
        # rclpy cannot tell the type of an empty list: such a parameter is not set by default.
        value = self.declare_parameter(name, None if default == [] else default, descriptor).value
        return default if value is None else value

    def react_to_parameters(self, settings, build, adopt):
        """Try every later change on new stages; keep the old ones when it cannot be used.

        Parameters
        ----------
        settings : dataclass of settings
            As declared.
        build : callable
            Makes the stages from settings; raises NanorocksError when it cannot.
        adopt : callable
            Takes the settings and what `build` made of them.
        """
        proposal = []

        def check(parameters):
            ours = [parameter for parameter in parameters if parameter.name in self._declared]
            try:
                values = {row.name: self.get_parameter(row.name).value for row in rows(settings)}
                values.update({one.name: one.value for one in ours})
                known = {name: value for name, value in values.items() if value is not None}
                changed = with_values(settings, known, 'parameters')
                proposal[:] = [(changed, build(changed))]
            except NanorocksError as error:
                return SetParametersResult(successful=False, reason=str(error))
            return SetParametersResult(successful=True)

        def changed(parameters):
            # A new publisher declares its quality of service as parameters: not our business.
            if any(parameter.name in self._declared for parameter in parameters):
                adopt(*proposal[0])
                self.get_logger().info('the parameters changed; starting afresh')

        self.add_on_set_parameters_callback(check)
        self.add_post_set_parameters_callback(changed)

    # Topics

    def output(self, topic, tray=0):
        """The publisher of a topic, made once."""
        name = topic.of(tray)
        if name not in self._outputs:
            self.publisher(message_class(topic.type), name, qos_of(topic))
        return self._outputs[name]

    def publisher(self, kind, name, qos):
        """Make the publisher of a topic under any name, offered in any way."""
        self._outputs[name] = self.create_publisher(
            kind, name, qos, callback_group=self._events, qos_overriding_options=_OVERRIDABLE
        )
        return self._outputs[name]

    def offer(self, offered, tray=0):
        """Make the publishers of some topics."""
        for topic in offered:
            self.output(topic, tray)

    def others_offer(self, topic):
        """Whether another node publishes a topic."""
        return self.count_publishers(topic.name) > int(topic.name in self._outputs)

    def wanted(self, topic, tray=0):
        """Whether anybody subscribes to a topic; images are not even built otherwise."""
        return self.output(topic, tray).get_subscription_count() > 0

    def send(self, topic, message, tray=0):
        """Publish and count."""
        self.output(topic, tray).publish(message)
        self.counts['published'] += 1
        if self.recorder is not None:
            self.recorder.result(topic, message, tray)

    def publish_result(self, record, epoch_ns):
        """Publish what came out of a stage on the topics it belongs to."""
        if isinstance(record, Notice):
            self.get_logger().warning(record.text)
        elif type(record) in _ARRAYS:
            message = array_message(record, epoch_ns)
            self.send(_ARRAYS[type(record)], message, record.tray)
        else:
            if isinstance(record, TrayImage):
                self.send(topics.STATE, array_message(record.state(), epoch_ns), record.tray)
            for topic, field in _IMAGES[type(record)]:
                pixels = getattr(record, field)
                if pixels is not None and self.pictures and self.wanted(topic, record.tray):
                    frame_id = f'tray_{record.tray}'
                    message = image_message(record.stamp_ns, frame_id, pixels)
                    self.send(topic, message, record.tray)
        if isinstance(record, SpeedEstimate | TrayImage):
            self.state[f'tray {record.tray} quality'] = ', '.join(record.quality.names()) or 'good'
        if isinstance(record, SpeedEstimate):
            method = record.method.name.lower().replace('_', ' ')
            speed = f'{1e3 * record.mean_projected_speed:.3f} mm/s by {method}'
            if record.quality:
                speed += f' ({", ".join(record.quality.names())})'
            self.state[f'tray {record.tray} speed'] = speed
        if isinstance(record, CorEstimate):
            name = f'tray {record.tray} COR'
            self.state[name] = f'{record.restitution:.4f} {record.status.name.lower()}'

    def tell_what_is_taken(self, inputs):
        """Offer `camera/taken` once all inputs are connected: then this node can be counted on.

        Parameters
        ----------
        inputs : list of rclpy.subscription.Subscription
        """

        def look():
            if all(one.get_publisher_count() for one in inputs):
                timer.cancel()
                self.offer((topics.TAKEN,))

        timer = self.create_timer(_CONNECTED_S, look, clock=self.steady_clock)

    def taken(self, stamp_ns):
        """Tell who waits for it that this node is done with a frame."""
        if topics.TAKEN.name in self._outputs and self.wanted(topics.TAKEN):
            message = Header(
                stamp=time_message(stamp_ns), frame_id=self.get_fully_qualified_name()
            )
            self.send(topics.TAKEN, message)

    def listen(self, topic, callback, tray=0, required=True):
        """Subscribe; say so when nobody publishes, or not with a matching quality of service."""
        subscription = self.create_subscription(
            message_class(topic.type),
            topic.of(tray),
            partial(self.timed, callback),
            qos_of(topic),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=partial(self.watch.mismatch, topic.of(tray))
            ),
            qos_overriding_options=_OVERRIDABLE,
        )
        if required:
            self.watch.expect(subscription.topic_name)
        return subscription

    def timed(self, work, message):
        """Do the work on one input, count it, and refuse it when it cannot be used."""
        start = time.perf_counter()
        self.counts['received'] += 1
        try:
            work(message)
        except FrameError as error:
            self.refuse(error)
        self.busy_s.append(time.perf_counter() - start)

    def finish(self):
        """End the node once what it published last has arrived."""
        end = time.monotonic() + _FAREWELL_S
        for publisher in self._outputs.values():
            if publisher.get_subscription_count() > 0:
                left = max(0.0, end - time.monotonic())
                publisher.wait_for_all_acked(Duration(nanoseconds=int(1e9 * left)))
        self.done = True

    def refuse(self, error):
        """Say what was wrong with an input, once in a while, and go on."""
        self.counts['refused'] += 1
        text = str(error)
        if self._due(text, _THROTTLE_S):
            self.get_logger().error(text)
        self.state['last refusal'] = text

    def _due(self, what, pause_s):
        """Whether something was not said for a while, and is now."""
        now = time.monotonic()
        due = now - self._said.get(what, -pause_s) >= pause_s
        if due:
            self._said[what] = now
        return due

    def tell_missing(self, topic, count):
        """Say, once in a while, how many frames did not come so far."""
        self.state['frames missing'] = count
        if self._due('frames missing', _MISSING_S):
            self.get_logger().warning(
                f'{topic}: {count} frames missing so far, by their stamps: lost on the way, or '
                'this machine is too slow; follow fewer trays, see docs/start/doctor.md'
            )

    # Diagnostics

    def _report(self):
        self._events.open()
        self.watch.look()
        now = time.monotonic()
        since, received = self._last_report
        rate = (self.counts['received'] - received) / max(now - since, 1e-9)
        self._last_report = (now, self.counts['received'])
        busy, self.busy_s = self.busy_s, []
        values = {
            **self.counts,
            'rate [1/s]': f'{rate:.2f}',
            'processing, mean [ms]': f'{1e3 * sum(busy) / len(busy):.2f}' if busy else '',
            'processing, longest [ms]': f'{1e3 * max(busy):.2f}' if busy else '',
            **self.state,
        }
        missing = self.watch.missing()
        level, text = DiagnosticStatus.OK, 'working'
        if missing:
            level, text = DiagnosticStatus.WARN, f'no publisher on {", ".join(missing)}'
        if self.trouble:
            level, text = DiagnosticStatus.WARN, self.trouble
        if self.counts['refused']:
            level, text = DiagnosticStatus.ERROR, self.state['last refusal']
        status = DiagnosticStatus(level=level, name=self.get_fully_qualified_name(), message=text)
        status.hardware_id = 'nanorocks'
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)
