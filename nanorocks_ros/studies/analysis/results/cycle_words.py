"""The results of each cycle in words: flags, reasons, contacts, sticking; with remedies."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from nanorocks_ros.records import (
    NS,
    CorStatus,
    Headline,
    SpeedMethod,
    headline_in_words,
)
from nanorocks_ros.records.result_words import (
    NO_SHAKING,
    NO_SPEEDS,
    FlagWords,
    WallPrior,
    Words,
    flags_in_words,
    reason_of,
    size_flag,
    sticking_in_words,
    wall_flag,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from nanorocks_ros.records import (
        ClusterEstimate,
        CorEstimate,
        SpeedEstimate,
    )
    from nanorocks_ros.settings import PriorSettings
    from nanorocks_ros.studies.analysis.offline_analysis import TrayResults

_MM = 1e3


@dataclass(slots=True)
class UsedSpeeds:
    """The speeds of a cooling window: how they were measured, and what was wrong with them.

    Parameters
    ----------
    methods : Counter of SpeedMethod
    flags : Counter of str
        Speeds with each flag, by name.
    walls : WallPrior
        Prior of the restitution of the walls.
    """

    methods: Counter[SpeedMethod] = field(default_factory=Counter)
    flags: Counter[str] = field(default_factory=Counter)
    walls: WallPrior = field(default_factory=WallPrior)


def used_speeds(
    speeds: Iterable[SpeedEstimate],
    cycles: Sequence[CorEstimate],
    walls: WallPrior | None = None,
) -> list[UsedSpeeds]:
    """The speeds in the window of each cycle; the speeds are read once.

    Where time goes back, as in a recording that loops, cycles are counted from 1 again.
    """
    used = [UsedSpeeds(walls=walls or WallPrior()) for _ in cycles]
    places: dict[tuple[int, int], int] = {}
    passes, last_cycle = 0, 0
    for place, cor in enumerate(cycles):
        passes += cor.cycle <= last_cycle
        last_cycle = cor.cycle
        places[passes, cor.cycle] = place
    passes, last_ns = 0, 0
    for speed in speeds:
        passes += speed.stamp_ns < last_ns
        last_ns = speed.stamp_ns
        key = passes, speed.cycle
        if key not in places or speed.cycle_start_ns is None:
            continue
        place = places[key]
        # Half a millisecond is the rounding of window times on the wire.
        age = (speed.stamp_ns - speed.cycle_start_ns) / NS
        if cycles[place].window_start - 5e-4 <= age <= cycles[place].window_end + 5e-4:
            used[place].methods[speed.method] += 1
            used[place].flags.update(speed.quality.names())
    return used


def wall_prior(prior: PriorSettings) -> WallPrior:
    """What is assumed of the walls."""
    return WallPrior(prior.min_wall_restitution, prior.max_wall_restitution)


def is_decay_left_out(cor: CorEstimate, *, include_inconsistent: bool) -> bool:
    """Whether a cycle has a decay that does not count in the means of all cycles."""
    return (
        cor.status in (CorStatus.FINAL, CorStatus.UNDETERMINED)
        and cor.headline is Headline.CONTACTS
        and math.isfinite(cor.window_end)
        and not include_inconsistent
    )


def cycle_as_json(
    cor: CorEstimate, clusters: ClusterEstimate | None, used: UsedSpeeds
) -> dict[str, Any]:
    """Flags, reason, contacts and sticking of a cycle, in words and numbers."""
    reason = reason_of(cor)
    return {
        'flags': [
            {**flag._asdict(), 'speeds': used.flags.get(flag.name)}
            for flag in flags_of_cycle(cor, clusters, used)
        ],
        'reason': None if reason is None else reason._asdict(),
        'headline': cor.headline.name.lower(),
        'headline_reason': headline_words(cor),
        'contacts': {
            'rebounds': cor.rebounds,
            'body_rebounds': cor.body_rebounds,
            'collisions': cor.collisions,
        },
        'methods': {method.name.lower(): number for method, number in used.methods.items()},
        'sticking': sticking_words(clusters),
    }


def flags_of_cycle(
    cor: CorEstimate, clusters: ClusterEstimate | None, used: UsedSpeeds
) -> list[FlagWords]:
    """Flags of the estimate, and what only its values and those of the clusters tell."""
    others = [
        None if clusters is None else size_flag(clusters.cluster_size, clusters.weighted_size)
    ]
    if reason_of(cor) is None:
        others.append(wall_flag(cor, used.walls))
    return [*flags_in_words(cor.quality), *(flag for flag in others if flag is not None)]


def tray_reason(results: TrayResults) -> Words | None:
    """Why a tray has no cycle with a restitution, determined or not; None where it has one."""
    if results.cors:
        return None
    speeds = results.speeds
    if not speeds:
        return NO_SPEEDS
    last = speeds[-1]
    if last.cycle_start_ns is None:
        return NO_SHAKING
    start = (last.stamp_ns - last.cycle_start_ns) / NS
    beads = last.mean_projected_speed.value
    tray = last.tray_speed
    moves = (
        f': at the end the tray moves at {_MM * tray:.2g} mm/s in the picture, the beads at '
        f'{_MM * beads:.2g} mm/s'
        if math.isfinite(tray) and math.isfinite(beads)
        else ''
    )
    return Words(
        f'a shaking event was seen {start:.1f} s before the end, but no time at which the tray '
        f'was calm{moves}',
        'fix the camera, so that it does not shake, or film until the tray is at rest',
    )


def headline_words(cor: CorEstimate) -> str:
    """What a restitution rests on, in words."""
    return headline_in_words(cor.headline, cor.tension, cor.wall_friction, cor.quality)


def sticking_words(clusters: ClusterEstimate | None) -> str | None:
    """The sticking speed, or what is known of it, in words; None without clusters."""
    if clusters is None:
        return None
    return sticking_in_words(clusters.sticking_status, clusters.sticking_speed, clusters.onset)
