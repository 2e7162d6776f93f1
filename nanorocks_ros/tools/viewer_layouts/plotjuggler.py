"""The layout for PlotJuggler."""

from __future__ import annotations

from xml.etree import ElementTree

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.tools.viewer_layouts.charts import CHARTS, Chart, series

_ONE_CYCLE_S = 60


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
    # The declaration that Python writes differs between its releases.
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


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
