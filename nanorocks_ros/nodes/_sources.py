"""Where frames come from when not from a camera: the simulator, or a bag."""

from __future__ import annotations

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.nodes._shell import image_message
from nanorocks_ros.simulation.film import film
from nanorocks_ros.study.bag_frames import BagFrames
from nanorocks_ros.wire import topics


def simulated_moments(node, simulation, trays_file):
    """Stamp and (frame, truth) of each simulated frame, from now on."""
    tray = tray_by_number(load_trays(trays_file), simulation.tray)
    start_ns = node.get_clock().now().nanoseconds
    for frame, truth in film(simulation, tray, start_stamp_ns=start_ns):
        yield frame.stamp_ns, (frame, truth)


def recorded_moments(bag, loop):
    """Stamp and (frame, None) of each frame of a bag."""
    while True:
        for frame in bag.frames():
            yield frame.stamp_ns, (frame, None)
        if not loop:
            return


def publish_moment(node, moment, epoch_ns):
    """Send the frame, if anybody looks, and what is true of it, if that is known."""
    frame, truth = moment
    if node.wanted(topics.RAW):
        message = image_message(frame.stamp_ns, 'camera', frame.image, frame.encoding)
        node.send(topics.RAW, message)
    if truth is not None:
        node.publish_result(truth, epoch_ns)


def opened_bag(settings):
    """The frames of the bag that the settings name.

    Raises
    ------
    ConfigurationError
        When they name none.
    RecordingError
        When it cannot be used.
    """
    if not settings.bag:
        raise ConfigurationError('parameter bag', 'is empty', 'give the path of a bag')
    return BagFrames(settings.bag)
