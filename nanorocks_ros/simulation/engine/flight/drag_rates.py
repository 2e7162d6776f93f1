"""Decay rates of the velocities of beads and bodies in a gas: dv/dt = -rate v.

Without drag the compiler leaves all of this out.

Tested by ``test/simulation/engine/flight/test_gas_drag.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.numerics.exponentials import decayed

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.gas_state import State

_COLUMNS = 2
OWN_RATE, _OF_BODY = range(_COLUMNS)


@inlined
def is_dragged(state: State) -> bool:
    """Whether there is drag; a constant for the compiler, since it is in the type of the state."""
    return bool(state.drag.ndim == _COLUMNS)


def turns_in_gas(state: Any) -> bool:
    """Whether the type of a state is that of bodies that turn in a gas that slows them."""
    drag, motions = (state.types[state.fields.index(name)] for name in ('drag', 'motions'))
    return bool(drag.ndim == motions.ndim == _COLUMNS)


@inlined
def own_rate(state: State, i: int) -> float:
    """Decay rate of the velocity of a bead while it is single, [1/s]; only with drag."""
    return state.drag.flat[_COLUMNS * i + OWN_RATE]


@inlined
def drag_rate(state: State, i: int) -> float:
    """Decay rate of the velocity of the body of a bead, [1/s]; only with drag."""
    return state.drag.flat[_COLUMNS * i + _OF_BODY]


@inlined
def set_body_drag(state: State, i: int, rate: float) -> None:
    """Set the decay rate of the body of a bead; only with drag."""
    state.drag.flat[_COLUMNS * i + _OF_BODY] = rate


@inlined
def flown(rate: float, since: float) -> float:
    """Flown time of a decay rate, [s]."""
    if rate > 0.0:
        return decayed(rate * since)[0] / rate
    return since
