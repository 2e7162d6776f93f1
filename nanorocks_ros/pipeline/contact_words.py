"""What contacts say, in words: a line for each result, or the reason why there is none.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.outputs.html_report import number, with_interval
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.records import WALL_NAMES

if TYPE_CHECKING:
    from nanorocks_ros.experiment.film_section import FilmSection
    from nanorocks_ros.inference.contacts_alone import RestitutionOfContacts
    from nanorocks_ros.stages.contact_restitution.track_contacts import TrackContacts

_STANDARD_GRAVITY = 9.80665
# Ratio to the speeds at the ends of the film above which the highest is told.
_MUCH_HIGHER = 1.5


class LengthUnit(NamedTuple):
    """Unit in which lengths are told.

    Parameters
    ----------
    name : str
    per_metre : float
    """

    name: str = 'mm'
    per_metre: float = 1e3


def length_unit(film: FilmSection | None) -> LengthUnit:
    """Millimetres, or pixels where no length is known."""
    if film is not None and not film.scale_known:
        return LengthUnit('px', film.pixels_per_metre)
    return LengthUnit()


def motion_line(
    ends: tuple[float, float],
    contacts: TrackContacts,
    unit: LengthUnit,
    highest: float = math.nan,
) -> str:
    """How the beads move: speeds at first and last, and the acceleration that they share.

    Parameters
    ----------
    ends : tuple of 2 floats, [m/s]
        Mean speeds at the ends of the film.
    contacts : TrackContacts
    unit : LengthUnit
    highest : float, [m/s]
        The highest mean speed; NaN where it is not known.
    """
    first, last = (number(speed, 3, unit.per_metre) for speed in ends)
    text = f'mean speed {first} {unit.name}/s at first, {last} {unit.name}/s at last'
    # As of a tray that is shaken some time after the film begins.
    if highest > _MUCH_HIGHER * max(ends):
        text += f', at most {number(highest, 3, unit.per_metre)} {unit.name}/s'
    acceleration = contacts.acceleration
    if not acceleration.pieces:
        return f'{text}; flights are too short to show an acceleration'
    size, error = (
        number(value, 3, unit.per_metre) for value in (acceleration.size, acceleration.error)
    )
    if not acceleration.is_seen:
        return f'{text}; no acceleration between contacts (below {error} {unit.name}/s^2)'
    share = acceleration.size / _STANDARD_GRAVITY
    of_gravity = f', {number(share)} of gravity' if unit.name == 'mm' else ''
    return (
        f'{text}; free beads accelerate by {size} +- {error} {unit.name}/s^2{of_gravity} '
        f'{_direction(acceleration.value)}; contacts are corrected for it'
    )


def _direction(value: tuple[float, float]) -> str:
    """Where an acceleration points in the picture."""
    x, y = value
    if abs(x) > abs(y):
        return 'to the right' if x > 0.0 else 'to the left'
    return 'down the picture' if y > 0.0 else 'up the picture'


def contact_lines(contacts: TrackContacts, unit: LengthUnit) -> list[str]:
    """Counts of the contacts, and the restitutions that follow from them alone."""
    collisions, rebounds = len(contacts.collisions), len(contacts.rebounds)
    alone = contacts.alone
    lines = [
        f'{counted(collisions, "collision")} of two beads, '
        f'{counted(rebounds, "rebound")} from walls, in {counted(contacts.frames, "frame")}'
    ]
    if collisions:
        lines.append(f'beads, by collisions alone: {restitution_text(alone.beads, unit)}')
    else:
        lines.append(f'beads: no restitution; {_no_collisions(contacts)}')
    if rebounds:
        lines.append(f'walls, by rebounds alone: {restitution_text(alone.walls, unit)}')
    else:
        lines.append(f'walls: no restitution; {_no_rebounds(contacts)}')
    if len(alone.by_wall) > 1 or contacts.acceleration.is_seen:
        lines += [
            f'{wall_name(contacts, wall)}: {restitution_text(value, unit)}'
            for wall, value in alone.by_wall.items()
        ]
    return lines


def wall_name(contacts: TrackContacts, wall: int) -> str:
    """A wall by its place in the picture; `floor` where beads fall towards it."""
    axis, high = divmod(wall, 2)
    x, y = contacts.acceleration.correction
    down = (x, y)[axis] * (1.0 if high else -1.0)
    along = abs((x, y)[axis]) > abs((x, y)[1 - axis])
    return 'floor' if down > 0.0 and along else f'{WALL_NAMES[wall]} wall'


def restitutions(contacts: TrackContacts) -> dict[str, RestitutionOfContacts]:
    """What the contacts say of beads, of all walls, and of each wall, by name."""
    alone = contacts.alone
    walls = {wall_name(contacts, wall): value for wall, value in alone.by_wall.items()}
    return {'beads': alone.beads, 'walls': alone.walls, **walls}


def restitution_text(value: RestitutionOfContacts, unit: LengthUnit) -> str:
    """A restitution with its interval, number of contacts and speed."""
    interval = value.restitution
    at = f'{counted(value.contacts, "contact")}, at {number(value.speed, 3, unit.per_metre)}'
    if math.isnan(interval.value):
        return f'not determined ({at} {unit.name}/s)'
    ends = with_interval(interval.value, (interval.lower, interval.upper))
    return f'{ends} ({at} {unit.name}/s)'


def _no_collisions(contacts: TrackContacts) -> str:
    if contacts.frames == 0:
        return 'no bead was followed'
    return (
        'no two beads were seen to collide with four places each in straight flight before and '
        'after; film more beads, for longer, or at a higher frame rate'
    )


def _no_rebounds(contacts: TrackContacts) -> str:
    if contacts.walls is not None and not contacts.walls.any:
        return (
            'no walls are given, and nowhere did beads turn back three times at one place; '
            '--corners and --sides-mm tell where they are'
        )
    return (
        'no bead was seen to rebound with four places in straight flight before and after; film '
        'for longer, or at a higher frame rate'
    )
