"""Viewer layouts and their page name topics that exist, and elements by their field."""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import pytest
import yaml

from nanorocks_ros.records import CorEstimate, CorRelation, CorStatus, Interval
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import to_array

TRAYS = range(1, 9)
ELEMENT = re.compile(r'/nanorocks/tray_(\d)/(\w+)[./]data\[(\d+)\]')
MESSAGES = {
    'speed': 'SpeedEstimate',
    'cluster': 'ClusterEstimate',
    'bodies': 'BodyEstimate',
    'cor': 'CorEstimate',
}
# Label in the layout for Foxglove, title of its plot: topic and field.
CURVES = {
    ('Mean projected speed', 'mean projected speed'): ('speed', 'mean_projected_speed'),
    ('Mean projected speed', 'its standard error'): ('speed', 'mean_projected_speed_error'),
    ('Restitution', 'COR'): ('cor', 'restitution'),
    ('Restitution', 'COR, lower'): ('cor', 'restitution_lower'),
    ('Restitution', 'COR, upper'): ('cor', 'restitution_upper'),
    ('Restitution', 'walls'): ('cor', 'wall_restitution'),
    ('Restitution', 'walls, lower'): ('cor', 'wall_restitution_lower'),
    ('Restitution', 'walls, upper'): ('cor', 'wall_restitution_upper'),
    ('Clusters', 'size, autocorrelation'): ('cluster', 'cluster_size'),
    ('Clusters', 'size, autocorrelation, lower'): ('cluster', 'cluster_size_lower'),
    ('Clusters', 'size, autocorrelation, upper'): ('cluster', 'cluster_size_upper'),
    ('Clusters', 'size, tracks'): ('bodies', 'weighted_size'),
    ('Clusters', 'bodies'): ('bodies', 'bodies'),
    ('Sticking speed', 'sticking speed'): ('cluster', 'sticking_speed'),
    ('Sticking speed', 'sticking speed, lower'): ('cluster', 'sticking_speed_lower'),
    ('Sticking speed', 'sticking speed, upper'): ('cluster', 'sticking_speed_upper'),
}
# Curve of each plot that the tab of the whole plate shows, for every tray.
PLATE_CURVES = {
    'Mean projected speed': ('speed', 'mean_projected_speed'),
    'Restitution': ('cor', 'restitution'),
    'Clusters': ('cluster', 'cluster_size'),
}


@pytest.fixture(scope='module')
def fields(root):
    """Fields of the message definitions, parsed independently of the package."""
    folder = root / 'msg_defs/nanorocks_msgs/msg'
    return {
        topic: re.findall(r'^\w+ ([a-z]\w*) +# \[', (folder / f'{name}.msg').read_text(), re.M)
        for topic, name in MESSAGES.items()
    }


@pytest.fixture(scope='module')
def foxglove(root):
    return json.loads((root / 'foxglove/nanorocks.json').read_text())


@pytest.fixture(scope='module')
def plotjuggler(root):
    return ElementTree.parse(root / 'plotjuggler/nanorocks.xml').getroot()


@pytest.fixture(scope='module')
def page(root):
    return (root / 'docs/use/viewers.md').read_text()


def offered_topics():
    return {topic.absolute(tray): topic for topic in topics.TOPICS for tray in TRAYS}


def field_of(path, fields):
    """Tray, topic and field name of an element such as ``/nanorocks/tray_1/cor.data[4]``."""
    tray, topic, index = ELEMENT.fullmatch(path).groups()
    return int(tray), topic, fields[topic][int(index)]


def plots_of(layout, prefix):
    return [panel for name, panel in layout['configById'].items() if name.startswith(prefix)]


@pytest.mark.parametrize('tray', TRAYS)
def test_foxglove_draws_the_field_that_each_label_names(foxglove, fields, tray):
    plots = plots_of(foxglove, f'Plot!tray{tray}')
    curves = {
        (plot['foxglovePanelTitle'], path['label']): field_of(path['value'], fields)
        for plot in plots
        for path in plot['paths']
    }
    assert curves == {label: (tray, *field) for label, field in CURVES.items()}
    assert all(plot['lichtblickPanelTitle'] == plot['foxglovePanelTitle'] for plot in plots)


def test_the_plate_tab_of_foxglove_draws_each_tray(foxglove, fields):
    for plot in plots_of(foxglove, 'Plot!plate'):
        curves = [(path['label'], field_of(path['value'], fields)) for path in plot['paths']]
        field = PLATE_CURVES[plot['foxglovePanelTitle']]
        assert curves == [(f'tray {tray}', (tray, *field)) for tray in TRAYS]
    assert len(plots_of(foxglove, 'Plot!plate')) == len(PLATE_CURVES)


