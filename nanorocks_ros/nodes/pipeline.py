"""Node: the whole data path in one process, from a simulator, a bag or a camera topic."""

from __future__ import annotations

from typing import Any

from nanorocks_ros import settings as st
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes.base.communication.result_topics import RESULT_TOPICS
from nanorocks_ros.nodes.base.communication.topic_monitor import ONE_SOURCE
from nanorocks_ros.nodes.base.epoch import Epoch
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.nodes.base.told_settings import default_settings
from nanorocks_ros.nodes.frames.frame_source import FrameSource, SourceChoice
from nanorocks_ros.nodes.frames.frame_stages import FrameStages
from nanorocks_ros.nodes.sources.bag_source import refuse_unused_parameters, settings_of_bag
from nanorocks_ros.nodes.sources.open_diameters import find_open_diameters
from nanorocks_ros.nodes.workers.graph_recorder import GraphRecorder, provenance
from nanorocks_ros.nodes.workers.live_page_process import LivePageProcess
from nanorocks_ros.wire import topics


class PipelineNode(NanorocksNode):
    """Runs all stages; records pass between them in memory."""

    def __init__(self) -> None:
        super().__init__('pipeline')
        declare = self.parameters.declare
        source = declare(st.SourceSettings()).source
        bag = declare(st.BagSettings())
        camera = declare(st.CameraSettings())
        find_open_diameters(self, source, bag, camera)
        # What is told to the node replaces what the bag says.
        defaults = settings_of_bag(self, bag) if source == 'bag' else default_settings(self)
        settings = declare(defaults, read_only=False)
        simulation = declare(st.SimulationSettings(), prefix='simulation.')
        pacing = declare(st.PacingSettings())
        self._record_settings = declare(st.RecordSettings())
        page = declare(st.DashboardSettings(), prefix='dashboard_')
        with_page = declare(st.LivePageSettings()).dashboard
        workers = declare(st.WorkSettings()).workers
        self.parameters.refuse_unknown()
        refuse_unused_parameters(source, bag, pacing)
        self._choice = SourceChoice(source, bag, simulation, camera, pacing)
        _refuse_other_tray(self._choice, settings)
        self._page = LivePageProcess(self, page, settings.trays_file) if with_page else None
        epoch = Epoch(self, may_set=True, follow=source == 'topic')
        self._stages = FrameStages(
            self,
            epoch,
            source,
            workers=workers,
            tray_count=len(settings.trays),
            as_fast_as_possible=self._choice.as_fast_as_possible,
        )
        self._offer_topics(settings.trays)
        # Meanwhile others discover the publishers.
        self._stages.warm_up()
        self._stages.adopt(settings, self._stages.build(settings))
        self.parameters.react_to_changes(settings, self._stages.build, self._stages.change)
        self._recorder: GraphRecorder | None = None
        self._frames = FrameSource(self, self._choice, epoch, self._stages, self._finish)

    def _offer_topics(self, trays: tuple[int, ...]) -> None:
        self.outputs.offer((topics.EPOCH,))
        # With source 'topic' another node publishes the camera.
        if self._choice.name != 'topic':
            self.outputs.offer((topics.RAW,))
            self.topic_monitor.require_single_publisher(topics.RAW.name)
        for tray in trays:
            self.outputs.offer(RESULT_TOPICS, tray)
            if self._choice.name == 'simulator':
                self.outputs.offer((topics.TRUTH,), tray)
            self.topic_monitor.require_single_publisher(topics.SPEED.of(tray), ONE_SOURCE)

    def start_recording(self) -> None:
        """Record from now on; last, so that no bag is left behind when the rest cannot start."""
        if not self._record_settings.record:
            return
        of_source: dict[str, tuple[Any, ...]] = {
            'simulator': (self._choice.simulation,),
            'bag': (self._choice.bag,),
            'topic': (),
        }
        settings, source = self._stages.settings, self._choice.name
        self._recorder = GraphRecorder(
            self,
            self._record_settings,
            provenance(source, settings, *of_source[source]),
            settings.trays,
            wait_for_disk=self._choice.as_fast_as_possible,
        )
        self.outputs.recorder = self._recorder
        self._frames.record_with(self._recorder)

    def end_recording(self) -> None:
        """Write what waits, and the index."""
        if self._recorder is not None:
            self._recorder.close()

    def _finish(self) -> None:
        self._stages.flush()
        self.end_recording()
        self.finish()

    def interrupt(self) -> None:
        """Do not wait until there is room for another frame."""
        self._stages.interrupt()

    def end_helpers(self) -> None:
        """Leave out the frames that wait for the trays; processes end while the bag is written."""
        self._stages.end()
        if self._page is not None:
            self._page.interrupt()

    def destroy_node(self) -> None:
        """Wait for the processes, before the node that they work for."""
        self._stages.close()
        if self._page is not None:
            self._page.close()
        super().destroy_node()


def _refuse_other_tray(choice: SourceChoice, settings: st.PipelineSettings) -> None:
    """Refuse to simulate a tray that is not measured, before anything is compiled."""
    tray = choice.simulation.tray
    if choice.name == 'simulator' and tray not in settings.trays:
        raise ConfigurationError(
            'parameter simulation.tray',
            f'{tray} is not among trays {settings.trays}',
            'set both',
        )
