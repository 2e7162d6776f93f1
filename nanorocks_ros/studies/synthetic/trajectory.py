"""Beads and collisions of simulated runs as files: arrays in an NPZ file, or a Parquet table."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.outputs.tables.parquet import write_parquet
from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.simulation.initial_state import inventory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRun, SimulatedRuns

    Table = tuple[tuple[Column, ...], Iterator[dict[str, NDArray[Any]]]]

TABLES = '.npz', '.parquet'
"""Suffixes of these files."""

_AXES = 'xyz'
EVENT_COLUMNS = (
    Column(name='run', kind='int32', unit='1', doc='number of the run'),
    Column(name='time', unit='s', doc='since the shaking event'),
    Column(name='type', kind='string', doc='pair, wall, merge or fix'),
    Column(name='bead', kind='int32', unit='1', doc='number of the bead'),
    Column(
        name='partner', kind='int32', unit='1', doc='bead, or wall: 0 to 5, low and high x, y, z'
    ),
    Column(name='normal_speed', unit='m/s', doc='along the normal, before'),
    Column(name='impulse', unit='kg m/s', doc='exchanged along the normal'),
)
# Fields of the engine that have other names than their columns.
_FIELDS = {'type': 'kind'}


def write_trajectory(path: Path, simulated: SimulatedRuns) -> None:
    """Write the beads of every run at every time.

    Parameters
    ----------
    path : Path
        ``.npz``: arrays `times` (samples,), `runs`, `box` (3,), and for each bead `ids`,
        `species`, `materials`, `radii`, `masses`, `positions` and `velocities`
        (samples, n, 3), `spins` of rough beads and where bodies turn, `body` (samples, n), the
        smallest number of a bead that moves with this one, `drag` (n,) in a gas that slows
        beads. With several runs, arrays that differ between runs have them as first axis.
        ``.parquet``: a row for each bead at each time of each run.
        Either holds `provenance`, as JSON; units are SI.
    simulated : SimulatedRuns
        Of a plan that keeps the trajectory.

    Raises
    ------
    ConfigurationError
        When pyarrow, which writes Parquet, is not installed.
    RecordingError
        When the file cannot be written.
    """
    if path.suffix == '.parquet':
        write_parquet(path, *trajectory_table(simulated), simulated.provenance())
    else:
        _write_arrays(path, _bead_arrays(simulated))


def write_events(path: Path, simulated: SimulatedRuns) -> None:
    """Write every collision of every run, in the order of runs and times.

    Parameters
    ----------
    path : Path
        ``.npz`` or ``.parquet``, with the columns `run`, `time`, `type` (pair, wall, merge,
        fix), `bead`, `partner` (a bead, or the wall: 0 to 5 for low and high x, y, z),
        `normal_speed` and `impulse`; units are SI.
    simulated : SimulatedRuns
        Of a plan that keeps events.

    Raises
    ------
    ConfigurationError
        When pyarrow, which writes Parquet, is not installed.
    RecordingError
        When the file cannot be written.
    """
    columns, pieces = event_table(simulated)
    if path.suffix == '.parquet':
        write_parquet(path, columns, pieces, simulated.provenance())
        return
    rows = list(pieces)

    def joined(name: str) -> Callable[[], Any]:
        return lambda: np.concatenate([row[name] for row in rows])

    arrays = {column.name: joined(column.name) for column in columns}
    _write_arrays(path, {**arrays, 'provenance': lambda: np.array(simulated.provenance())})


def trajectory_table(simulated: SimulatedRuns) -> Table:
    """Columns and rows of the beads of every run at every time, run by run."""
    pieces = (_bead_rows(simulated, run) for run in simulated.runs)
    return _bead_columns(simulated), pieces


def event_table(simulated: SimulatedRuns) -> Table:
    """Columns and rows of every collision of every run, run by run."""
    return EVENT_COLUMNS, (_event_rows(run) for run in simulated.runs)


def _event_rows(run: SimulatedRun) -> dict[str, NDArray[Any]]:
    columns = {
        column.name: run.events[_FIELDS.get(column.name, column.name)]
        for column in EVENT_COLUMNS[1:]
    }
    return {'run': np.full(len(run.events), run.number, dtype=np.int32), **columns}


def _bead_arrays(simulated: SimulatedRuns) -> dict[str, Callable[[], Any]]:
    """Functions that make the arrays, so that only one array at a time is in memory twice."""
    drawn = inventory(simulated.plan.tray)

    def joined(name: str) -> Callable[[], Any]:
        if len(simulated.runs) == 1:
            return lambda: getattr(simulated.runs[0], name)
        return lambda: np.stack([getattr(run, name) for run in simulated.runs])

    names = ['radii', 'masses', 'positions', 'velocities', 'body']
    if simulated.runs[0].spins is not None:
        names.append('spins')
    if simulated.runs[0].drag is not None:
        names.append('drag')
    return {
        'times': lambda: simulated.plan.times,
        'runs': lambda: np.array([run.number for run in simulated.runs], dtype=np.int32),
        'box': lambda: np.array(simulated.plan.tray.dimensions),
        'ids': lambda: np.arange(drawn.species.size, dtype=np.int32),
        'species': lambda: drawn.species,
        'materials': lambda: np.array(drawn.materials),
        **{name: joined(name) for name in names},
        'provenance': lambda: np.array(simulated.provenance()),
    }


def _write_arrays(path: Path, arrays: dict[str, Callable[[], Any]]) -> None:
    """Write an ``.npz`` file that ``numpy.load`` reads, the same bytes for the same arrays."""
    with atomic_file(path) as part, zipfile.ZipFile(part, 'w') as archive:
        for name, make in arrays.items():
            # A `ZipInfo` made from the name alone has no date.
            member = zipfile.ZipInfo(f'{name}.npy')
            with archive.open(member, 'w', force_zip64=True) as stream:
                np.lib.format.write_array(stream, np.asarray(make()), allow_pickle=False)


def _bead_columns(simulated: SimulatedRuns) -> tuple[Column, ...]:
    vectors = [('', 'm', 'position'), ('v', 'm/s', 'velocity')]
    if simulated.runs[0].spins is not None:
        vectors.append(('w', 'rad/s', 'angular velocity'))
    drag = (
        []
        if simulated.runs[0].drag is None
        else [Column(name='drag', unit='1/s', doc='of the gas on the bead')]
    )
    return (
        Column(name='run', kind='int32', unit='1', doc='number of the run'),
        Column(name='time', unit='s', doc='since the shaking event'),
        Column(name='id', kind='int32', unit='1', doc='number of the bead'),
        Column(
            name='body', kind='int32', unit='1', doc='smallest number of a bead that moves with it'
        ),
        Column(name='species', kind='int32', unit='1', doc='0 for the first of the tray'),
        Column(name='material', kind='string', doc='of the bead'),
        Column(name='radius', unit='m', doc='of the bead'),
        Column(name='mass', unit='kg', doc='of the bead'),
        *drag,
        *(
            Column(name=f'{letter}{axis}', unit=unit, doc=f'{meaning} along {axis}')
            for letter, unit, meaning in vectors
            for axis in _AXES
        ),
    )


def _bead_rows(simulated: SimulatedRuns, run: SimulatedRun) -> dict[str, NDArray[Any]]:
    """A row for each bead at each time, in the order of times."""
    drawn = inventory(simulated.plan.tray)
    times = simulated.plan.times
    n_times, n = run.body.shape

    def of_beads(values: NDArray[Any]) -> NDArray[Any]:
        return np.tile(values, n_times)

    rows = {
        'run': np.full(n_times * n, run.number, dtype=np.int32),
        'time': np.repeat(times, n),
        'id': of_beads(np.arange(n, dtype=np.int32)),
        'body': run.body.ravel(),
        'species': of_beads(drawn.species),
        'material': of_beads(np.array(drawn.materials)),
        'radius': of_beads(run.radii),
        'mass': of_beads(run.masses),
    }
    if run.drag is not None:
        rows['drag'] = of_beads(run.drag)
    for letter, vectors in (('', run.positions), ('v', run.velocities), ('w', run.spins)):
        for k, axis in enumerate(_AXES):
            if vectors is not None:
                rows[f'{letter}{axis}'] = vectors[:, :, k].ravel()
    return rows
