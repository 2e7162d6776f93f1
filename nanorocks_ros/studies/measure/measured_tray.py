"""What was measured of one tray of a film.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.pipeline.contact_words import restitutions

if TYPE_CHECKING:
    from nanorocks_ros.inference.contacts_alone import RestitutionOfContacts
    from nanorocks_ros.pipeline.contact_words import LengthUnit
    from nanorocks_ros.stages.contact_restitution.track_contacts import TrackContacts
    from nanorocks_ros.studies.measure.track_speeds import TrackSpeeds

DECAY_PREFIX = 'decay: '
"""Of the lines that tell of the decay, among others."""
DECAY_NOT_READ = f'{DECAY_PREFIX}not read'
"""How the line begins that says why the decay is not read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredTray:
    """What was measured of one tray.

    Parameters
    ----------
    number : int
    unit : LengthUnit
    speeds : TrackSpeeds
    contacts : TrackContacts
    recognition, lines, decay : tuple of str
        Verdicts on the beads, motion and contacts, and the decay, in words.
    """

    number: int
    unit: LengthUnit
    speeds: TrackSpeeds
    contacts: TrackContacts
    recognition: tuple[str, ...]
    lines: tuple[str, ...]
    decay: tuple[str, ...]

    @property
    def decay_read(self) -> bool:
        """Whether there are results of the decay, in the folder of the tray."""
        return bool(self.decay) and not self.decay[0].startswith(DECAY_NOT_READ)

    def as_json(self) -> dict[str, Any]:
        """Numbers in s and m, or px where no length is known; None where unknown; all lines."""
        contacts, first_last = self.contacts, self.speeds.ends
        scale = 1.0 if self.unit.name != 'px' else self.unit.per_metre
        acceleration = contacts.acceleration
        own = {name: _plain(value, scale) for name, value in restitutions(contacts).items()}
        values = {
            'length_unit': 'm' if self.unit.name != 'px' else 'px',
            'collisions': len(contacts.collisions),
            'rebounds': len(contacts.rebounds),
            'beads': own.pop('beads'),
            'walls': own.pop('walls'),
            'by_wall': own,
            'acceleration': [scale * part for part in acceleration.value],
            'acceleration_error': scale * acceleration.error,
            'accelerated': acceleration.is_seen,
            'first_mean_speed': scale * first_last[0],
            'last_mean_speed': scale * first_last[1],
            'recognition': self.recognition,
            'lines': self.lines,
            'decay': self.decay,
        }
        plain: dict[str, Any] = json_values(values)
        return plain


def _plain(value: RestitutionOfContacts, scale: float) -> dict[str, Any]:
    interval = value.restitution
    return {
        'contacts': value.contacts,
        'restitution': interval.value,
        'restitution_error': interval.error,
        'restitution_lower': interval.lower,
        'restitution_upper': interval.upper,
        'restitution_lower_68': value.lower_68,
        'restitution_upper_68': value.upper_68,
        'speed': scale * value.speed,
    }
