"""The result of `simulate`: runs of a tray, and the truth behind a film of the first.

Tested by ``test/interface/test_simulating.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.interface.record_frames import table_frame
from nanorocks_ros.interface.results.result import NamedTable, Result, Summary
from nanorocks_ros.outputs.html_report import number
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.studies.synthetic.trajectory import event_table, trajectory_table

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRuns

_MM = 1e3
_SPEED_UNITS = {
    'run': '1',
    'time': 's',
    'mean_speed': 'm/s',
    'mean_projected_speed': 'm/s',
    'bodies': '1',
}
_TRUTH = 'restitution', 'wall_restitution', 'sticking_speed', 'mean_speed', 'drag', 'seed'
_TRUTH_UNITS = {'sticking_speed': 'm/s', 'mean_speed': 'm/s', 'drag': '1/s'}


class SimulationResult(Result):
    """Runs of a simulated tray. `nanorocks_ros.simulate` makes it.

    Times count from the shaking event.
    """

    speeds = NamedTable(
        'Mean speed of the beads in space and in the picture, and bodies, over time.'
    )
    tracks = NamedTable(
        'Place and velocity of each bead at each time; only with ``keep_tracks=True``.'
    )
    contacts = NamedTable('Every collision, rebound, merge and bead that stuck to a wall.')
    clusters = NamedTable('Number of bodies over time: beads that stick together are one.')
    cor = NamedTable('The true restitutions, a single row.')

    def __init__(self, simulated: SimulatedRuns) -> None:
        super().__init__(provenance={'simulation': simulated.provenance()}, notices=())
        self._simulated = simulated

    def _makers(self) -> dict[str, Callable[[], pd.DataFrame]]:
        return {
            'speeds': self._speeds,
            'tracks': self._tracks,
            'contacts': lambda: table_frame(*event_table(self._simulated)),
            'clusters': self._clusters,
            'cor': self._truth,
        }

    def _speeds(self) -> pd.DataFrame:
        times = self._simulated.plan.times
        frames = [
            pd.DataFrame(
                {
                    'run': run.number,
                    'time': times,
                    'mean_speed': run.mean_speed,
                    'mean_projected_speed': run.mean_projected_speed,
                    'bodies': run.bodies,
                }
            )
            for run in self._simulated.runs
        ]
        frame = pd.concat(frames, ignore_index=True)
        frame.attrs['units'] = dict(_SPEED_UNITS)
        return frame

    def _clusters(self) -> pd.DataFrame:
        names = ['run', 'time', 'bodies']
        frame = self.speeds[names].copy()
        beads = self._simulated.plan.tray.count
        frame['beads_of_a_body'] = beads / frame['bodies'].to_numpy(dtype=np.float64)
        frame.attrs = {'units': {name: _SPEED_UNITS.get(name, '1') for name in frame.columns}}
        return frame

    def _tracks(self) -> pd.DataFrame:
        if not self._simulated.plan.trajectory:
            raise ConfigurationError('tracks', 'were not kept', 'simulate with keep_tracks=True')
        return table_frame(*trajectory_table(self._simulated))

    def _truth(self) -> pd.DataFrame:
        settings = self._simulated.plan.settings
        names = ('tray', *_TRUTH)
        frame = pd.DataFrame([{name: getattr(settings, name) for name in names}])
        frame['law'] = settings.restitution_law
        frame.attrs['units'] = {name: _TRUTH_UNITS.get(name, '1') for name in frame.columns}
        return frame

    def _figure(self) -> Figure:
        from nanorocks_ros.studies.synthetic.simulated_figure import simulated_figure

        return simulated_figure(None, self._simulated)

    def _summary(self) -> Summary:
        runs, plan = self._simulated, self._simulated.plan
        speed = runs.mean('mean_speed') * _MM
        half = runs.half_time
        rows = (
            ('restitution of beads, walls', f'{plan.settings.restitution:g}, '
             f'{plan.settings.wall_restitution:g}'),
            ('collisions of beads', f'{runs.count("pair")}'),
            ('hits of walls', f'{runs.count("wall")}'),
            ('mean speed', f'{number(speed[0])} mm/s at the start, {number(speed[-1])} mm/s after '
             f'{plan.duration:g} s'),
            ('half that speed', 'not reached' if half is None else f'after {number(half)} s'),
        )  # fmt: skip
        beads = counted(plan.tray.count, 'bead')
        return Summary(
            title=f'tray {plan.settings.tray}: {beads}, {counted(plan.runs, "run")}, '
            f'seed {plan.settings.seed}',
            head=('simulated', ''),
            rows=rows,
        )
