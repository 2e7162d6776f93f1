"""What beads look like in a film: radius, brightness, edges and colours, learnt from it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.stages.tracking.scene.bead_looks import (
    BeadLook,
    Candidates,
    View,
    join_candidates,
)
from nanorocks_ros.stages.tracking.scene.floor_behind import CastShadows, darken, left_behind
from nanorocks_ros.stages.tracking.scene.known_beads import ALIKE, AtRest, KnownBeads
from nanorocks_ros.stages.tracking.scene.lit_views import LitSizes, in_light, shifted
from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import (
    apart,
    colours_of,
    join_outlines,
    marked_shares,
    reduced,
    staying,
)
from nanorocks_ros.stages.tracking.scene.outlines.open_outlines import ends_of_others
from nanorocks_ros.stages.tracking.scene.outlines.outline_search import are_sure, search_outlines
from nanorocks_ros.stages.tracking.scene.roamed_region import (
    MOVING_SHARE,
    RoamedRegion,
    roamed_region,
)
from nanorocks_ros.stages.tracking.scene.scene_picture import SceneColours, enlarged, scene_colours
from nanorocks_ros.stages.tracking.scene.view_search import USUAL, WEAKER, ViewSearch

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines

    OwnDiscs = Callable[[NDArray[np.uint8], NDArray[np.float64]], NDArray[np.bool_]]
    OwnColours = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]

# Share of the outline of a disc to learn from that has edges, and of one that tells what beads
# look like: fingers have less.
_GOOD_SUPPORT, _WHOLE_SUPPORT = 0.7, 0.75
# Moving discs that tell what beads look like, and their share of all discs.
_LEAST_MOVING, _LEAST_MOVING_SHARE = 4, 0.04
# Edges down to this part of the usual step are searched for those of known beads, which are the
# usual ones where they have less than this part of it.
_MUCH_WEAKER = WEAKER[-1], 0.7
# So many frames are searched where fewer discs move.
_FEW_MOVING, _MORE_FRAMES = 24, 50
# Trust in outlines of the difference from the background, over those of the picture itself.
_DIFFERENCE_TRUST = 0.7
# Distance to a known bead up to which a moving disc looks alike, in spreads.
_ALIKE_MOVING = 6.0
# Beads below this radius are enlarged, [px].
_LEAST_RADIUS_PX = 6.5
# Frames in which discs are searched to learn from, and their usual step.
_LEARNING_FRAMES, _STEP_FRAMES = 8, 4


class SceneModel:
    """What beads of a species look like in a film.

    Discs are searched in the picture itself and, where the background is known, in its difference
    from that, which shows what moves on any floor and in any colour.

    Parameters
    ----------
    frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
        Spread over the film; one is enough where beads stand out.
    look : BeadLook

    Attributes
    ----------
    colours : SceneColours
    views : list of View
    sees_motion : bool
        Whether discs that move told what beads look like.
    shadows : CastShadows or None
        Those that show as discs.
    light : LitSizes or None
        How light shows the beads.
    """

    def __init__(self, frames: Sequence[NDArray[np.uint8]], look: BeadLook) -> None:
        colour = None if look.colour is None else np.array(look.colour)
        self.scale = 1
        if look.radii[0] > 0.0:
            self.scale = max(1, math.ceil(_LEAST_RADIUS_PX / math.sqrt(math.prod(look.radii))))
        self._look = look
        self.colours: SceneColours = scene_colours(frames, colour).enlarged(self.scale)
        self.views: list[View] = []
        self.sees_motion = False
        self.shadows: CastShadows | None = None
        self.light: LitSizes | None = None
        self._known: KnownBeads | None = None
        self._roamed: RoamedRegion | None = None
        self._at_rest = AtRest()
        lesson = _some(frames, _LEARNING_FRAMES)
        attended = _some(frames, _STEP_FRAMES)
        self._learn(lesson)
        if self.colours.knows_background and len(self._moved) < _FEW_MOVING:
            # Of a single bead each frame shows but one.
            lesson = attended = _some(frames, _MORE_FRAMES)
            self._learn_looks(lesson)
        # Hands, rails and skirting boards may have stronger edges than the beads.
        if self.sees_motion and self._weaken_steps(attended, self._are_known, _MUCH_WEAKER):
            self._learn_looks(lesson)
        if self._learn_light(lesson):
            self._learn_looks(lesson)
        if self.colours.knows_background and self.sees_motion:
            moved = self._moved * self.scale
            large = [enlarged(frame, self.scale) for frame in frames]
            region = roamed_region(large, self.colours, moved, self.views[-1].voting.step)
            # A bed of beads at rest is no clutter.
            if region.outside(self._rested * self.scale).sum() < len(moved):
                self._roamed = region

    @property
    def radii(self) -> tuple[float, float]:
        """Smallest and largest radius that is searched, [px]."""
        voting = self.views[0].voting
        return voting.smallest / self.scale, voting.largest / self.scale

    @property
    def bead_colours(self) -> NDArray[np.float64]:
        """Colours of discs that are known to be beads, (n, 3), bgr, [gray levels]."""
        return np.empty((0, 3)) if self._known is None else self._known.colours

    def attend_to(self, frames: Sequence[NDArray[np.uint8]], own: OwnColours) -> None:
        """Let the usual edges be those of discs of one species, where others are stronger.

        Parameters
        ----------
        frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
        own : callable
            Says of colours (n, 3) inside and around discs which of these are the species.
        """
        self._weaken_steps(
            _some(frames, _STEP_FRAMES),
            lambda frame, discs: own(*colours_of(frame, discs)),
            (WEAKER[1], 1.0),
        )

    def _weaken_steps(
        self, frames: Sequence[NDArray[np.uint8]], own: OwnDiscs, parts: tuple[float, float]
    ) -> bool:
        """Let the usual edges of each view be those of own discs, if these are weaker.

        Parameters
        ----------
        frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
        own : callable
            Says which discs (n, 3) of an enlarged frame count.
        parts : tuple of 2 floats
            Of the usual step of all discs: down to which edges are searched, and above which it
            stays.

        Returns
        -------
        bool
            Whether any changed.
        """
        searched, most = parts
        chosen = [enlarged(frame, self.scale) for frame in frames]
        changed = False
        for k, view in enumerate(self.views):
            weaker = view.with_step(searched * view.voting.step)
            steps = []
            for frame in chosen:
                outlines = self._outlines(frame, weaker)
                good = outlines.chosen(outlines.support >= _GOOD_SUPPORT)
                steps.append(good.steps[own(frame, good.discs)])
            own_steps = np.concatenate(steps)
            if len(own_steps) >= _LEAST_MOVING:
                usual = weaker.voting.step * float(np.quantile(own_steps, USUAL))
                if usual < most * view.voting.step:
                    self.views[k] = view.with_step(usual)
                    changed = True
        return changed

    def _learn_light(self, frames: Sequence[NDArray[np.uint8]]) -> bool:
        """Learn where light and shade let the outlines of beads show; returns whether any do."""
        discs = []
        for frame in frames:
            found = self.candidates(frame)
            good = self.alike(found) & (found.outlines.support >= _GOOD_SUPPORT)
            if self.sees_motion:
                good &= found.moving >= MOVING_SHARE
            discs.append(found.outlines.discs[good])
        if not sum(len(rows) for rows in discs):
            return False
        self.light = LitSizes.of(frames, discs)
        if not self.light.shifts:
            return False
        half = np.array([0.5 * (self.scale - 1.0)] * 2 + [0.0])
        beads = [self.scale * self.light.beads(rows) + half for rows in discs]
        # A limit lies between the beads as between the discs that show.
        grown = np.median(np.concatenate(beads)[:, 2]) / np.median(np.concatenate(discs)[:, 2])
        limits = [float(grown) * limit for limit in self.light.limits]
        large = [enlarged(frame, self.scale) for frame in frames]
        self.views = [
            in_light(view, [view.of(frame, self.colours) for frame in large], beads, limits)
            for view in self.views
        ]
        return True

    def _are_known(
        self, color: NDArray[np.uint8], discs: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which discs (n, 3) of an enlarged frame move, and look like known beads."""
        known = marked_shares(self.colours.moving(color), discs) >= MOVING_SHARE
        if self._known is not None:
            radii = discs[:, 2] / self.scale
            limits = np.full(len(discs), ALIKE)
            known &= self._known.are_near(colours_of(color, discs)[0], radii, limits)
        return known

    def candidates(
        self, color: NDArray[np.uint8], hints: NDArray[np.float64] | None = None
    ) -> Candidates:
        """Discs of the right size with an outline in a frame, alike beads or not.

        Parameters
        ----------
        color : ndarray of uint8, (rows, columns, 3), bgr
        hints : ndarray (k, 3), [px], optional
            Column, row and radius where beads are expected.
        """
        if hints is not None:
            half = 0.5 * (self.scale - 1.0)
            hints = hints * self.scale + np.array([half, half, 0.0])
        color = enlarged(color, self.scale)
        moving = self.colours.moving(color)
        rows = [self._outlines(color, view, hints, moving) for view in self.views]
        shown = np.concatenate(
            [
                np.zeros(len(row.steps), dtype=bool) if view.moves else are_sure(row, 1.0)
                for row, view in zip(rows, self.views, strict=True)
            ]
        )
        # In the difference a shadow is part of its bead.
        trust = [_DIFFERENCE_TRUST if view.moves else 1.0 for view in self.views]
        outlines = join_outlines(
            [row._replace(steps=row.steps * part) for row, part in zip(rows, trust, strict=True)]
        )
        if self._known is not None:
            # The inside of a clear bead has an outline, too.
            have_size = self._known.have_size(outlines.discs[:, 2] / self.scale)
            outlines, shown = outlines.chosen(have_size), shown[have_size]
        if self.shadows is not None:
            # The outline of a shadow may be higher than that of the bead beside it.
            dark = self._darken_floor(color, outlines.discs)
            outlines, shown = outlines.chosen(~dark), shown[~dark]
        kept = apart(outlines, self._look.apart)
        outlines, shown = outlines.chosen(kept), shown[kept]
        colours, around = colours_of(color, outlines.discs)
        floor = np.full_like(colours, math.nan)
        if self.colours.knows_background:
            floor, beside = colours_of(self.colours.background, outlines.discs)
            radii = outlines.discs[:, 2] / self.scale
            now = colours, around
            # What shows in the picture itself is here, on whatever stain.
            here = shown | ~left_behind(now, (floor, beside), self._known, radii)
            here &= ~ends_of_others(color, moving, outlines.discs, outlines.support, now)
            outlines = outlines.chosen(here)
            colours, around, floor = colours[here], around[here], floor[here]
        moves = marked_shares(moving, outlines.discs)
        aside = np.zeros(len(moves), dtype=bool)
        if self._roamed is not None:
            aside = self._roamed.aside(color, outlines.discs)
        return Candidates(reduced(outlines, self.scale), colours, around, floor, moves, aside)

    def alike(self, candidates: Candidates) -> NDArray[np.bool_]:
        """Which of the discs look like beads."""
        brighter = (candidates.colours - candidates.around).sum(axis=1)
        told = self._look.sign * brighter >= 0.0
        if self._known is None:
            return np.asarray(told)
        radii = candidates.outlines.discs[:, 2]
        limits = np.where(candidates.moving < MOVING_SHARE, ALIKE, _ALIKE_MOVING)
        near = self._known.are_near(candidates.colours, radii, limits)
        near &= self._at_rest.allows(candidates)
        alike = np.asarray(told & self._known.have_size(radii) & near)
        if self.shadows is not None:
            dark = darken(candidates.colours, candidates.floor)
            alike &= ~self.shadows.among(candidates.outlines.discs, alike, dark)
        return alike

    def _darken_floor(
        self, color: NDArray[np.uint8], discs: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which discs (n, 3) are the floor in less light."""
        now, floor = (colours_of(image, discs)[0] for image in (color, self.colours.background))
        return darken(now, floor)

    def _outlines(
        self,
        color: NDArray[np.uint8],
        view: View,
        hints: NDArray[np.float64] | None = None,
        moving: NDArray[np.uint8] | None = None,
    ) -> Outlines:
        """Discs that show in a view, smeared ones where it moves; their steps over the usual."""
        smear = moving if self._known is not None and self.colours.knows_background else None
        found = search_outlines(view.of(color, self.colours), view.voting, hints, smear)
        return shifted(found, view)

    def _learn(self, frames: Sequence[NDArray[np.uint8]]) -> None:
        chosen = [
            enlarged(frame, self.scale) for frame in frames[:: max(1, len(frames) // _STEP_FRAMES)]
        ]
        low, high = (self.scale * radius for radius in self._look.radii)
        search = ViewSearch(chosen, self.colours, (low, high))
        self.views = search.plain_views(self._look.sign)
        if self.colours.knows_background:
            self.views.append(search.view(moves=True, sign=1))
        if not self._look.radii[0] > 0.0:
            # What moves tells the size first.
            radii = max(self.views, key=lambda view: (view.evidence > 0.0, view.moves))
            low, high = radii.voting.smallest, radii.voting.largest
            self.views = [
                view._replace(voting=view.voting._replace(smallest=low, largest=high))
                for view in self.views
            ]
        self._learn_looks(frames)

    def _learn_looks(self, frames: Sequence[NDArray[np.uint8]]) -> None:
        """Learn colours and sizes from the discs that move, or from all."""
        self._known = self.shadows = None
        every, number = join_candidates([self.candidates(frame) for frame in frames])
        self._know(every, number)
        dark = darken(every.colours, every.floor)
        alike = self.alike(every) & (every.moving >= MOVING_SHARE)
        shadows = CastShadows.of(every.outlines.discs[alike], dark[alike], number[alike])
        if shadows is not None:
            self._know(every.chosen(~dark), number[~dark])
            self.shadows = shadows

    def _know(self, every: Candidates, number: NDArray[np.intp]) -> None:
        """Learn from discs of frames with these numbers."""
        good = every.outlines.support >= _GOOD_SUPPORT
        moves = every.moving >= MOVING_SHARE
        moving = good & moves & ~staying(every.outlines.discs, moves, number)
        enough = max(_LEAST_MOVING, _LEAST_MOVING_SHARE * good.sum())
        self.sees_motion = bool(moving.sum() >= enough)
        self._moved = every.outlines.discs[moving]
        known = moving if self.sees_motion else good
        whole = known & (every.outlines.support >= _WHOLE_SUPPORT)
        known = whole if whole.sum() >= _LEAST_MOVING else known
        self._known = KnownBeads.of(every.colours[known], every.outlines.discs[known, 2])
        self._at_rest = AtRest()
        moved = self.alike(every) & moving
        if self.sees_motion and moved.any():
            self._at_rest = AtRest.beside(every.chosen(moved))
        self._rested = every.outlines.discs[self.alike(every) & good & ~moving]


def _some(frames: Sequence[NDArray[np.uint8]], count: int) -> list[NDArray[np.uint8]]:
    """So many frames at most, spread over all."""
    chosen = np.linspace(0, len(frames) - 1, min(count, len(frames)))
    return [frames[round(k)] for k in chosen]


def scene_model(frames: Sequence[NDArray[np.uint8]], look: BeadLook) -> SceneModel:
    """Learn what beads look like from frames of a film; see `SceneModel`."""
    model = SceneModel(frames, look)
    if look.radii[0] > 0.0 or math.sqrt(math.prod(model.radii)) >= _LEAST_RADIUS_PX:
        return model
    # The size was found: small beads are seen better enlarged.
    return SceneModel(frames, replace(look, radii=model.radii))
