"""What other viewers are told to show: layouts for Foxglove, RViz and PlotJuggler.

``python -m nanorocks_ros.study.reference`` writes them. The elements of the arrays are looked up
in their layouts by name, so that no viewer draws a number it takes for another.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import yaml

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import BodyEstimate, ClusterEstimate, CorEstimate, SpeedEstimate
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.layouts import layout

if TYPE_CHECKING:
    from nanorocks_ros.wire.layouts import ArrayRecord
    from nanorocks_ros.wire.topics import Topic

_RECORDS: dict[Topic, type[ArrayRecord]] = {
    topics.SPEED: SpeedEstimate,
    topics.CLUSTER: ClusterEstimate,
    topics.BODIES: BodyEstimate,
    topics.COR: CorEstimate,
}
_BLUE, _RED, _GREEN, _GRAY = '#1f77b4', '#d62728', '#2ca02c', '#7f7f7f'
_LINE, _BAND = 2.0, 1.0
_ONE_CYCLE_S = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One field of one array, as a curve.

    Parameters
    ----------
    topic : Topic
    field : str
        Name in the layout of the record.
    label : str
    color : str
    width : float, [px]
    """

    topic: Topic
    field: str
    label: str
    color: str
    width: float = _LINE


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Curves over one axis.

    Parameters
    ----------
    title : str
    unit : str
        Of the vertical axis.
    curves : tuple of Curve
    low, high : float or None
        Ends of the vertical axis where they are the same for every recording.
    """

    title: str
    unit: str
    curves: tuple[Curve, ...]
    low: float | None = None
    high: float | None = None


def _interval(topic: Topic, field: str, label: str, color: str) -> tuple[Curve, ...]:
    ends = (
        Curve(
            topic=topic, field=f'{field}_{end}', label=f'{label}, {end}', color=color, width=_BAND
        )
        for end in ('lower', 'upper')
    )
    return (Curve(topic=topic, field=field, label=label, color=color), *ends)


CHARTS = (
    Chart(
        title='Mean projected speed',
        unit='m/s',
        curves=(
            Curve(
                topic=topics.SPEED,
                field='mean_projected_speed',
                label='mean projected speed',
                color=_BLUE,
            ),
            Curve(
                topic=topics.SPEED,
                field='mean_projected_speed_error',
                label='its standard error',
                color=_GRAY,
                width=_BAND,
            ),
        ),
        low=0.0,
    ),
    Chart(
        title='Restitution',
        unit='1',
        curves=(
            *_interval(topics.COR, 'restitution', 'COR', _RED),
            *_interval(topics.COR, 'wall_restitution', 'walls', _GRAY),
        ),
        low=0.5,
        high=1.0,
    ),
    Chart(
        title='Clusters',
        unit='beads, bodies',
        curves=(
            *_interval(topics.CLUSTER, 'cluster_size', 'size, autocorrelation', _BLUE),
            Curve(topic=topics.BODIES, field='weighted_size', label='size, tracks', color=_GREEN),
            Curve(topic=topics.BODIES, field='bodies', label='bodies', color=_GRAY),
        ),
        low=0.0,
    ),
    Chart(
        title='Sticking speed',
        unit='m/s',
        curves=_interval(topics.CLUSTER, 'sticking_speed', 'sticking speed', _GREEN),
        low=0.0,
    ),
)
PICTURES = (topics.TRACKS, topics.MOTION, topics.AUTOCORRELATION)


def element(topic: Topic, field: str) -> int:
    """The place of a field in the array of a topic."""
    names = [one.name for one in layout(_RECORDS[topic]).fields]
    return names.index(field)


def message_path(tray: int, curve: Curve) -> str:
    """A curve as Foxglove names it, such as ``/nanorocks/tray_1/cor.data[4]``."""
    return f'{curve.topic.absolute(tray)}.data[{element(curve.topic, curve.field)}]'


def series(tray: int, curve: Curve) -> str:
    """A curve as PlotJuggler and rqt_plot name it, such as ``/nanorocks/tray_1/cor/data[4]``."""
    return message_path(tray, curve).replace('.', '/')


# Foxglove


class _Panels:
    """The panels of a layout, by the names that they get."""

    def __init__(self) -> None:
        self.by_name: dict[str, Any] = {}

    def add(self, kind: str, name: str, content: dict[str, Any]) -> str:
        panel = f'{kind}!{name}'
        self.by_name[panel] = content
        return panel

    def image(self, name: str, topic: str) -> str:
        # Foxglove and its open sibling keep titles under names of their own.
        title = dict.fromkeys(('foxglovePanelTitle', 'lichtblickPanelTitle'), topic)
        return self.add('Image', name, {**title, 'imageMode': {'imageTopic': topic}})

    def plot(self, name: str, chart: Chart, trays: tuple[int, ...]) -> str:
        paths = [
            {
                'value': message_path(tray, curve),
                'enabled': True,
                'timestampMethod': 'receiveTime',
                'label': curve.label if len(trays) == 1 else f'tray {tray}',
                'showLine': True,
                'lineSize': curve.width,
                **({'color': curve.color} if len(trays) == 1 else {}),
            }
            for tray in trays
            for curve in chart.curves
        ]
        limits = {'minYValue': chart.low, 'maxYValue': chart.high}
        content = {
            'foxglovePanelTitle': chart.title,
            'lichtblickPanelTitle': chart.title,
            'paths': paths,
            'showXAxisLabels': True,
            'showYAxisLabels': True,
            'showLegend': True,
            # Above the plot it would leave no room for curves.
            'legendDisplay': 'left',
            'showPlotValuesInLegend': True,
            'isSynced': True,
            'xAxisVal': 'timestamp',
            'yAxisLabel': chart.unit,
            'sidebarDimension': 300,
            **{key: value for key, value in limits.items() if value is not None},
        }
        return self.add('Plot', name, content)


def _beside(direction: str, parts: list[Any]) -> Any:
    """Parts of the same size, in a row or a column."""
    if len(parts) == 1:
        return parts[0]
    return {
        'direction': direction,
        'first': parts[0],
        'second': _beside(direction, parts[1:]),
        'splitPercentage': 100.0 / len(parts),
    }


def _tray_tab(panels: _Panels, tray: int) -> Any:
    pictures = [
        panels.image(f'tray{tray}{topic.name.rpartition("/")[2]}', topic.absolute(tray))
        for topic in PICTURES
    ]
    plots = [
        panels.plot(f'tray{tray}chart{number}', chart, (tray,))
        for number, chart in enumerate(CHARTS)
    ]
    return {
        'direction': 'row',
        'first': _beside('column', pictures),
        'second': _beside('column', plots),
        'splitPercentage': 30.0,
    }


def _plate_tab(panels: _Panels, trays: tuple[int, ...]) -> Any:
    camera = [
        panels.image('camera', topics.RAW.absolute()),
        panels.image('cameracompressed', topics.RAW_COMPRESSED.absolute()),
    ]
    diagnostics = {
        'minLevel': 0,
        'pinnedIds': [],
        'topicToRender': '/diagnostics',
        'hardwareIdFilter': '',
        'sortByLevel': True,
    }
    plots = [
        panels.plot(
            f'plate{number}',
            Chart(
                title=chart.title,
                unit=chart.unit,
                curves=chart.curves[:1],
                low=chart.low,
                high=chart.high,
            ),
            trays,
        )
        for number, chart in enumerate(CHARTS[:3])
    ]
    return {
        'direction': 'row',
        'first': _beside('column', [*camera, panels.add('DiagnosticSummary', 'all', diagnostics)]),
        'second': _beside('column', plots),
        'splitPercentage': 40.0,
    }


def foxglove() -> str:
    """The layout for Foxglove and Lichtblick: a tab for the plate, and one for each tray."""
    trays = tuple(load_trays())
    panels = _Panels()
    tabs = [{'title': 'plate', 'layout': _plate_tab(panels, trays)}]
    tabs += [{'title': f'tray {tray}', 'layout': _tray_tab(panels, tray)} for tray in trays]
    first_tray = 1
    whole = panels.add('Tab', 'trays', {'activeTabIdx': first_tray, 'tabs': tabs})
    content = {
        'configById': panels.by_name,
        'globalVariables': {},
        'userNodes': {},
        'playbackConfig': {'speed': 1},
        'layout': whole,
    }
    return json.dumps(content, indent=1) + '\n'


# RViz


def _rviz_image(topic: Topic, tray: int, *, enabled: bool) -> dict[str, Any]:
    lowest = -1 if topic is topics.AUTOCORRELATION else 0
    return {
        'Class': 'rviz_default_plugins/Image',
        'Enabled': enabled,
        'Value': enabled,
        'Name': topic.of(tray),
        'Normalize Range': False,
        'Min Value': lowest,
        'Max Value': 1,
        'Median window': 5,
        'Topic': {
            'Depth': 5,
            'Durability Policy': 'Transient Local' if topic.latched else 'Volatile',
            'History Policy': 'Keep Last',
            # What is offered is reliable; best effort would lose most frames of 1080p.
            'Reliability Policy': 'Reliable',
            'Value': topic.absolute(tray),
        },
    }


def rviz() -> str:
    """The configuration for RViz 2: the camera and the pictures of tray 1; the others unticked."""
    groups = [
        {
            'Class': 'rviz_common/Group',
            'Enabled': tray == 1,
            'Value': tray == 1,
            'Name': f'tray {tray}',
            'Displays': [_rviz_image(topic, tray, enabled=tray == 1) for topic in PICTURES],
        }
        for tray in load_trays()
    ]
    content = {
        'Panels': [{'Class': 'rviz_common/Displays', 'Name': 'Displays'}],
        'Visualization Manager': {
            'Class': '',
            'Displays': [_rviz_image(topics.RAW, 0, enabled=True), *groups],
            'Enabled': True,
            'Global Options': {
                'Background Color': '48; 48; 48',
                'Fixed Frame': 'camera',
                'Frame Rate': 30,
            },
            'Name': 'root',
            'Tools': [{'Class': 'rviz_default_plugins/MoveCamera'}],
            'Value': True,
            'Views': {
                'Current': {
                    'Class': 'rviz_default_plugins/Orbit',
                    'Name': 'Current View',
                    'Value': 'Orbit (rviz)',
                },
                'Saved': None,
            },
        },
        'Window Geometry': {'Width': 1400, 'Height': 900},
    }
    return str(yaml.safe_dump(content, sort_keys=False, default_flow_style=False))


# PlotJuggler


def plotjuggler() -> str:
    """The layout for PlotJuggler: a tab for each tray, its charts from top to bottom."""
    root = ElementTree.Element('root')
    tabbed = ElementTree.SubElement(
        root, 'tabbed_widget', {'parent': 'main_window', 'name': 'Main Window'}
    )
    trays = tuple(load_trays())
    for tray in trays:
        tab = ElementTree.SubElement(
            tabbed, 'Tab', {'containers': '1', 'tab_name': f'tray {tray}'}
        )
        container = ElementTree.SubElement(tab, 'Container')
        share = ';'.join(f'{1.0 / len(CHARTS):g}' for _ in CHARTS)
        splitter = ElementTree.SubElement(
            container,
            'DockSplitter',
            {'orientation': '-', 'count': str(len(CHARTS)), 'sizes': share},
        )
        for chart in CHARTS:
            _plotjuggler_chart(splitter, tray, chart)
    ElementTree.SubElement(tabbed, 'currentTabIndex', {'index': '0'})
    _plotjuggler_streamer(root, trays)
    ElementTree.indent(root, ' ')
    return ElementTree.tostring(root, encoding='unicode', xml_declaration=True) + '\n'


def _plotjuggler_chart(parent: ElementTree.Element, tray: int, chart: Chart) -> None:
    area = ElementTree.SubElement(
        parent, 'DockArea', {'name': f'tray {tray}: {chart.title} [{chart.unit}]'}
    )
    plot = ElementTree.SubElement(
        area,
        'plot',
        {'mode': 'TimeSeries', 'style': 'Lines', 'flip_x': 'false', 'flip_y': 'false'},
    )
    low, high = (0.0 if chart.low is None else chart.low), (chart.high or 1.0)
    ElementTree.SubElement(
        plot,
        'range',
        {'bottom': f'{low:g}', 'top': f'{high:g}', 'left': '0', 'right': f'{_ONE_CYCLE_S}'},
    )
    limits = {'min': chart.low, 'max': chart.high}
    ElementTree.SubElement(
        plot, 'limitY', {key: f'{value:g}' for key, value in limits.items() if value is not None}
    )
    for curve in chart.curves:
        ElementTree.SubElement(plot, 'curve', {'name': series(tray, curve), 'color': curve.color})


def _plotjuggler_streamer(root: ElementTree.Element, trays: tuple[int, ...]) -> None:
    """The topics to subscribe to, ticked in the dialogue that asks for them."""
    name = 'ROS2 Topic Subscriber'
    ElementTree.SubElement(root, 'previouslyLoaded_Streamer', {'name': name})
    plugin = ElementTree.SubElement(
        ElementTree.SubElement(root, 'Plugins'), 'plugin', {'ID': name}
    )
    used = dict.fromkeys(
        curve.topic.absolute(tray) for tray in trays for chart in CHARTS for curve in chart.curves
    )
    for key, value in (
        ('use_header_stamp', 'false'),
        ('discard_large_arrays', 'true'),
        ('max_array_size', '100'),
        ('boolean_strings_to_number', 'true'),
        ('remove_suffix_from_strings', 'true'),
        ('selected_topics', ';'.join(used)),
    ):
        ElementTree.SubElement(plugin, key, {'value': value})


LAYOUTS = {
    'foxglove/nanorocks.json': foxglove,
    'rviz/nanorocks.rviz': rviz,
    'plotjuggler/nanorocks.xml': plotjuggler,
}
