"""Errors of displacements, from those of the places at their ends and straight flights.

Tested by ``test/stages/tracking/test_mean_speed.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.stages.tracking.displacements import PlaceNoise, TrackSeries, position_noise
from nanorocks_ros.stages.tracking.flight_deviations import PATHS_PX, FlightDeviations

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

_NS = 1e9


class DisplacementErrors:
    """Learns from the tracks of a tray how much the errors at the ends of a path differ.

    Parameters
    ----------
    tray : Tray
    pixels_per_metre : float, [px/m]
    """

    def __init__(self, tray: Tray, pixels_per_metre: float) -> None:
        pixel = 1.0 / pixels_per_metre
        self._deviations = [
            FlightDeviations(0.5 * species.diameter / pixel, pixel) for species in tray.species
        ]
        self._first_ns: int | None = None

    def push(self, tracks: Tracks) -> None:
        """Take the tracks of the next frame."""
        if self._first_ns is None:
            self._first_ns = tracks.stamp_ns
        time = (tracks.stamp_ns - self._first_ns) / _NS
        places = tracks.positions + tracks.displacement
        for species, deviations in enumerate(self._deviations):
            own = tracks.seen & (tracks.species == species)
            deviations.push(time, tracks.ids[own], places[own], tracks.position_errors[own])

    def noise(self, recent: TrackSeries, species: int) -> PlaceNoise:
        """Noise of the displacements of a species, or of all.

        Parameters
        ----------
        recent : TrackSeries
            The last frames, from which the jitter between frames is measured.
        species : int
            Index of the species, or `ALL_SPECIES`.
        """
        lengths = np.zeros((len(self._deviations), len(PATHS_PX)))
        shares = np.zeros_like(lengths)
        for row, deviations in enumerate(self._deviations):
            known = deviations.known()
            for column in range(len(PATHS_PX) if known else 0):
                length, factor = known[min(column, len(known) - 1)]
                lengths[row, column], shares[row, column] = length, factor * factor
        return PlaceNoise(position_noise(recent, species), lengths, shares)
