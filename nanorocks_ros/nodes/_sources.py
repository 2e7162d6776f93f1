"""Where frames come from when not from a camera: the simulator, or a bag."""

from __future__ import annotations

from dataclasses import asdict, replace

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.nodes._names import on_the_command_line
from nanorocks_ros.nodes._shell import image_message
from nanorocks_ros.settings import BagSettings
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.wire import topics


class Simulated:
    """Simulated frames that begin when the first is given out.

    Compiling takes seconds, and listeners may have to be waited for: a stamp taken before
    would make every frame look late.

    Parameters
    ----------
    node : NanorocksNode
    simulation : SimulationSettings
    trays_file : str
    """

    def __init__(self, node, simulation, trays_file):
        self._node = node
        self._start_ns = None
        tray = tray_by_number(load_trays(trays_file), simulation.tray)
        self._film = film(simulation, tray)

    def moments(self):
        """Stamp, from 0, and (frame, truth) of each frame."""
        for frame, truth in self._film:
            yield frame.stamp_ns, (frame, truth)

    def dated(self, moment):
        """The moment with the stamps of the node's clock."""
        if self._start_ns is None:
            self._start_ns = self._node.get_clock().now().nanoseconds - moment[0].stamp_ns
        return tuple(replace(one, stamp_ns=one.stamp_ns + self._start_ns) for one in moment)


def recorded_moments(bag, part):
    """Log time and (frame, None, its message) of each frame of the part that is played."""
    for first_ns in part.turns():
        for message, frame in bag.recorded_frames(first_ns, part.last_ns):
            yield message.log_time_ns, (frame, None, message)


def publish_moment(node, moment, epoch_ns):
    """Send the frame, if anybody looks, and what is true of it, if that is known."""
    frame, truth = moment
    if node.wanted(topics.RAW):
        message = image_message(frame.stamp_ns, 'camera', frame.image, frame.encoding)
        node.send(topics.RAW, message)
    if truth is not None:
        node.publish_result(truth, epoch_ns)


def refuse_unused(source, bag, pacing):
    """Refuse what says how a bag is played where none is.

    A file may serve the whole graph, a player beside this node, too; but whoever names a bag
    does not want a simulation.

    Parameters
    ----------
    source : str
    bag : BagSettings
    pacing : PacingSettings

    Raises
    ------
    ConfigurationError
    """
    if source == 'bag':
        return
    given = [name for name, value in asdict(bag).items() if value != getattr(BagSettings(), name)]
    if source == 'topic' and pacing.duration > 0.0:
        given.append('duration')
    meant = {*on_the_command_line(), *(('bag',) if source == 'simulator' else ())}
    for name in given:
        if name in meant:
            raise ConfigurationError(
                f'parameter {name}',
                f'given, but source is {source}',
                'set source:=bag, or leave it out',
            )


def path_of_bag(settings):
    """The bag that the settings name.

    Raises
    ------
    ConfigurationError
        When they name none.
    """
    if not settings.bag:
        raise ConfigurationError('parameter bag', 'is empty', 'give the path of a bag')
    return settings.bag


def opened_bag(settings):
    """The frames of the bag that the settings name.

    Raises
    ------
    ConfigurationError
        When they name none.
    RecordingError
        When it cannot be used.
    """
    return BagFrames(path_of_bag(settings))
