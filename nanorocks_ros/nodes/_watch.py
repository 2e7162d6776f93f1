"""What is wrong with the topics of a node: nobody publishes, two do, or not as it asks for."""

from __future__ import annotations

from collections import Counter

from nanorocks_ros.nodes._quality import mismatches

_PATIENCE_S = 5.0
_ONE_CAMERA = 'end all but one, or give each a namespace of its own (-r __ns:=/NAME)'
# A publisher is seen before the node that it belongs to; so often that is waited for.
_NOT_YET, _LOOKS = '_NODE_NAME_UNKNOWN_', 5


class Watch:
    """Looks after the topics of a node, and says once what is wrong.

    Parameters
    ----------
    node : NanorocksNode

    Attributes
    ----------
    expected : list of str
        Topics that somebody has to publish.
    """

    def __init__(self, node):
        self._node = node
        self._alone = {}
        self._unnamed = Counter()
        self.expected = []
        self._once(self._check_clock)

    def _once(self, check):
        """Check something after a while, once."""

        def look():
            timer.cancel()
            check()

        timer = self._node.create_timer(_PATIENCE_S, look, clock=self._node.steady_clock)

    def _say(self, text):
        self._node.get_logger().warning(text)

    def expect(self, name):
        """Say so when nobody publishes a topic."""
        self.expected.append(name)
        self._once(lambda: self._check_publishers(name))

    def alone_on(self, name, remedy=_ONE_CAMERA):
        """Say so when more than one node publishes a topic: what they send would be mixed."""
        self._alone[name] = remedy

    def missing(self):
        """The expected topics that nobody publishes now."""
        return [name for name in self.expected if self._node.count_publishers(name) == 0]

    def look(self):
        """Check who publishes what only one should."""
        for name, remedy in list(self._alone.items()):
            full = self._node.resolve_topic_name(name)
            if self._node.count_publishers(full) < 2:
                continue
            infos = self._node.get_publishers_info_by_topic(full)
            if any(info.node_name == _NOT_YET for info in infos) and self._unnamed[name] < _LOOKS:
                self._unnamed[name] += 1
                continue
            del self._alone[name]
            nodes = sorted(f'{info.node_namespace.rstrip("/")}/{info.node_name}' for info in infos)
            self._say(
                f'{full}: {" and ".join(nodes)} publish it, and what they send is mixed; {remedy}'
            )

    def mismatch(self, name, _):
        """Say what a publisher offers and this node asks for."""
        full = self._node.resolve_topic_name(name)
        offered = [one.qos_profile for one in self._node.get_publishers_info_by_topic(full)]
        asked = [
            one.qos_profile
            for one in self._node.get_subscriptions_info_by_topic(full)
            if one.node_name == self._node.get_name()
        ]
        found = mismatches(offered, asked)
        said = ', '.join(f'{policy} {have} and I ask for {want}' for policy, have, want in found)
        remedies = ', '.join(f'qos_overrides.{full}.subscription.{one[0]}' for one in found)
        self._say(f'{full}: no data, since the publisher offers {said}; set {remedies}')

    def _check_publishers(self, name):
        if self._node.count_publishers(name) == 0:
            self._say(
                f'{name}: no publisher within {_PATIENCE_S:g} s; start one, remap the topic, or '
                'check the namespace and ROS_DOMAIN_ID'
            )

    def _check_clock(self):
        clock = self._node.get_clock()
        if clock.ros_time_is_active and clock.now().nanoseconds == 0:
            self._say(
                f'/clock: nothing within {_PATIENCE_S:g} s, though use_sim_time is set, and time '
                'stands still; start bag_player (or ros2 bag play --clock), or set '
                'use_sim_time:=false'
            )
