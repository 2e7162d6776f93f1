"""Start of a bond, searched in the frames before it was found."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.bodies.bonds import Bond
from nanorocks_ros.stages.bodies.frame_history import BodyFrame, FrameHistory

STEP = 0.1
BOND = Bond((2, 5), 2.0, (2e-3, 0.0), 1e-4)


def _history(separation, n_frames):
    """Frames in which bead 5 is at `separation(k)` from bead 2; None if it is not visible."""
    history = FrameHistory()
    for k in range(n_frames):
        apart = separation(k)
        ids, positions = [2], [(1e-3, 1e-3)]
        if apart is not None:
            ids, positions = [2, 5], [*positions, (1e-3 + apart, 1e-3)]
        frame = BodyFrame(
            time=k * STEP,
            stamp_ns=round(k * STEP * 1e9),
            ids=np.array(ids, dtype=np.int64),
            positions=np.array(positions),
            radii=np.full(len(ids), 1e-3),
            known_ids=frozenset((2, 5)),
            attached=(),
        )
        history.push(frame)
    return history


def test_a_bond_starts_where_its_separation_becomes_constant():
    history = _history(lambda k: 2e-3 if k >= 8 else 3e-3, 25)
    assert history.start_of(BOND) == pytest.approx(0.8)


@pytest.mark.parametrize('gap', [3e-3, None])
def test_two_frames_without_the_separation_do_not_end_the_search(gap):
    history = _history(lambda k: gap if k in (12, 13) else 2e-3, 25)
    assert history.start_of(BOND) == 0.0


@pytest.mark.parametrize('gap', [3e-3, None])
def test_three_frames_without_the_separation_end_the_search(gap):
    history = _history(lambda k: gap if k in (12, 13, 14) else 2e-3, 25)
    assert history.start_of(BOND) == pytest.approx(1.5)


def test_frames_older_than_ten_seconds_are_forgotten():
    history = _history(lambda _: 2e-3, 121)
    assert history.start_of(BOND._replace(start=12.0)) == pytest.approx(2.0)


def test_bodies_touch_since_any_two_of_their_beads_do():
    history = _history(lambda k: 2.04e-3 if k >= 8 else 3e-3, 25)
    both = frozenset((2, 7)), frozenset((5,))
    assert history.touching_since(2.0, lambda _: both) == pytest.approx(0.8)


def test_the_search_ends_where_both_bodies_are_single_beads():
    history = _history(lambda k: 2.04e-3 if k >= 8 else 3e-3, 25)

    def bodies(time):
        return frozenset((2, 7) if time >= 1.15 else (2,)), frozenset((5,))

    assert history.touching_since(2.0, bodies) == pytest.approx(1.2)


def test_beads_that_are_one_body_already_do_not_move_the_start():
    history = _history(lambda _: 2e-3, 25)
    assert history.touching_since(2.0, lambda _: (frozenset((2, 5)), frozenset((2, 5)))) == 2.0
