"""Restitutions by contacts alone while the recording goes on.

Tested by ``test/stages/contact_restitution/test_contact_measurement.py``.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.inference.contacts_alone import contacts_alone
from nanorocks_ros.records import (
    NS,
    ContactOrFlight,
    CorEstimate,
    CorRelation,
    CorStatus,
    FreeFlight,
    Headline,
    Interval,
    Merge,
    PairCollision,
    Rebound,
    SpeedEstimate,
)
from nanorocks_ros.stages.contact_restitution.collision_reach import with_seen_reach
from nanorocks_ros.stages.restitution.cycle_restitution import UNDETERMINED
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.contacts_alone import RestitutionOfContacts
    from nanorocks_ros.settings import PipelineSettings

# The estimate is of the last contacts and flights, so many.
_MOST_CONTACTS = 2_000
ContactInput = SpeedEstimate | ContactOrFlight | Merge


class ContactEstimator(RestartingStage[ContactInput, CorEstimate]):
    """Estimates the restitutions of beads and walls from the contacts so far, and nothing else.

    While contacts come in there is an estimate with the next speed, every `update_interval`. A
    speed whose stamp goes back starts all afresh.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    clock = SpeedEstimate

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings
        self._tray = tray
        self._contacts: deque[ContactOrFlight] = deque(maxlen=_MOST_CONTACTS)
        self.reset()

    def adopt(self, settings: PipelineSettings) -> None:
        """Estimate with other settings from now on."""
        self._settings = settings
        self._is_new = bool(self._contacts)

    def _restart(self, stamp_ns: int | None = None) -> None:
        # Contacts arrive behind the speeds of their time: all are of the time before.
        del stamp_ns
        self._contacts.clear()
        self._is_new = False
        self._estimated_ns: int | None = None
        self._stamp_ns = 0

    def _process(self, record: ContactInput) -> tuple[CorEstimate, ...]:
        if isinstance(record, Merge):
            return ()
        if not isinstance(record, SpeedEstimate):
            self._contacts.append(record)
            self._is_new = True
            return ()
        self._stamp_ns = record.stamp_ns
        interval_ns = round(self._settings.cooling.update_interval * NS)
        waits = self._estimated_ns is not None and (
            record.stamp_ns < self._estimated_ns + interval_ns
        )
        if waits or not self._is_new:
            return ()
        self._is_new, self._estimated_ns = False, record.stamp_ns
        return (self._estimate(CorStatus.COOLING),)

    def flush(self) -> tuple[CorEstimate, ...]:
        """The last estimate, of all contacts."""
        return (self._estimate(CorStatus.FINAL),) if self._contacts else ()

    def _estimate(self, status: CorStatus) -> CorEstimate:
        cooling = self._settings.cooling
        contacts = [record for record in self._contacts if not isinstance(record, FreeFlight)]
        height_known = not math.isnan(self._tray.dimensions[2])
        if not height_known:
            contacts = with_seen_reach(contacts)
        flights = [record for record in self._contacts if isinstance(record, FreeFlight)]
        alone = contacts_alone(
            contacts,
            flights,
            self._settings.prior,
            cooling.probability,
            sides=self._tray.dimensions[:2],
            height_known=height_known,
            each_wall=False,
        )
        beads, walls = _interval(alone.beads), _interval(alone.walls)
        is_known = math.isfinite(beads.value) or math.isfinite(walls.value)
        return CorEstimate(
            stamp_ns=self._stamp_ns,
            tray=self._tray.number,
            cycle=0,
            status=status if is_known else CorStatus.UNDETERMINED,
            relation=CorRelation.LIBRARY,
            restitution=beads if math.isfinite(beads.value) else UNDETERMINED,
            wall_restitution=walls,
            contact_restitution=beads,
            contact_wall_restitution=walls,
            headline=Headline.CONTACTS if is_known else Headline.UNKNOWN,
            rebounds=sum(isinstance(contact, Rebound) for contact in contacts),
            collisions=sum(isinstance(contact, PairCollision) for contact in contacts),
            drag=alone.drag,
            restitution_lower_68=alone.beads.lower_68,
            restitution_upper_68=alone.beads.upper_68,
            wall_restitution_lower_68=alone.walls.lower_68,
            wall_restitution_upper_68=alone.walls.upper_68,
        )


def _interval(value: RestitutionOfContacts) -> Interval:
    interval = value.restitution
    return Interval(value=interval.value, lower=interval.lower, upper=interval.upper)
