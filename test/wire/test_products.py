"""The register of products agrees with the message definitions and the topics."""

from __future__ import annotations

from pathlib import Path

from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout
from nanorocks_ros.wire.products import CURVES, PRODUCTS

DEFINITIONS = Path(__file__).parents[2] / 'msg_defs' / 'nanorocks_msgs' / 'msg'


def test_every_message_definition_is_that_of_one_product():
    # The length of the array of BeadsTruth depends on the tray: `wire.bead_truth` handles it.
    defined = sorted(path.stem for path in DEFINITIONS.glob('*.msg') if path.stem != 'BeadsTruth')
    assert sorted(product.record.__name__ for product in PRODUCTS) == defined


def test_every_topic_with_an_array_is_that_of_one_product():
    arrays = {
        topic.name
        for topic in topics.TOPICS
        if topic.type == topics.ARRAY and topic is not topics.BEADS
    }
    assert sorted(product.topic.name for product in PRODUCTS) == sorted(arrays)


def test_products_have_different_names():
    assert len({product.name for product in PRODUCTS}) == len(PRODUCTS)


def test_the_live_page_draws_fields_of_the_arrays():
    for product in CURVES.values():
        assert set(product.curve) <= {field.name for field in layout(product.record).fields}
