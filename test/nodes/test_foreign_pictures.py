"""Pictures of somebody else's node: what cannot be used is refused, and the rest is used."""

from __future__ import annotations

import asyncio
import json
import re

import aiohttp
import cv2
import numpy as np
import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image

from nanorocks_ros.dashboard.tray_pictures import LAYERS
from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes._crops import OneSize, color_frame, gray_frame, picture_frame
from nanorocks_ros.nodes._shell import image_message, qos_of
from nanorocks_ros.records import TrayImage
from nanorocks_ros.wire import topics

NS = 1_000_000_000
RED = np.zeros((40, 40, 3), np.uint8)
RED[..., 0] = 255


def test_pictures_come_in_blue_green_and_red_whoever_publishes_them():
    message = image_message(NS, 'x', RED, 'rgb8')
    for read in (color_frame, picture_frame):
        frame = read(message, 'where')
        assert frame.encoding == 'bgr8'
        assert frame.image[20, 20].tolist() == [0, 0, 255]
    assert picture_frame(image_message(NS, 'x', RED[..., 0]), 'where').encoding == 'mono8'


def test_gray_is_not_taken_for_colour_nor_colour_for_gray():
    with pytest.raises(FrameError, match=r"where: encoding 'bgr8' .* publish it as mono8"):
        gray_frame(image_message(NS, 'x', RED), 'where')
    with pytest.raises(FrameError, match=r"encoding 'mono8' .* publish it as bgr8 or rgb8"):
        color_frame(image_message(NS, 'x', RED[..., 0]), 'where')


def test_rows_that_are_padded_are_taken_without_the_padding():
    pixels = np.arange(40 * 48, dtype=np.uint8).reshape(40, 48)
    message = image_message(NS, 'x', pixels)
    message.width = 41
    image = gray_frame(message, 'where').image
    assert image.flags.c_contiguous
    assert np.array_equal(image, pixels[:, :41])


def test_one_size_is_kept_to():
    sizes = OneSize('/gray')
    gray = np.zeros((20, 30), np.uint8)
    color = np.zeros((20, 31, 3), np.uint8)
    with pytest.raises(FrameError, match='30x20 px in gray, 31x20 px in colour'):
        sizes.changed(TrayImage(stamp_ns=1, tray=1, gray=gray, color=color))
    assert not sizes.changed(TrayImage(stamp_ns=1, tray=1, gray=gray))
    other = TrayImage(stamp_ns=2, tray=1, gray=gray.T)
    with pytest.raises(FrameError, match='/gray: the size changed from 30x20 px to 20x30 px'):
        sizes.changed(other)
    assert not sizes.changed(TrayImage(stamp_ns=3, tray=1, gray=gray, color=color[:, :30]))


def test_a_size_that_stays_is_the_new_one():
    sizes = OneSize('/gray')
    gray = np.zeros((20, 30), np.uint8)
    sizes.changed(TrayImage(stamp_ns=1, tray=1, gray=gray))
    other = TrayImage(stamp_ns=2, tray=1, gray=gray.T)
    refused = 0
    for _ in range(20):
        try:
            if sizes.changed(other):
                break
        except FrameError:
            refused += 1
    assert 2 < refused < 15
    assert not sizes.changed(other)
    with pytest.raises(FrameError, match='from 20x30 px to 30x20 px'):
        sizes.changed(TrayImage(stamp_ns=1, tray=1, gray=gray))


@pytest.mark.parametrize('name', ['speed_estimator', 'cluster_autocorrelator'])
def test_a_stage_refuses_crops_that_it_cannot_use_and_goes_on(graph, name):
    crops = graph.node.create_publisher(Image, topics.GRAY.of(1), qos_of(topics.GRAY))
    epoch = graph.node.create_publisher(Time, topics.EPOCH.name, qos_of(topics.EPOCH))
    epoch.publish(Time(sec=1))
    counts = {}
    graph.node.create_subscription(
        DiagnosticArray,
        '/diagnostics',
        lambda message: counts.update(
            {pair.key: pair.value for one in message.status for pair in one.values}
        ),
        10,
    )
    process = graph.start(name)
    graph.until(lambda: crops.get_subscription_count() == 1)
    random = np.random.default_rng(1)
    shapes = [(200, 200)] * 4 + [(200, 200, 3), (206, 200)] * 3 + [(200, 200)] * 4
    # Somebody gave the node that sends them another scale.
    shapes += [(206, 200)] * 12
    for k, shape in enumerate(shapes):
        pixels = random.integers(0, 255, shape).astype(np.uint8)
        crops.publish(image_message(NS + k * NS // 30, 'x', pixels))
    graph.until(lambda: counts.get('received') and int(counts['received']) >= len(shapes))
    graph.until(lambda: counts.get('refused') == '15')
    finished = graph.interrupt(process)
    assert finished.code == 0
    assert "image_gray: encoding 'bgr8' where gray is expected" in finished.output
    assert 'the size changed from 200x200 px to 200x206 px' in finished.output
    assert 'image_gray: pictures of another size; starting afresh' in finished.output
    assert 'Traceback' not in finished.output


def test_the_page_shows_what_it_can_of_foreign_pictures_and_goes_on(graph):
    publishers = {
        topic: graph.node.create_publisher(Image, topic.of(1), qos_of(topic))
        for topic in (topics.TRACKS, topics.MOTION)
    }
    process = graph.start('dashboard', 'port:=0')
    found = []
    graph.until(lambda: found.extend(re.findall(r'http://\S+', graph.output(process))) or found)
    pictures = asyncio.run(
        look(publishers, found[0], lambda: 'where gray is expected' in graph.output(process))
    )
    assert set(pictures) == {'tracks'}
    shown = cv2.imdecode(np.frombuffer(pictures['tracks'], np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == (1, 900, 3)
    # Blue, green, red, as JPEG has it.
    assert shown[0, 450, 2] > 250
    assert shown[0, 450, 0] < 5
    finished = graph.interrupt(process)
    assert finished.code == 0
    assert "tray_1/motion: encoding 'bgr8' where gray is expected" in finished.output
    assert 'Traceback' not in finished.output


async def look(publishers, url, refused):
    """What a browser gets while a strip comes as tracks, and colours as what moves."""
    strip = np.zeros((1, 5000, 3), np.uint8)
    strip[..., 0] = 255
    pictures = {}
    async with aiohttp.ClientSession() as session, session.ws_connect(f'{url}live') as socket:
        await socket.send_json({'look': {'tray': 1, 'layers': ['motion', 'tracks']}})
        for k in range(400):
            publishers[topics.TRACKS].publish(image_message(k * NS, 'x', strip, 'rgb8'))
            publishers[topics.MOTION].publish(image_message(k * NS, 'x', RED))
            try:
                message = await socket.receive(0.05)
            except asyncio.TimeoutError:
                message = None
            if message and message.type is aiohttp.WSMsgType.TEXT:
                await socket.send_json({'seen': json.loads(message.data).get('n', 0)})
            if message and message.type is aiohttp.WSMsgType.BINARY:
                pictures[LAYERS[message.data[1]]] = message.data[2:]
            if pictures and refused():
                break
    return pictures
