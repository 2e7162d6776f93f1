"""Report of ``nanorocks simulate``: one JSON object, or a table.

Tested by ``test/cli/simulation/test_simulate.py``.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from nanorocks_ros import __version__

if TYPE_CHECKING:
    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRuns

_MM = 1e3
_SPEEDS = 'mean_speed', 'mean_projected_speed'
_NAMES = {
    'pair_collisions': 'pair',
    'wall_collisions': 'wall',
    'merges': 'merge',
    'fixings': 'fix',
    'elastic_contacts': 'elastic_pair',
}


def as_json(runs: SimulatedRuns) -> dict[str, Any]:
    """The runs as values for JSON, in SI units; None where unknown.

    Curves are means over the runs with their standard errors; counts are sums over the runs.
    """
    plan = runs.plan
    curves: dict[str, Any] = {name: runs.mean(name).tolist() for name in (*_SPEEDS, 'bodies')}
    for name in _SPEEDS:
        error = runs.error(name)
        curves[f'{name}_error'] = None if error is None else error.tolist()
    return {
        'tray': plan.settings.tray,
        'runs': plan.runs,
        'seed': plan.settings.seed,
        'version': __version__,
        'settings': asdict(plan.settings),
        'duration': plan.duration,
        'beads': plan.tray.count,
        'filling_factor': runs.filling_factor,
        'events': runs.events,
        **{name: runs.count(kind) for name, kind in _NAMES.items()},
        'cpu_seconds': runs.cpu_seconds,
        'half_time': runs.half_time,
        'time': plan.times.tolist(),
        **curves,
    }


def as_table(runs: SimulatedRuns, written: list[str]) -> str:
    """The runs as a table of a few lines, with speeds in mm/s."""
    plan = runs.plan
    speed = runs.mean('mean_speed') * _MM
    half_time = runs.half_time
    rows = {
        'tray': f'{plan.settings.tray}',
        'beads': f'{plan.tray.count}',
        'filling factor': f'{runs.filling_factor:.3f}',
        'runs': f'{plan.runs}, seed {plan.settings.seed}',
        'events': _events(runs),
        'mean speed': f'{speed[0]:.3g} mm/s at the start, {speed[-1]:.3g} mm/s after '
        f'{plan.duration:g} s',
        'half that speed': f'not within {plan.duration:g} s'
        if half_time is None
        else f'{half_time:.3g} s',
        'bodies at end': f'{round(runs.mean("bodies")[-1], 1):g}',
        'processor time': f'{runs.cpu_seconds:.3g} s',
    }
    if written:
        rows['written'] = ', '.join(written)
    return '\n'.join(f'{name:17}{text}' for name, text in rows.items())


def _events(runs: SimulatedRuns) -> str:
    kinds = {
        'collisions of beads': runs.count('pair'),
        'with walls': runs.count('wall'),
        'merges': runs.count('merge'),
        'stuck to a wall': runs.count('fix'),
        'break-ups': runs.count('break_up'),
    }
    parts = ', '.join(f'{count} {name}' for name, count in kinds.items() if count)
    return f'{runs.events}' + (f' ({parts})' if parts else '')
