"""Checkpoint file of a gas: its whole state, so that a run continues bit by bit."""

from __future__ import annotations

import hashlib
import struct
import zipfile
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.archive_limits import check_archive
from nanorocks_ros.errors import SimulationError
from nanorocks_ros.limits import require_regular_file
from nanorocks_ros.outputs.npz_archive import write_archive
from nanorocks_ros.simulation.engine.gas_state import State
from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# Incremented with every change of the fields of a state.
_FORM = 5
_DIGEST = 'sha256'
# What zipfile and numpy raise for damaged files and files of other formats.
_DAMAGE = (
    ValueError,
    TypeError,
    EOFError,
    KeyError,
    RuntimeError,
    NotImplementedError,
    OverflowError,
    MemoryError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


def _digest(arrays: dict[str, NDArray[Any]]) -> NDArray[np.uint8]:
    """Fingerprint of the names, types, shapes and values."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f'{name} {array.dtype.str} {array.shape} '.encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)


def save(path: Path, state: State, rules: Rules, n_species: int) -> None:
    """Write a checkpoint, atomically.

    Raises
    ------
    SimulationError
        When it cannot be written.
    """
    arrays = {f'state.{name}': value for name, value in state._asdict().items()}
    arrays |= {f'rules.{name}': np.asarray(value) for name, value in rules._asdict().items()}
    arrays['form'] = np.asarray([_FORM, n_species])
    write_archive(path, {**arrays, _DIGEST: _digest(arrays)}, SimulationError)


def load(path: Path) -> tuple[State, Rules, int]:
    """Read a checkpoint.

    Raises
    ------
    SimulationError
        When it cannot be read, is damaged, or was written by another release.
    """
    try:
        require_regular_file(path, SimulationError)
        # Refuses a single array or a pickle, too: only an archive is a checkpoint.
        check_archive(path, str(path), SimulationError)
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except OSError as error:
        reason = error.strerror or 'is not a saved gas'
        raise SimulationError(str(path), reason, 'name a file that was saved') from error
    except _DAMAGE as error:
        raise SimulationError(str(path), 'is damaged', 'use another saved state') from error
    digest = arrays.pop(_DIGEST, None)
    if digest is None or 'form' not in arrays:
        raise SimulationError(str(path), 'is not a saved gas', 'name a file that was saved')
    if not np.array_equal(digest, _digest(arrays)):
        raise SimulationError(str(path), 'is damaged', 'use another saved state')
    form, n_species = arrays['form'].tolist()
    required = {f'state.{name}' for name in State._fields} | {
        f'rules.{name}' for name in Rules._fields
    }
    if form != _FORM or not required <= set(arrays):
        raise SimulationError(
            str(path), 'was saved by another release', 'use that release, or start again'
        )
    state = State(*(arrays[f'state.{name}'] for name in State._fields))
    return state, Rules(*(_rule(arrays[f'rules.{name}']) for name in Rules._fields)), n_species


def _rule(value: NDArray[Any]) -> Any:
    """A rule in the type that compiled code takes: table, tuple or value."""
    if value.ndim == 2:
        return value
    if value.ndim == 1:
        return tuple(value.tolist())
    return value[()] if value.dtype == np.uint64 else value.item()
