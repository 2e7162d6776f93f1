"""Documented use of the Python interface, checked by mypy and never run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
from matplotlib.figure import Figure

import nanorocks_ros as nr

if TYPE_CHECKING:
    from typing_extensions import assert_type


def measure() -> None:
    film = nr.measure('film.mp4', diameter_px=31, count=[15], sides_mm=(15.0, 15.0))
    assert_type(film, nr.MeasureResult)
    assert_type(film.contacts, pd.DataFrame)
    assert_type(film.cor, pd.DataFrame)
    assert_type(film.plot(), Figure)
    assert_type(film.folder, Path)
    assert_type(film.decay, nr.AnalysisResult | None)


def analyse() -> None:
    cycles = nr.analyse([Path('a'), 'b'], trays=[1], settings={'cooling.duration': 15})
    assert_type(cycles, nr.AnalysisResult)
    assert_type(cycles.speeds, pd.DataFrame)
    assert_type(cycles.table('merge'), pd.DataFrame)
    assert_type(nr.read('results'), nr.AnalysisResult | nr.MeasureResult | nr.TablesResult)


def simulate() -> None:
    runs = nr.simulate(tray=1, restitution=0.89, seed=1, film='film.avi')
    assert_type(runs, nr.SimulationResult)
    assert_type(nr.track('film.avi', diameter_px=(20, 31)).tracks, pd.DataFrame)


def wrong() -> None:
    nr.track('film.avi', diameter='31')  # type: ignore[call-arg]
    nr.analyze('film.avi')  # type: ignore[attr-defined]


def errors() -> str:
    try:
        measure()
    except nr.NanorocksError as error:
        return error.do
    return ''
