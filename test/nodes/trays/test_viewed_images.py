"""Images that a browser views reach it, also those of foreign publishers."""

from __future__ import annotations

import asyncio
import json
import re

import aiohttp
import cv2
import numpy as np
import pytest

pytest.importorskip('rclpy')

from sensor_msgs.msg import Image

from nanorocks_ros.dashboard.tray_pictures import LAYERS
from nanorocks_ros.nodes.base.communication.ros_messages import image_message, qos_of
from nanorocks_ros.wire import topics

NS = 1_000_000_000
RED = np.zeros((40, 40, 3), np.uint8)
RED[..., 0] = 255


def test_the_page_shows_usable_images_and_refuses_others(graph):
    publishers = {
        topic: graph.node.create_publisher(Image, topic.of(1), qos_of(topic))
        for topic in (topics.TRACKS, topics.MOTION)
    }
    process = graph.start('dashboard', 'port:=0')
    urls = []
    graph.until(lambda: urls.extend(re.findall(r'http://\S+', graph.output(process))) or urls)
    images = asyncio.run(
        receive_images(
            publishers, urls[0], lambda: 'where gray is expected' in graph.output(process)
        )
    )
    assert set(images) == {'tracks'}
    shown = cv2.imdecode(np.frombuffer(images['tracks'], np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == (1, 900, 3)
    # Blue, green, red, as JPEG has it.
    assert shown[0, 450, 2] > 250
    assert shown[0, 450, 0] < 5
    finished = graph.interrupt(process)
    assert finished.code == 0
    assert "tray_1/motion: encoding 'bgr8' where gray is expected" in finished.output
    assert 'Traceback' not in finished.output


async def receive_images(publishers, url, refused):
    """What a browser receives of a strip as tracks image, and of a colour image as mask."""
    strip = np.zeros((1, 5000, 3), np.uint8)
    strip[..., 0] = 255
    images = {}
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
                images[LAYERS[message.data[1]]] = message.data[2:]
            if images and refused():
                break
    return images
