"""Coefficient of restitution, with its interval, from films of a granular gas.

Five lines take a film to its contacts and the restitution::

    import nanorocks_ros as nr
    film = nr.measure('film.mp4', diameter_px=31)
    film.contacts
    film.cor
    film.plot()

Everything in `__all__` is public and stable; it is loaded when it is first used.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from nanorocks_ros.limits import bound_opencv

if TYPE_CHECKING:
    from nanorocks_ros.errors import ConfigurationError as ConfigurationError
    from nanorocks_ros.errors import FitError as FitError
    from nanorocks_ros.errors import FrameError as FrameError
    from nanorocks_ros.errors import NanorocksError as NanorocksError
    from nanorocks_ros.errors import RecordingError as RecordingError
    from nanorocks_ros.errors import SimulationError as SimulationError
    from nanorocks_ros.interface.analysis import analyse as analyse
    from nanorocks_ros.interface.inputs import FilmDescription as FilmDescription
    from nanorocks_ros.interface.measuring import measure as measure
    from nanorocks_ros.interface.reading import read as read
    from nanorocks_ros.interface.results.analysis_result import AnalysisResult as AnalysisResult
    from nanorocks_ros.interface.results.measure_result import MeasureResult as MeasureResult
    from nanorocks_ros.interface.results.simulation_result import (
        SimulationResult as SimulationResult,
    )
    from nanorocks_ros.interface.results.tables_result import TablesResult as TablesResult
    from nanorocks_ros.interface.simulating import simulate as simulate
    from nanorocks_ros.interface.tracking import TrackResult as TrackResult
    from nanorocks_ros.interface.tracking import track as track

__version__ = '0.1.0'

__all__ = [
    'AnalysisResult',
    'ConfigurationError',
    'FilmDescription',
    'FitError',
    'FrameError',
    'MeasureResult',
    'NanorocksError',
    'RecordingError',
    'SimulationError',
    'SimulationResult',
    'TablesResult',
    'TrackResult',
    '__version__',
    'analyse',
    'measure',
    'read',
    'simulate',
    'track',
]

_MODULES = {
    'AnalysisResult': 'interface.results.analysis_result',
    'ConfigurationError': 'errors',
    'FilmDescription': 'interface.inputs',
    'FitError': 'errors',
    'FrameError': 'errors',
    'MeasureResult': 'interface.results.measure_result',
    'NanorocksError': 'errors',
    'RecordingError': 'errors',
    'SimulationError': 'errors',
    'SimulationResult': 'interface.results.simulation_result',
    'TablesResult': 'interface.results.tables_result',
    'TrackResult': 'interface.tracking',
    'analyse': 'interface.analysis',
    'measure': 'interface.measuring',
    'read': 'interface.reading',
    'simulate': 'interface.simulating',
    'track': 'interface.tracking',
}

# Before the first import of OpenCV, which reads its limit only once.
bound_opencv()

if not TYPE_CHECKING:
    # A type checker reads the imports above; with this it would take any name for one of ours.
    def __getattr__(name: str) -> object:
        """A public name, from its module."""
        if name not in _MODULES:
            # With the module, Python names the attribute that comes nearest.
            reason = f'module {__name__!r} has no attribute {name!r}'
            raise AttributeError(reason, name=name, obj=sys.modules[__name__])
        from importlib import import_module

        value = getattr(import_module(f'{__name__}.{_MODULES[name]}'), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """The public names, loaded or not, for completion."""
        return sorted({*globals(), *__all__})