def test_foxglove_draws_the_value_of_the_restitution(foxglove):
    record = CorEstimate(
        stamp_ns=0,
        tray=1,
        cycle=1,
        status=CorStatus.FINAL,
        relation=CorRelation.LIBRARY,
        restitution=Interval(0.875, 0.75, 0.9375),
    )
    values = to_array(record, 0)
    drawn = {
        path['label']: values[int(ELEMENT.fullmatch(path['value']).group(3))]
        for plot in plots_of(foxglove, 'Plot!tray1')
        if plot['foxglovePanelTitle'] == 'Restitution'
        for path in plot['paths'][:3]
    }
    assert drawn == {'COR': 0.875, 'COR, lower': 0.75, 'COR, upper': 0.9375}


def test_every_panel_of_foxglove_is_in_a_tab(foxglove):
    def panels(node):
        if isinstance(node, str):
            return [node]
        return [*panels(node['first']), *panels(node['second'])]

    tabs = foxglove['configById'][foxglove['layout']]['tabs']
    shown = [foxglove['layout'], *(name for tab in tabs for name in panels(tab['layout']))]
    assert sorted(shown) == sorted(foxglove['configById'])
    assert [tab['title'] for tab in tabs] == ['plate', *(f'tray {tray}' for tray in TRAYS)]


def test_images_of_foxglove_are_image_topics(foxglove):
    offered = offered_topics()
    images = [panel['imageMode']['imageTopic'] for panel in plots_of(foxglove, 'Image!')]
    assert len(images) == len(set(images)) == 2 + 3 * len(TRAYS)
    assert {offered[name].type for name in images} == {topics.IMAGE, topics.COMPRESSED}


@pytest.mark.parametrize(
    'name',
    [
        'foxglove/nanorocks.json',
        'rviz/nanorocks.rviz',
        'plotjuggler/nanorocks.xml',
        'docs/use/viewers.md',
    ],
)
def test_every_topic_is_declared(name, root):
    named = set(re.findall(r'/nanorocks/[\w/]*\w', (root / name).read_text()))
    # PlotJuggler and rqt_plot name an element `topic/data[index]`.
    named = {topic.removesuffix('/data') for topic in named}
    assert named <= set(offered_topics())
    assert len(named) > 3


def test_rviz_subscribes_to_images_with_the_offered_quality_of_service(root):
    content = yaml.safe_load((root / 'rviz/nanorocks.rviz').read_text())
    camera, *groups = content['Visualization Manager']['Displays']
    displays = [camera, *(display for group in groups for display in group['Displays'])]
    offered = offered_topics()
    assert len(displays) == 1 + 3 * len(TRAYS)
    for display in displays:
        assert display['Class'] == 'rviz_default_plugins/Image'
        topic = offered[display['Topic']['Value']]
        assert topic.type == topics.IMAGE
        assert display['Topic']['Reliability Policy'] == 'Reliable'
        assert (display['Topic']['Durability Policy'] == 'Transient Local') == topic.latched


def test_plotjuggler_draws_the_fields_of_each_plot(plotjuggler, fields):
    drawn = set()
    for area in plotjuggler.iter('DockArea'):
        tray, title = re.fullmatch(r'tray (\d): (.*) \[.*\]', area.get('name')).groups()
        for curve in area.iter('curve'):
            drawn.add((int(tray), title, *field_of(curve.get('name'), fields)))
    assert drawn == {
        (tray, title, tray, *field) for tray in TRAYS for (title, _), field in CURVES.items()
    }


def test_plotjuggler_subscribes_to_what_it_draws(plotjuggler):
    subscribed = plotjuggler.find('.//selected_topics').get('value').split(';')
    curves = [curve.get('name') for curve in plotjuggler.iter('curve')]
    assert {name.rpartition('/')[0] for name in curves} == set(subscribed)
    for splitter in plotjuggler.iter('DockSplitter'):
        assert len(splitter) == int(splitter.get('count'))
        assert sum(map(float, splitter.get('sizes').split(';'))) == pytest.approx(1.0)


def test_the_page_lists_every_curve_with_its_element(page, fields):
    rows = re.findall(r'^\| (.+) \| (.+) \| `tray_1/(\w+)` \| `(\w+)` \| (\d+) \|$', page, re.M)
    listed = {(title, label): (topic, field) for title, label, topic, field, _ in rows}
    assert listed == CURVES
    assert all(fields[topic][int(index)] == field for _, _, topic, field, index in rows)


def test_the_page_names_elements_of_the_restitution(page, fields):
    named = {field_of(match.group(), fields) for match in ELEMENT.finditer(page)}
    ends = {f'restitution{end}' for end in ('', '_lower', '_upper')}
    assert named == {(1, 'cor', field) for field in {'time', *ends}}
    sentence = r'element (\d+) is the restitution of the beads,\s+(\d+) and (\d+)\s+are the ends'
    indices = re.search(sentence, page).groups()
    assert [fields['cor'][int(index)] for index in indices] == sorted(ends)
