"""Trays whose decay cannot be read, since too little is known: contacts are, and their words.

Tested by ``test/pipeline/test_contact_stages.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import require_measurable
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.pipeline.contact_words import contact_lines, length_unit, motion_line
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import Notice, TrayImage
from nanorocks_ros.stages.contact_restitution.contact_estimator import ContactEstimator
from nanorocks_ros.stages.contact_restitution.contact_measurement import (
    ContactMeasurement,
    Measurement,
)
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# Contacts at which the restitutions are first said, and the growth at which they are again.
_FIRST_CONTACTS, _GROWTH = 5, 2


def reason_for_contacts(settings: PipelineSettings, tray: Tray) -> str:
    """Why the decay of a tray cannot be read, so that contacts are all there is; or nothing."""
    film = film_section(settings.trays_file)
    if film is not None and not film.container_known:
        return 'the trays file does not tell the container'
    try:
        require_measurable(tray)
        if settings.cooling.relation == 'library' and not settings.cooling.decay_library:
            # A library that is told must be one.
            library_of(tray)
    except ConfigurationError as error:
        return str(error)
    return ''


def measurement_of(settings: PipelineSettings, tray: Tray) -> TrayMeasurement | OpenMeasurement:
    """The stage that measures a tray from its images."""
    reason = reason_for_contacts(settings, tray)
    return OpenMeasurement(settings, tray, reason) if reason else TrayMeasurement(settings, tray)


def estimator_of(
    settings: PipelineSettings, tray: Tray
) -> RestitutionEstimator | ContactEstimator:
    """The stage that estimates the restitutions of a tray from what was measured."""
    if reason_for_contacts(settings, tray):
        return ContactEstimator(settings, tray)
    return RestitutionEstimator(settings, tray)


class OpenMeasurement(ContactMeasurement):
    """Measures contacts, and says what they tell with notices, as `nanorocks measure` does.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    reason : str
        Why there are contacts only.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray, reason: str) -> None:
        film = film_section(settings.trays_file)
        is_known = tray.dimensions[2] > 0.0 and (film is None or film.container_known)
        self._unit = length_unit(film)
        self._number = tray.number
        self._reason: str | None = reason
        super().__init__(settings, tray, container_known=is_known)

    def _restart(self, stamp_ns: int | None = None) -> None:
        self._next_words = _FIRST_CONTACTS
        super()._restart(stamp_ns)

    def _process(self, record: TrayImage) -> tuple[Measurement, ...]:
        results = super()._process(record)
        notices: list[Notice] = []
        if self._reason is not None:
            text = f'tray {self._number}: restitutions are those of contacts alone: '
            notices = [Notice(stamp_ns=record.stamp_ns, text=f'{text}{self._reason}')]
            self._reason = None
        if self.contacts >= self._next_words:
            self._next_words = _GROWTH * self.contacts
            notices += self._words(record.stamp_ns)
        return (*notices, *results)

    def flush(self) -> tuple[Measurement, ...]:
        """See `ContactMeasurement.flush`; with all that was measured, in words."""
        return (*super().flush(), *self._words(self._last_ns or 0))

    def _words(self, stamp_ns: int) -> list[Notice]:
        """The lines of `nanorocks measure`."""
        contacts = self.summary()
        lines = [
            motion_line(self.ends, contacts, self._unit, self.highest),
            *contact_lines(contacts, self._unit),
        ]
        return [Notice(stamp_ns=stamp_ns, text=f'tray {self._number}: {line}') for line in lines]
