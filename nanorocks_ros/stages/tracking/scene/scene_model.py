"""What beads look like in a film: radius, brightness, edges and colours, learnt from it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from nanorocks_ros.stages.tracking.scene.bead_looks import (
    BeadLook,
    Candidates,
    View,
    join_candidates,
)
from nanorocks_ros.stages.tracking.scene.disc_measures import (
    apart,
    colours_of,
    join_outlines,
    marked_shares,
    reduced,
    staying,
)
from nanorocks_ros.stages.tracking.scene.edge_votes import Voting, centres_of_all_sizes
from nanorocks_ros.stages.tracking.scene.floor_behind import CastShadows, darken, left_behind
from nanorocks_ros.stages.tracking.scene.known_beads import ALIKE, KnownBeads
from nanorocks_ros.stages.tracking.scene.open_outlines import ends_of_others
from nanorocks_ros.stages.tracking.scene.outline_fits import Outlines, fit_outlines
from nanorocks_ros.stages.tracking.scene.radius_search import search_radii, usual_step
from nanorocks_ros.stages.tracking.scene.roamed_region import (
    MOVING_SHARE,
    RoamedRegion,
    roamed_region,
)
from nanorocks_ros.stages.tracking.scene.scene_picture import SceneColours, enlarged, scene_colours
from nanorocks_ros.stages.tracking.scene.smeared_discs import smeared_discs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    OwnColours = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]

# Smallest share of the outline that votes, and that the edges on the circle cover.
_LEAST_VOTES, _LEAST_SUPPORT = 0.25, 0.5
_GOOD_SUPPORT = 0.7
# Moving discs that tell what beads look like, and their share of all discs.
_LEAST_MOVING, _LEAST_MOVING_SHARE = 4, 0.04
# So many frames are searched where fewer discs move.
_FEW_MOVING, _MORE_FRAMES = 8, 50
# Trust in outlines of the difference from the background, over those of the picture itself.
_DIFFERENCE_TRUST = 0.7
# A step is that of a bead above this part of the usual one: those of shadows are softer.
_LEAST_STEP = 0.35
# Parts of the usual step of all edges that are tried for that of beads, until discs show.
_WEAKER = 1.0, 0.5, 0.25
# And above so many gray levels, and times the noise.
_LEAST_LEVELS, _LEAST_NOISES = 4.0, 4.0
# Distance to a known bead up to which a moving disc looks alike, in spreads.
_ALIKE_MOVING = 6.0
# Beads below this radius are enlarged, [px].
_LEAST_RADIUS_PX = 6.5
# Discs of the other brightness count when they are at least this part.
_OTHER_SIGN_SHARE = 0.4
# A search begins where a bead is expected, and not again within this part of its radius where
# that shows an outline with this support and step over the usual one.
_SAME_SHARE, _SURE_SUPPORT, _SURE_STEP = 0.8, 0.7, 0.5
# Frames in which discs are searched to learn from, and their usual step.
_LEARNING_FRAMES, _STEP_FRAMES = 8, 4
# Of the steps of all discs this quantile is the usual one.
_USUAL = 0.75


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
    """

    def __init__(self, frames: Sequence[NDArray[np.uint8]], look: BeadLook) -> None:
        colour = None if look.colour is None else np.array(look.colour)
        self.scale = 1
        if look.radii[0] > 0.0:
            self.scale = max(1, math.ceil(_LEAST_RADIUS_PX / math.sqrt(math.prod(look.radii))))
        self._look = look
        self.colours: SceneColours = scene_colours(frames, colour).enlarged(self.scale)
        self.sees_motion = False
        self.shadows: CastShadows | None = None
        self._known: KnownBeads | None = None
        self._roamed: RoamedRegion | None = None
        self._learn(_some(frames, _LEARNING_FRAMES))
        if self.colours.knows_background and len(self._moved) < _FEW_MOVING:
            # Of a single bead each frame shows but one.
            self._learn_looks(_some(frames, _MORE_FRAMES))
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
        chosen = [enlarged(frame, self.scale) for frame in _some(frames, _STEP_FRAMES)]
        for k, view in enumerate(self.views):
            # With weaker edges than those of the discs of all species.
            weaker = view.with_step(_WEAKER[1] * view.voting.step)
            steps = []
            for frame in chosen:
                outlines = self._outlines(frame, weaker)
                good = outlines.chosen(outlines.support >= _GOOD_SUPPORT)
                steps.append(good.steps[own(*colours_of(frame, good.discs))])
            own_steps = np.concatenate(steps)
            if len(own_steps) >= _LEAST_MOVING:
                usual = weaker.voting.step * float(np.quantile(own_steps, _USUAL))
                self.views[k] = view.with_step(min(usual, view.voting.step))

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
        # In the difference a shadow is part of its bead.
        trust = [_DIFFERENCE_TRUST if view.moves else 1.0 for view in self.views]
        outlines = join_outlines(
            [row._replace(steps=row.steps * part) for row, part in zip(rows, trust, strict=True)]
        )
        outlines = outlines.chosen(apart(outlines, self._look.apart))
        colours, around = colours_of(color, outlines.discs)
        floor = np.full_like(colours, math.nan)
        if self.colours.knows_background:
            floor, beside = colours_of(self.colours.background, outlines.discs)
            radii = outlines.discs[:, 2] / self.scale
            now = colours, around
            here = ~left_behind(now, (floor, beside), self._known, radii)
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
        distances = self._known.distances(candidates.colours, radii)
        rest = candidates.moving < MOVING_SHARE
        near = distances < np.where(rest, ALIKE, _ALIKE_MOVING)
        alike = np.asarray(told & self._known.have_size(radii) & near)
        if self.shadows is not None:
            dark = darken(candidates.colours, candidates.floor)
            alike &= ~self.shadows.among(candidates.outlines.discs, alike, dark)
        return alike

    def _outlines(
        self,
        color: NDArray[np.uint8],
        view: View,
        hints: NDArray[np.float64] | None = None,
        moving: NDArray[np.uint8] | None = None,
    ) -> Outlines:
        """Discs that show in a view, smeared ones where it moves; their steps over the usual."""
        picture = view.of(color, self.colours)
        starts = centres_of_all_sizes(picture, view.voting, _LEAST_VOTES)[:, :3]
        outlines = fit_outlines(picture, np.empty((0, 3)) if hints is None else hints, view.voting)
        sure = outlines.discs[
            (outlines.support >= _SURE_SUPPORT) & (outlines.steps >= _SURE_STEP * view.voting.step)
        ]
        if len(sure):
            apart_from_sure = cKDTree(sure[:, :2]).query(starts[:, :2])[0]
            starts = starts[apart_from_sure > _SAME_SHARE * view.voting.smallest]
        outlines = join_outlines([outlines, fit_outlines(picture, starts, view.voting)])
        if hints is not None:
            starts = np.concatenate([hints, starts])
        steps = outlines.steps / view.voting.step
        good = (outlines.support >= _LEAST_SUPPORT) & (steps >= _LEAST_STEP)
        good &= outlines.steps >= max(_LEAST_LEVELS, _LEAST_NOISES * view.voting.noise)
        sharp = outlines._replace(steps=steps).chosen(good)
        if moving is None or self._known is None or not self.colours.knows_background:
            return sharp
        smeared = smeared_discs(picture, moving, starts[~good], view.voting)
        return join_outlines([sharp, smeared.chosen(smeared.steps >= _LEAST_STEP)])

    def _learn(self, frames: Sequence[NDArray[np.uint8]]) -> None:
        chosen = [
            enlarged(frame, self.scale) for frame in frames[:: max(1, len(frames) // _STEP_FRAMES)]
        ]
        self.views = self._plain_views(chosen)
        if self.colours.knows_background:
            self.views.append(self._view(chosen, moves=True, sign=1))
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
        self._known = KnownBeads.of(every.colours[known], every.outlines.discs[known, 2])
        self._rested = every.outlines.discs[self.alike(every) & good & ~moving]

    def _plain_views(self, frames: Sequence[NDArray[np.uint8]]) -> list[View]:
        """The picture, for bright discs, dark ones, or both where both occur.

        Between dense discs of one brightness are gaps of the other.
        """
        signs = (1, -1) if self._look.sign == 0 else (self._look.sign,)
        views = [self._view(frames, moves=False, sign=sign) for sign in signs]
        views.sort(key=lambda view: -view.evidence)
        if not self.colours.knows_background:
            return views[:1]
        return [
            view
            for view in views
            if view is views[0] or view.evidence > _OTHER_SIGN_SHARE * views[0].evidence
        ]

    def _view(self, frames: Sequence[NDArray[np.uint8]], *, moves: bool, sign: int) -> View:
        """A view of the frames with the size, brightness and edges of the discs in it."""
        low, high = (self.scale * radius for radius in self._look.radii)
        noise = self.colours.unrest if moves else self.colours.noise
        view = View(moves, Voting(low, high, sign, 1.0, noise), 0.0)
        step = usual_step(view.of(frames[-1], self.colours), noise)
        voting = view.voting._replace(step=step)
        if not low > 0.0:
            voting = search_radii(view.of(frames[len(frames) // 2], self.colours), voting)
        for part in _WEAKER:
            # Hands, rails and skirting boards may have stronger edges than the beads.
            step = max(part * voting.step, _LEAST_LEVELS)
            found = view._replace(voting=voting).with_step(step)
            outlines = join_outlines([self._outlines(frame, found) for frame in frames])
            if len(outlines.steps):
                break
        else:
            return View(moves, voting, 0.0)
        usual = float(np.quantile(outlines.steps, _USUAL))
        evidence = float((outlines.support**2 * outlines.steps).sum())
        return View(moves, voting._replace(step=step * usual), evidence)


def _some(frames: Sequence[NDArray[np.uint8]], count: int) -> list[NDArray[np.uint8]]:
    """So many frames at most, spread over all."""
    chosen = np.linspace(0, len(frames) - 1, min(count, len(frames)))
    return [frames[round(k)] for k in chosen]


def scene_model(frames: Sequence[NDArray[np.uint8]], look: BeadLook) -> SceneModel:
    """Learn what beads look like from frames of a film; see `SceneModel`."""
    model = SceneModel(frames, look)
    if look.radii[0] > 0.0 or model.radii[1] >= _LEAST_RADIUS_PX:
        return model
    # The size was found: small beads are seen better enlarged.
    return SceneModel(frames, replace(look, radii=model.radii))
