"""What other viewers are told to draw: which fields of which arrays, and which pictures.

The elements of the arrays are looked up in their layouts by name, so that no viewer draws a number
it takes for another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout
from nanorocks_ros.wire.products import PRODUCTS

if TYPE_CHECKING:
    from nanorocks_ros.wire.topics import Topic

_RECORDS = {product.topic: product.record for product in PRODUCTS}
_BLUE, _RED, _GREEN, _GRAY = '#1f77b4', '#d62728', '#2ca02c', '#7f7f7f'
_LINE, _BAND = 2.0, 1.0


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
