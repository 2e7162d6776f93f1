"""The register of products: every record that is published as an array, and where it goes.

The topics of the nodes, the lists, tables and results bag of an analysis, the curves of the live
page and the sections of ``docs/reference/topics.md`` follow from `PRODUCTS`, in its order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeGuard

from nanorocks_ros import records
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from nanorocks_ros.records import ArrayRecord
    from nanorocks_ros.wire.topics import Topic


@dataclass(frozen=True, slots=True, kw_only=True)
class Product:
    """One kind of record and where it goes.

    Parameters
    ----------
    record : type
        ``msg_defs`` holds the definition of its array under the same name.
    topic : Topic
    measured : bool
        Whether the stages measure it. `nanorocks analyse` then lists it per tray, and writes a
        table and a topic of the results bag.
    curve : tuple of str
        Fields of the array that the live page draws over time; empty: it does not show the
        record.
    """

    record: type[ArrayRecord]
    topic: Topic
    measured: bool = True
    curve: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Last part of the topic: the name of the table, and of the curve on the live page."""
        return self.topic.name.rpartition('/')[2]


PRODUCTS = (
    Product(
        record=records.SpeedEstimate,
        topic=topics.SPEED,
        curve=('mean_projected_speed', 'mean_projected_speed_error'),
    ),
    Product(
        record=records.ClusterEstimate,
        topic=topics.CLUSTER,
        curve=('combined_size', 'combined_size_error'),
    ),
    Product(
        record=records.CorEstimate,
        topic=topics.COR,
        curve=(
            'restitution',
            'restitution_lower',
            'restitution_upper',
            'wall_restitution',
            'wall_restitution_lower',
            'wall_restitution_upper',
        ),
    ),
    Product(record=records.Rebound, topic=topics.REBOUND),
    Product(record=records.PairCollision, topic=topics.COLLISION),
    Product(record=records.FreeFlight, topic=topics.FLIGHT),
    Product(record=records.BodyEstimate, topic=topics.BODIES),
    Product(record=records.Merge, topic=topics.MERGE),
    Product(
        record=records.GroundTruth,
        topic=topics.TRUTH,
        measured=False,
        curve=('mean_projected_speed',),
    ),
    Product(record=records.TrayState, topic=topics.STATE, measured=False),
)

MEASURED = tuple(product for product in PRODUCTS if product.measured)
"""The products that an analysis lists, tabulates and writes into the results bag."""

_MEASURED_TYPES = frozenset(product.record for product in MEASURED)

ARRAY_TOPICS: dict[type, Topic] = {product.record: product.topic for product in PRODUCTS}
"""The topic of each record that is published as an array."""

TYPED_TOPICS = {
    product.record: replace(
        product.topic,
        name=f'tray_{{tray}}/typed/{product.name}',
        type=f'nanorocks_msgs/msg/{product.record.__name__}',
        doc=f'{product.record.__name__} as a message of its own type',
    )
    for product in PRODUCTS
}
"""The topic of each of these records as a typed message, where `nanorocks_msgs` is installed."""

CURVES = {product.record: product for product in PRODUCTS if product.curve}
"""The products that the live page draws, by record."""


def is_measured(record: object) -> TypeGuard[ArrayRecord]:
    """Whether a record is one of a product in `MEASURED`."""
    return type(record) in _MEASURED_TYPES
