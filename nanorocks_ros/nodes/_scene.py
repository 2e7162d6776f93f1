"""The whole plate as a source of frames: the camera, its lens, and the truth of every tray."""

from __future__ import annotations

from dataclasses import replace

from nanorocks_ros.nodes._shell import beads_message, image_message, lens_message
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects
from nanorocks_ros.wire import topics


class SimulatedScene:
    """Frames of the plate that begin when the first is given out.

    Parameters
    ----------
    node : NanorocksNode
    simulation : SimulationSettings
    scene : SceneSettings
    effects : str
        ``all`` or ``none``.
    """

    def __init__(self, node, simulation, scene, effects):
        self._node = node
        self._start_ns = None
        self._film = SceneFilm(simulation, without_effects(scene) if effects == 'none' else scene)
        for tray in scene.trays:
            node.offer((topics.TRUTH, topics.BEADS), tray)
        node.offer((topics.CAMERA_INFO,))

    def moments(self):
        """Stamp, from 0, and the records of each frame, the frame first."""
        for moment in self._film.moments():
            yield moment.frame.stamp_ns, (moment.frame, moment.trays, moment.beads)

    def dated(self, moment):
        """The moment with the stamps of the node's clock."""
        frame, trays, beads = moment
        if self._start_ns is None:
            self._start_ns = self._node.get_clock().now().nanoseconds - frame.stamp_ns
            lens = lens_message(self._start_ns, 'camera', self._film.camera.geometry.camera)
            self._node.send(topics.CAMERA_INFO, lens)
        stamp_ns = frame.stamp_ns + self._start_ns
        return (
            replace(frame, stamp_ns=stamp_ns),
            tuple(replace(tray, stamp_ns=stamp_ns) for tray in trays),
            tuple(replace(bead, stamp_ns=stamp_ns) for bead in beads),
        )

    def publish(self, moment, epoch_ns):
        """Send the frame and the beads, if anybody looks, and the truth of each tray."""
        frame, trays, beads = moment
        node = self._node
        if node.wanted(topics.RAW):
            message = image_message(frame.stamp_ns, 'camera', frame.image, frame.encoding)
            node.send(topics.RAW, message)
        for tray in trays:
            node.publish_result(tray, epoch_ns)
        for bead in beads:
            if node.wanted(topics.BEADS, bead.tray):
                node.send(topics.BEADS, beads_message(bead, epoch_ns), bead.tray)
