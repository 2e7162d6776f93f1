"""Two publishers of one topic are named once, as soon as it is known who they are."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.nodes._watch import Watch


class Graph:
    """What a node knows of the graph, where `/clock` is remapped."""

    steady_clock = None

    def __init__(self):
        self.publishers = []
        self.said = []

    def create_timer(self, *_, **__):
        return None

    def get_logger(self):
        return SimpleNamespace(warning=self.said.append)

    def resolve_topic_name(self, name):
        return '/a' + name

    def count_publishers(self, name):
        return len(self.publishers) if name == '/a/clock' else 0

    def get_publishers_info_by_topic(self, _):
        return [
            SimpleNamespace(node_namespace=space, node_name=name)
            for space, name in self.publishers
        ]


def test_two_publishers_are_named_once_under_the_name_that_they_publish():
    graph = Graph()
    watch = Watch(graph)
    watch.alone_on('/clock', 'end one')
    graph.publishers = [('/a', 'player')]
    watch.look()
    assert not graph.said
    graph.publishers.append(('/', 'other'))
    watch.look()
    watch.look()
    said = '/a/clock: /a/player and /other publish it, and what they send is mixed; end one'
    assert graph.said == [said]


def test_a_publisher_whose_node_is_not_known_yet_is_waited_for_but_not_for_ever():
    graph = Graph()
    watch = Watch(graph)
    watch.alone_on('/clock', 'end one')
    unknown = ('_NODE_NAMESPACE_UNKNOWN_', '_NODE_NAME_UNKNOWN_')
    graph.publishers = [('/a', 'player'), unknown]
    watch.look()
    assert not graph.said
    for _ in range(10):
        watch.look()
    assert len(graph.said) == 1
