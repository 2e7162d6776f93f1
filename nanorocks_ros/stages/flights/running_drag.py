"""The drag of the gas by the flights so far, for the clock in which flights are straight."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.inference.flights.flight_losses import drag_of_flights, flight_table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.records import FreeFlight, Measured

# Flights that are kept: some cycles of a tray.
_MAX_FLIGHTS = 1000
# Time between two fits, [s], and errors by which a drag must differ from 0 to be used.
_INTERVAL = 1.0
_SIGMAS = 3.0


class RunningDrag:
    """Drag by the last flights, renewed every second.

    Parameters
    ----------
    prior : Measured, [1/s]
        Mean and standard deviation.

    Attributes
    ----------
    drag : float, >= 0, [1/s]
        Of beads of the first species; the mean of the prior until the flights show a drag.
    """

    def __init__(self, prior: Measured) -> None:
        self._prior = prior
        self._flights: deque[FreeFlight] = deque(maxlen=_MAX_FLIGHTS)
        self._next_fit = 0.0
        self.drag = max(prior.value, 0.0)

    def push(self, time: float, flights: Iterable[FreeFlight]) -> bool:
        """Add the flights that ended; whether `drag` is new.

        Parameters
        ----------
        time : float, [s]
        flights : iterable of FreeFlight
        """
        self._flights.extend(flights)
        if time < self._next_fit:
            return False
        self._next_fit = time + _INTERVAL
        drag = drag_of_flights(flight_table(self._flights), self._prior)
        is_known = drag.value > _SIGMAS * drag.error
        before, self.drag = self.drag, drag.value if is_known else max(self._prior.value, 0.0)
        return self.drag != before
