"""Pictures of a film in which its discs show, and what their edges are like in each.

Tested by ``test/stages/tracking/scene/test_scene_model.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.tracking.scene.bead_looks import View
from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import join_outlines
from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting
from nanorocks_ros.stages.tracking.scene.outlines.outline_search import (
    LEAST_LEVELS,
    search_outlines,
)
from nanorocks_ros.stages.tracking.scene.outlines.radius_search import search_radii, usual_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.scene_picture import SceneColours

WEAKER = 1.0, 0.5, 0.25
"""Parts of the usual step of all edges that are tried for that of beads, until discs show."""

USUAL = 0.75
"""Of the steps of all discs this quantile is the usual one."""

# Discs of the other brightness count when they are at least this part.
_OTHER_SIGN_SHARE = 0.4


class ViewSearch(NamedTuple):
    """Where discs are searched.

    Parameters
    ----------
    frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
    colours : SceneColours
    radii : tuple of 2 floats, [px]
        Smallest and largest; NaN: not known.
    """

    frames: Sequence[NDArray[np.uint8]]
    colours: SceneColours
    radii: tuple[float, float]

    def plain_views(self, sign: int) -> list[View]:
        """The picture, for bright discs, dark ones, or both where both occur.

        Between dense discs of one brightness are gaps of the other.

        Parameters
        ----------
        sign : int
            1: brighter than the floor, -1: darker, 0: not known.
        """
        signs = (1, -1) if sign == 0 else (sign,)
        views = [self.view(moves=False, sign=sign) for sign in signs]
        views.sort(key=lambda view: -view.evidence)
        if not self.colours.knows_background:
            return views[:1]
        return [
            view
            for view in views
            if view is views[0] or view.evidence > _OTHER_SIGN_SHARE * views[0].evidence
        ]

    def view(self, *, moves: bool, sign: int) -> View:
        """The picture, or its difference, with size, brightness and edges of the discs in it."""
        low, high = self.radii
        noise = self.colours.unrest if moves else self.colours.noise
        view = View(moves, Voting(low, high, sign, 1.0, noise), 0.0)
        step = usual_step(view.of(self.frames[-1], self.colours), noise)
        voting = view.voting._replace(step=step)
        if not low > 0.0:
            middle = self.frames[len(self.frames) // 2]
            voting = search_radii(view.of(middle, self.colours), voting)
        for part in WEAKER:
            # Hands, rails and skirting boards may have stronger edges than the beads.
            step = max(part * voting.step, LEAST_LEVELS)
            tried = voting._replace(step=step)
            outlines = join_outlines(
                [search_outlines(view.of(frame, self.colours), tried) for frame in self.frames]
            )
            if len(outlines.steps):
                break
        else:
            return View(moves, voting, 0.0)
        usual = float(np.quantile(outlines.steps, USUAL))
        evidence = float((outlines.support**2 * outlines.steps).sum())
        return View(moves, voting._replace(step=step * usual), evidence)
