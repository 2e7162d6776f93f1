"""The results of each cycle in lines of text: for a terminal.

Tested by ``test/studies/analysis/results/test_cycle_words.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.outputs.html_report import with_error
from nanorocks_ros.records import (
    Headline,
    Quality,
)
from nanorocks_ros.records.result_words import (
    METHODS,
    RELATIONS,
    fitted,
    reason_of,
)
from nanorocks_ros.studies.analysis.results.cycle_words import (
    UsedSpeeds,
    flags_of_cycle,
    headline_words,
    sticking_words,
)

if TYPE_CHECKING:
    from nanorocks_ros.records import (
        ClusterEstimate,
        CorEstimate,
        Interval,
        Measured,
    )

_MM, _MICRO = 1e3, 1e6


def cycle_lines(
    cor: CorEstimate, clusters: ClusterEstimate | None, used: UsedSpeeds, *, left_out: bool
) -> list[str]:
    """A cycle in lines for the terminal: the restitution first, then what it rests on."""
    lines = [f'cycle {cor.cycle}: {_cor_text(cor)}']
    reason = reason_of(cor)
    if reason is not None:
        lines.append(f'  reason: {reason.text}; {reason.remedy}')
    lines += _source_lines(cor)
    lines += _exponent_lines(cor)
    lines += _flight_lines(cor)
    lines += _decay_lines(cor)
    if cor.samples or cor.rebounds or cor.collisions:
        lines.append(f'  used: {_used_text(cor, used)}')
    if clusters is not None:
        lines.append(f'  sticking: {sticking_words(clusters)}')
        lines += _clusters_lines(clusters)
    for flag in flags_of_cycle(cor, clusters, used):
        number = used.flags.get(flag.name)
        part = f' ({number} of {cor.samples} speeds)' if number else ''
        name = flag.name.replace('_', ' ')
        lines.append(f'  flag {name}{part}: {flag.text}; {flag.remedy}')
    if left_out:
        lines.append(
            '  the decay is left out of all cycles; pass --include-inconsistent to count it'
        )
    return lines


def _cor_text(cor: CorEstimate) -> str:
    state = cor.status.name.lower()
    walls = ''
    if math.isfinite(cor.wall_restitution.value):
        walls = f', walls {_interval(cor.wall_restitution, 3)}'
    if reason_of(cor) is not None:
        return f'COR unknown{walls} ({state.replace("_", " ")})'
    return (
        f'COR {_interval(cor.restitution, 4)}{walls} '
        f'({cor.relation.name.lower()}, {state}: {RELATIONS[cor.relation]})'
    )


def _source_lines(cor: CorEstimate) -> list[str]:
    """What each source says, where there is more than one."""
    if cor.headline not in (Headline.JOINT, Headline.CONTACTS):
        return []
    sources = (
        ('decay', cor.decay_restitution, cor.decay_wall_restitution),
        ('contacts', cor.contact_restitution, cor.contact_wall_restitution),
        ('both', cor.joint_restitution, cor.joint_wall_restitution),
    )
    parts = [
        f'{name} {_known_interval(beads, 3)}, walls {_known_interval(walls, 3)}'
        for name, beads, walls in sources
    ]
    lines = [f'  from {headline_words(cor)}', f'  alone: {"; ".join(parts)}']
    if cor.wall_friction.known:
        lines.append(
            f'  friction of the walls: {cor.wall_friction.value:.4f} '
            f'+- {cor.wall_friction.error:.4f}'
        )
    return lines


def _exponent_lines(cor: CorEstimate) -> list[str]:
    """How the restitutions go with the impact speed; nothing where contacts do not tell it."""
    kinds = [
        (name, exponent, restitution, speed)
        for name, exponent, restitution, speed in (
            ('beads', cor.restitution_exponent, cor.impact_restitution, cor.impact_speed),
            (
                'walls',
                cor.wall_restitution_exponent,
                cor.wall_impact_restitution,
                cor.wall_impact_speed,
            ),
        )
        if math.isfinite(exponent.value)
    ]
    if not kinds:
        return []
    seen = Quality.SPEED_DEPENDENT in cor.quality
    parts = [
        f'{name} {_interval(exponent, 2)} at {_MM * speed:.2f} mm/s'
        for name, exponent, _, speed in kinds
    ]
    lines = [
        f'  restitution {"seems to depend" if seen else "need not depend"} on the impact speed; '
        f'exponent of 1 - restitution: {", ".join(parts)}'
    ]
    if seen:
        at_speeds = ', '.join(
            f'{name} {_interval(restitution, 3)}' for name, _, restitution, _ in kinds
        )
        lines.append(
            f'  by that law, at these speeds: {at_speeds}; the COR above loses as much energy in '
            'the contacts that were seen'
        )
    elif cor.headline is Headline.JOINT and cor.restitution != cor.joint_restitution:
        lines.append('  the interval of the beads allows for such a law, as the contacts do')
    return lines


def _flight_lines(cor: CorEstimate) -> list[str]:
    """What slows or drives the beads between contacts; nothing where no flight told it."""
    if not (cor.drag.known and math.isfinite(cor.acceleration.upper)):
        return []
    return [
        f'  in flight: drag {cor.drag.value:.4f} +- {cor.drag.error:.4f} /s, acceleration below '
        f'{_MICRO * cor.acceleration.upper:.1f} um/s^2'
    ]


def _known_interval(interval: Interval, digits: int) -> str:
    return _interval(interval, digits) if math.isfinite(interval.value) else 'unknown'


def _interval(interval: Interval, digits: int) -> str:
    value, lower, upper = (
        f'{number:.{digits}f}' for number in (interval.value, interval.lower, interval.upper)
    )
    return f'{value} [{lower}, {upper}]'


def _decay_lines(cor: CorEstimate) -> list[str]:
    """Haff's law of the decay; nothing where the decay does not determine it."""
    lines = []
    if fitted(cor.initial_speed) and fitted(cor.haff_time):
        paper = ''
        if math.isfinite(cor.paper_restitution):
            paper = f'; the closed form of the paper makes it {cor.paper_restitution:.3f}'
        lines.append(f"  Haff's law: {_haff_text(cor.initial_speed, cor.haff_time)}{paper}")
    for name, speed, time in zip(
        ('first', 'second'),
        cor.species_initial_speeds,
        cor.species_haff_times,
        strict=False,
    ):
        if fitted(speed) and fitted(time):
            lines.append(f'  {name} species: {_haff_text(speed, time)}')
    return lines


