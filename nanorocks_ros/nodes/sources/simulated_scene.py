"""The whole plate as a source of frames, with camera_info and the truth of every tray."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

from nanorocks_ros.nodes.base.communication.ros_messages import beads_message, camera_info_message
from nanorocks_ros.nodes.sources.simulated_tray import publish_frame
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.settings import SceneSettings, SimulationSettings
    from nanorocks_ros.simulation.plate_scene.plate_film import SceneMoment


class SimulatedScene:
    """Frames of the plate, stamped from the time when the first is sent.

    Parameters
    ----------
    node : NanorocksNode
    simulation : SimulationSettings
    scene : SceneSettings
    effects : str
        ``all`` or ``none``.
    """

    def __init__(
        self,
        node: NanorocksNode,
        simulation: SimulationSettings,
        scene: SceneSettings,
        effects: str,
    ) -> None:
        self._node = node
        self._start_ns: int | None = None
        seen = without_effects(scene) if effects == 'none' else scene
        # Compile what the first shaking event needs, or the frames after it would be late.
        shaken = SceneFilm(
            replace(simulation, first_shake=0.0), replace(seen, trays=seen.trays[:1])
        )
        for _ in islice(shaken.moments(), 2):
            pass
        self._film = SceneFilm(simulation, seen)
        for tray in scene.trays:
            node.outputs.offer((topics.TRUTH, topics.BEADS), tray)
        node.outputs.offer((topics.CAMERA_INFO,))

    def moments(self) -> Iterator[tuple[int, SceneMoment]]:
        """Stamp from 0 [ns] and each moment."""
        for moment in self._film.moments():
            yield moment.frame.stamp_ns, moment

    def stamped(self, moment: SceneMoment) -> SceneMoment:
        """The moment with stamps of the node's clock; the first publishes camera_info, too."""
        if self._start_ns is None:
            self._start_ns = self._node.get_clock().now().nanoseconds - moment.frame.stamp_ns
            camera = self._film.camera.geometry.camera
            message = camera_info_message(self._start_ns, 'camera', camera)
            self._node.outputs.send(topics.CAMERA_INFO, message)
        stamp_ns = moment.frame.stamp_ns + self._start_ns
        return replace(
            moment,
            frame=replace(moment.frame, stamp_ns=stamp_ns),
            trays=tuple(replace(truth, stamp_ns=stamp_ns) for truth in moment.trays),
            beads=tuple(replace(beads, stamp_ns=stamp_ns) for beads in moment.beads),
        )

    def publish(self, moment: SceneMoment, epoch_ns: int) -> None:
        """Publish frame and beads, if anybody subscribes, and the truth of each tray."""
        outputs = self._node.outputs
        publish_frame(self._node, moment.frame)
        for truth in moment.trays:
            outputs.publish_result(truth, epoch_ns)
        for beads in moment.beads:
            if outputs.has_subscribers(topics.BEADS, beads.tray):
                outputs.send(topics.BEADS, beads_message(beads, epoch_ns), beads.tray)
