"""Merges of the current cycle, and how probable they make each sticking speed.

Tested by ``test/stages/restitution/test_cycles_that_stick.py``.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.inference.sticking.bounce_tables import SPEEDS, node_weights
from nanorocks_ros.inference.sticking.merge_likelihood import MergeRates
from nanorocks_ros.inference.sticking.sticking_cycle import sticking_cycle
from nanorocks_ros.inference.sticking.sticking_speed import merge_log_likelihood
from nanorocks_ros.physics.sticking_rates import slow_contacts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Merge, SpeedEstimate
    from nanorocks_ros.settings import PipelineSettings


class CycleSticking:
    """The merges of a cycle with the speeds of its beads.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._tray, self._beads = tray, tray.count
        self.adopt(settings)
        self.next_cycle()

    def adopt(self, settings: PipelineSettings) -> None:
        """Weigh the merges with other settings from now on."""
        self._settings = settings.sticking
        self._rates: MergeRates | None = None
        with suppress(NanorocksError):
            # Without a theory of the tray all sticking speeds are as probable.
            self._rates = MergeRates(
                slow_contacts(self._tray), self._beads, settings.sticking.measure
            )

    def next_cycle(self) -> None:
        """Forget merges and speeds."""
        self._merges: list[Merge] = []
        self._stamps_ns: list[int] = []
        self._speeds: list[float] = []

    def push_merge(self, merge: Merge) -> None:
        """Add a merge of the cycle."""
        self._merges.append(merge)

    def push_speed(self, speed: SpeedEstimate) -> None:
        """Add a speed that is known, of a time since the shaking event."""
        self._stamps_ns.append(speed.stamp_ns)
        self._speeds.append(speed.mean_projected_speed.value)

    @property
    def first_merge_ns(self) -> int | None:
        """Stamp of the first merge; None without any."""
        return min((merge.stamp_ns for merge in self._merges), default=None)

    def speed_weights(self, start_ns: int) -> NDArray[np.float64] | None:
        """Probability of each of the `SPEEDS` below which beads stick; None while none do.

        Parameters
        ----------
        start_ns : int, [ns]
            The shaking event.
        """
        if not self._merges:
            return None
        if self._rates is not None and self._stamps_ns:
            with suppress(NanorocksError):
                terms = self._rates.terms(
                    sticking_cycle(
                        self._beads,
                        self._merges,
                        np.array(self._stamps_ns, dtype=np.int64),
                        np.array(self._speeds),
                        start_ns,
                    )
                )
                if terms.exposed:
                    likelihood = merge_log_likelihood(terms, self._settings.rate_error)
                    return node_weights(terms.speeds, likelihood)
        return node_weights(SPEEDS[1:], np.zeros(SPEEDS.size - 1))