def _haff_text(speed: Measured, time: Measured) -> str:
    """Speed at the start and Haff time, with their standard errors."""
    speed_text = with_error(speed.value, speed.error, _MM)
    time_text = with_error(time.value, time.error)
    return f'v0 {speed_text} mm/s, tau {time_text} s'.replace('±', '+-')


def _used_text(cor: CorEstimate, used: UsedSpeeds) -> str:
    counts = used.methods.most_common()
    methods = ' and '.join(METHODS[method] for method, _ in counts)
    by_methods = f' by {methods}' if methods else ''
    window = ''
    if math.isfinite(cor.window_start):
        window = f' from {cor.window_start:.1f} to {cor.window_end:.1f} s after the shaking event'
    of_bodies = f' ({cor.body_rebounds} of bodies)' if cor.body_rebounds else ''
    contacts = f', {cor.rebounds} rebounds{of_bodies}, {cor.collisions} collisions'
    if math.isfinite(cor.onset):
        contacts += f', beads stick from {cor.onset:.1f} s on'
    tension = ''
    if math.isfinite(cor.tension) and (cor.rebounds or cor.collisions):
        tension = f'; they and the decay differ by {cor.tension:.1f} standard deviations'
    return f'{cor.samples} speeds{by_methods}{window}{contacts}{tension}'


def _clusters_lines(clusters: ClusterEstimate) -> list[str]:
    size = clusters.combined_size
    if not (math.isfinite(size.value) and math.isfinite(clusters.bodies.value)):
        return []
    return [
        f'  at the end: {clusters.bodies.value:.0f} bodies (beads or clusters); on average a bead '
        f'belongs to a body of {size.value:.2f}'
    ]
