"""Compares all rulers of the image scale of a tray: what was told, beads, contacts and walls.

docs/method/scale.md describes the rulers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Notice, PairCollision, Quality, Tracks
from nanorocks_ros.stages.scale.bead_radii import alike, measurable, radius_scale
from nanorocks_ros.stages.scale.contact_distances import contact_scale, is_flat
from nanorocks_ros.stages.scale.rulers import AXES, Ruler, flag_of
from nanorocks_ros.stages.scale.scale_words import disagreement
from nanorocks_ros.stages.scale.turning_points import TurningPoints
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings, PreprocessSettings

_NS = 1e9
# The rulers are compared once in so many seconds, more rarely after some time: nothing new comes.
_SOON, _GROWTH, _RARELY = 1.0, 1.25, 30.0
# Time that a notice waits for other rulers, [s].
_PATIENCE = 20.0
# Pictures between two whose radii are kept, and pictures and contacts that are kept.
_EVERY, _KEPT_PICTURES, _KEPT_CONTACTS = 5, 100, 400
_LEAST_PICTURES = 4
# Of a wall, whose place is that where beads turned: of the dimensions in the trays file.
_WALL_BIAS = 0.002
# Rounding of a region to whole pixels, one standard error of its width, [px].
_ROUNDING_PX = 0.5


class ScaleCheck(RestartingStage[Tracks | PairCollision, Notice]):
    """Compares the rulers of one tray and says in words which disagree.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    flag : Quality
        WRONG_SCALE when two rulers differ by more than 5 %, DOUBTFUL_SCALE by more than 2 %.
    rulers : tuple of Ruler
        As of the last comparison.
    """

    clock = Tracks

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.preprocess
        self._tray = tray
        self._told = told_rulers(settings.preprocess, settings.trays, tray)
        self._said = False
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        del stamp_ns
        self.flag = flag_of(self._told)
        self.rulers: tuple[Ruler, ...] = self._told
        self._frames = 0
        self._pictures = 0
        self._first_ns: int | None = None
        self._next = _SOON
        self._flagged_at = math.inf
        self._misplaced = False
        # Radii and their errors, (2, n), in some pictures.
        self._radii: list[list[np.ndarray]] = [[] for _ in self._tray.species]
        self._contacts: list[tuple[int, float, float]] = []
        self._turns = TurningPoints(0.5 * self._tray.diameter)

    def _process(self, record: Tracks | PairCollision) -> tuple[Notice, ...]:
        if isinstance(record, PairCollision):
            self._add_contact(record)
            return ()
        if self._first_ns is None:
            self._first_ns = record.stamp_ns
        # The preprocessor has said so already, and why.
        self._misplaced = bool(record.quality & Quality.WRONG_SCALE)
        if not record.quality & Quality.STABILISATION_LOST:
            self._turns.push(record)
        self._add_radii(record)
        age = (record.stamp_ns - self._first_ns) / _NS
        if age < self._next:
            return ()
        self._next = min(max(_GROWTH * age, age + _SOON), age + _RARELY)
        self._compare()
        return self._notice(record.stamp_ns, age)

    def flush(self) -> tuple[Notice, ...]:
        """Compare once more, with all that came in."""
        self._compare()
        return self._notice(self._last_ns or 0, math.inf)

    def _add_contact(self, pair: PairCollision) -> None:
        first, second = pair.species.tolist()
        if first != second or len(self._contacts) >= _KEPT_CONTACTS:
            return
        diameter = self._tray.species[first].diameter
        distance = math.hypot(*pair.separation.tolist()) / diameter
        self._contacts.append((first, distance, pair.separation_error / diameter))

    def _add_radii(self, tracks: Tracks) -> None:
        self._frames += 1
        if self._frames % _EVERY or self._pictures >= _KEPT_PICTURES:
            return
        self._pictures += 1
        for k, radii in enumerate(self._radii):
            own = tracks.seen & (tracks.species == k)
            radii.append(np.stack([tracks.radii[own], tracks.radius_errors[own]]))

    def _compare(self) -> None:
        rulers = [*self._told, *self._by_radii(), *self._by_contacts(), *self._by_walls()]
        self.rulers = tuple(rulers)
        self.flag = flag_of(rulers)

    def _notice(self, stamp_ns: int, age: float) -> tuple[Notice, ...]:
        if not self.flag or self._misplaced:
            self._flagged_at = math.inf
            return ()
        self._flagged_at = min(self._flagged_at, age)
        sources = [ruler.source for ruler in self.rulers]
        complete = 'beads' in sources and sources.count('walls') == len(AXES)
        if self._said or not (complete or age >= self._flagged_at + _PATIENCE):
            return ()
        self._said = True
        text = disagreement(self.rulers, self._tray, self._settings)
        return (Notice(stamp_ns=stamp_ns, text=text),)

    def _by_radii(self) -> list[Ruler]:
        if self._pictures < _LEAST_PICTURES:
            return []
        rulers = []
        for species, radii in zip(self._tray.species, self._radii, strict=True):
            if not measurable(self._tray, species):
                continue
            values, errors = np.concatenate(radii, axis=1)
            scale = radius_scale(species, values, errors, self._pictures)
            if scale is not None:
                name = f'radii of {species.material} beads'
                rulers.append(Ruler(name=name, source='beads', ratio=scale[0], error=scale[1]))
        return rulers

    def _by_contacts(self) -> list[Ruler]:
        rulers = []
        for k, species in enumerate(self._tray.species):
            if not alike(species) or not is_flat(species.diameter, self._tray.dimensions[2]):
                continue
            own = np.array([contact[1:] for contact in self._contacts if contact[0] == k])
            if not own.size:
                continue
            room = self._tray.dimensions[2] / species.diameter - 1.0
            scale = contact_scale(own[:, 0], own[:, 1], room)
            if scale is not None:
                name = f'distances of {species.material} beads at contact'
                rulers.append(Ruler(name=name, source='beads', ratio=scale[0], error=scale[1]))
        return rulers

    def _by_walls(self) -> list[Ruler]:
        rulers = []
        for axis in range(2):
            length = self._tray.dimensions[axis]
            width = self._turns.width(axis, length)
            if width is not None:
                error = math.hypot(width[1] / length, _WALL_BIAS)
                name = f'rebounds from the walls along {AXES[axis]}'
                ratio = width[0] / length
                rulers.append(Ruler(name=name, source='walls', ratio=ratio, error=error))
        return rulers


def told_rulers(
    settings: PreprocessSettings, trays: tuple[int, ...], tray: Tray
) -> tuple[Ruler, ...]:
    """The scale that was told, and that by the region of the tray where one was told."""
    scale = settings.calibration or 'preprocess.pixels_per_metre'
    rulers = [Ruler(name=scale, source='told', ratio=1.0, error=1e-6)]
    if settings.regions_px and tray.number in trays:
        first = 4 * trays.index(tray.number)
        for axis in range(2):
            size = settings.regions_px[first + 2 + axis]
            ratio = size / (tray.dimensions[axis] * settings.pixels_per_metre)
            name = f'the region along {AXES[axis]}'
            error = _ROUNDING_PX / max(size, 1)
            rulers.append(Ruler(name=name, source='told', ratio=ratio, error=error))
    return tuple(rulers)
