"""The layout for Foxglove, and for Lichtblick, its open sibling."""

from __future__ import annotations

import json
from typing import Any

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.tools.viewer_layouts.charts import CHARTS, PICTURES, Chart, message_path
from nanorocks_ros.wire import topics


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
