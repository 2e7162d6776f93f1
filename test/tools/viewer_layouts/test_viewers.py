"""Layouts of viewers name what is published, at the place where it is."""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import pytest
import yaml

from nanorocks_ros.records import (
    CorEstimate,
    CorRelation,
    CorStatus,
    Interval,
)
from nanorocks_ros.tools.docs_pages.wire_pages import FILES
from nanorocks_ros.tools.viewer_layouts.foxglove import foxglove
from nanorocks_ros.tools.viewer_layouts.plotjuggler import plotjuggler
from nanorocks_ros.tools.viewer_layouts.rviz import rviz
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import to_array

ELEMENT = re.compile(r'/nanorocks/tray_(\d)/(\w+)[./]data\[(\d+)\]')
MESSAGES = {
    'speed': 'SpeedEstimate',
    'cluster': 'ClusterEstimate',
    'bodies': 'BodyEstimate',
    'cor': 'CorEstimate',
}


@pytest.fixture(scope='module')
def fields(root):
    """Names in the message definitions, read in another way than the package does."""
    folder = root / 'msg_defs/nanorocks_msgs/msg'
    return {
        topic: re.findall(r'^float32 ([a-z]\w*) ', (folder / f'{name}.msg').read_text(), re.M)
        for topic, name in MESSAGES.items()
    }


def plots(layout):
    return {name: one for name, one in layout['configById'].items() if name.startswith('Plot!')}


def field_of(path, fields):
    tray, topic, place = ELEMENT.fullmatch(path).groups()
    return int(tray), topic, fields[topic][int(place)]


def test_foxglove_plots_the_restitution_of_each_tray_with_its_interval(fields):
    layout = json.loads(foxglove())
    for tray in range(1, 9):
        (chart,) = (
            plot
            for name, plot in plots(layout).items()
            if name.startswith(f'Plot!tray{tray}') and plot['foxglovePanelTitle'] == 'Restitution'
        )
        found = [field_of(path['value'], fields) for path in chart['paths']]
        assert found == [
            (tray, 'cor', f'{what}{end}')
            for what in ('restitution', 'wall_restitution')
            for end in ('', '_lower', '_upper')
        ]


def test_the_element_that_is_plotted_holds_the_restitution():
    record = CorEstimate(
        stamp_ns=0,
        tray=1,
        cycle=1,
        status=CorStatus.FINAL,
        relation=CorRelation.LIBRARY,
        restitution=Interval(0.875, 0.75, 0.9375),
    )
    values = to_array(record, 0)
    found = {
        path['label']: values[int(ELEMENT.fullmatch(path['value']).group(3))]
        for name, chart in plots(json.loads(foxglove())).items()
        if name.startswith('Plot!tray1') and chart['foxglovePanelTitle'] == 'Restitution'
        for path in chart['paths'][:3]
    }
    assert found == {'COR': 0.875, 'COR, lower': 0.75, 'COR, upper': 0.9375}


def test_every_panel_of_foxglove_has_a_place():
    layout = json.loads(foxglove())

    def named(place):
        if isinstance(place, str):
            return [place]
        return [*named(place['first']), *named(place['second'])]

    tabs = layout['configById'][layout['layout']]['tabs']
    shown = [layout['layout'], *(name for tab in tabs for name in named(tab['layout']))]
    assert sorted(shown) == sorted(layout['configById'])
    assert [tab['title'] for tab in tabs] == ['plate', *(f'tray {k}' for k in range(1, 9))]


@pytest.mark.parametrize('name', ['foxglove/nanorocks.json', 'docs/use/viewers.md'])
def test_pictures_and_arrays_are_topics_of_the_graph(name):
    known = {topic.absolute(tray) for topic in topics.TOPICS for tray in range(1, 9)}
    named = set(re.findall(r'/nanorocks/[\w/]*\w', FILES[name]()))
    assert named - known <= {'/nanorocks/tray_1/cor/data'}  # as rqt_plot names elements
    assert len(named) > 3


def test_rviz_asks_for_pictures_as_they_are_offered():
    manager = yaml.safe_load(rviz())['Visualization Manager']
    camera, *groups = manager['Displays']
    displays = [camera, *(one for group in groups for one in group['Displays'])]
    offered = {one.absolute(tray): one for one in topics.TOPICS for tray in range(1, 9)}
    assert len(displays) == 1 + 8 * 3
    for display in displays:
        assert display['Class'] == 'rviz_default_plugins/Image'
        topic = offered[display['Topic']['Value']]
        assert topic.type == topics.IMAGE
        assert display['Topic']['Reliability Policy'] == 'Reliable'
        assert (display['Topic']['Durability Policy'] == 'Transient Local') == topic.latched


def test_plotjuggler_plots_named_elements_of_topics_that_it_subscribes_to(fields):
    root = ElementTree.fromstring(plotjuggler())
    subscribed = root.find('.//selected_topics').get('value').split(';')
    curves = [curve.get('name') for curve in root.iter('curve')]
    assert {field_of(name, fields)[:2] for name in curves} == {
        (tray, topic) for tray in range(1, 9) for topic in MESSAGES
    }
    assert {name.rpartition('/')[0] for name in curves} == set(subscribed)
    for splitter in root.iter('DockSplitter'):
        assert len(splitter) == int(splitter.get('count'))
        assert sum(map(float, splitter.get('sizes').split(';'))) == pytest.approx(1.0)
