"""What ``nanorocks simulate`` says about its runs: one JSON object, or a table for people."""

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


def as_json(found: SimulatedRuns) -> dict[str, Any]:
    """The runs as plain values, in SI units, None for what is not known.

    Curves are means over the runs, with their standard errors; events are those of all runs.
    """
    plan = found.plan
    curves: dict[str, Any] = {name: found.mean(name).tolist() for name in (*_SPEEDS, 'bodies')}
    for name in _SPEEDS:
        error = found.error(name)
        curves[f'{name}_error'] = None if error is None else error.tolist()
    return {
        'tray': plan.settings.tray,
        'runs': plan.runs,
        'seed': plan.settings.seed,
        'version': __version__,
        'settings': asdict(plan.settings),
        'duration': plan.duration,
        'beads': plan.tray.count,
        'filling_factor': found.filling_factor,
        'events': found.events,
        **{name: found.count(kind) for name, kind in _NAMES.items()},
        'cpu_seconds': found.cpu_seconds,
        'half_time': found.half_time,
        'time': plan.times.tolist(),
        **curves,
    }


def as_table(found: SimulatedRuns, written: list[str]) -> str:
    """The runs in a few lines, in mm/s."""
    plan = found.plan
    speed = found.mean('mean_speed') * _MM
    half = found.half_time
    rows = {
        'tray': f'{plan.settings.tray}',
        'beads': f'{plan.tray.count}',
        'filling factor': f'{found.filling_factor:.3f}',
        'runs': f'{plan.runs}, seed {plan.settings.seed}',
        'events': _events(found),
        'mean speed': f'{speed[0]:.3g} mm/s at the start, {speed[-1]:.3g} mm/s after '
        f'{plan.duration:g} s',
        'half that speed': f'not within {plan.duration:g} s' if half is None else f'{half:.3g} s',
        'bodies at end': f'{round(found.mean("bodies")[-1], 1):g}',
        'processor time': f'{found.cpu_seconds:.3g} s',
    }
    if written:
        rows['written'] = ', '.join(written)
    return '\n'.join(f'{name:17}{text}' for name, text in rows.items())


def _events(found: SimulatedRuns) -> str:
    kinds = {
        'collisions of beads': found.count('pair'),
        'with walls': found.count('wall'),
        'merges': found.count('merge'),
        'stuck to a wall': found.count('fix'),
    }
    parts = ', '.join(f'{count} {name}' for name, count in kinds.items() if count)
    return f'{found.events}' + (f' ({parts})' if parts else '')
