"""Beads that are lit from one side are found where they are, and as large."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.lit_views import outline_of
from nanorocks_ros.stages.tracking.scene.outlines.lit_spheres import lit_sphere
from nanorocks_ros.stages.tracking.scene.scene_model import scene_model

RADIUS = 12.0
SIZE = 220, 300
FINER = 4
FLOOR, BEAD = np.array([60.0, 40.0, 35.0]), np.array([215.0, 225.0, 230.0])


def lit_film(light, *, frames=24, seed=1, floor=FLOOR, bead=BEAD, ambient=0.2, exponent=1.0):
    """Frames of matte spheres at random places, drawn four times as fine, and their discs."""
    random = np.random.default_rng(seed)
    towards = np.array(light) / np.linalg.norm(light)
    drawn = [
        lit_frame(random, places_of(random), towards, (floor, bead, ambient, exponent))
        for _ in range(frames)
    ]
    return [frame for frame, _ in drawn], [discs for _, discs in drawn]


def places_of(random, count=9):
    places = []
    while len(places) < count:
        place = random.uniform(1.6 * RADIUS, np.array(SIZE[::-1]) - 1.6 * RADIUS)
        if all(np.hypot(*(place - other)) > 2.6 * RADIUS for other in places):
            places.append(place)
    return np.array(places)


def lit_frame(random, places, towards, look):
    floor, bead, ambient, exponent = look
    shape = FINER * SIZE[0], FINER * SIZE[1]
    light = np.broadcast_to((floor / 255.0) ** exponent, (*shape, 3)).copy()
    for column, row in places:
        first = [math.floor(FINER * (middle - RADIUS)) for middle in (row, column)]
        beside = tuple(slice(k, k + math.ceil(FINER * (2.0 * RADIUS + 2.0))) for k in first)
        y, x = (np.mgrid[beside] + 0.5) / FINER - 0.5
        across, down = (x - column) / RADIUS, (y - row) / RADIUS
        inside = across**2 + down**2 < 1.0
        across, down = across[inside], down[inside]
        up = np.sqrt(1.0 - across**2 - down**2)
        lit = np.maximum(across * towards[0] + down * towards[1] + up * towards[2], 0.0)
        share = ambient + (1.0 - ambient) * lit
        light[beside][inside] = share[:, None] * (bead / 255.0) ** exponent
    light = cv2.resize(light, SIZE[::-1], interpolation=cv2.INTER_AREA)
    light = cv2.GaussianBlur(light, (0, 0), 0.9)
    frame = 255.0 * np.clip(light, 0.0, 1.0) ** (1.0 / exponent)
    frame += random.normal(0.0, 1.5, frame.shape)
    discs = np.column_stack([places, np.full(len(places), RADIUS)])
    return np.clip(np.rint(frame), 0, 255).astype(np.uint8), discs


def off(frames, truths, model):
    """Mean of what discs are off by, in radii, (3,), and how many of the beads are found."""
    rows = []
    for frame, truth in zip(frames, truths, strict=True):
        candidates = model.candidates(frame)
        seen = candidates.outlines.discs[model.alike(candidates)]
        away = np.hypot(*(seen[:, None, :2] - truth[None, :, :2]).transpose(2, 0, 1))
        near = away.min(axis=1) < 0.4 * RADIUS
        rows.append((seen[near] - truth[away.argmin(axis=1)[near]]) / RADIUS)
    every = np.concatenate(rows)
    return every.mean(axis=0), len(every) / sum(map(len, truths))


def learnt(frames):
    return scene_model(frames, BeadLook(radii=(0.85 * RADIUS, 1.15 * RADIUS)))


LIGHTS = {
    'from the right': (0.55, 0.0, 0.8),
    'from the lower left': (-0.4, 0.4, 0.8),
    'from far aside': (0.0, -0.8, 0.6),
}


@pytest.mark.parametrize('light', LIGHTS.values(), ids=LIGHTS)
def test_beads_are_where_they_are_and_as_large_however_light_comes_from_one_side(light):
    frames, truths = lit_film(light)
    model = learnt(frames)
    away, found = off(frames, truths, model)
    assert found > 0.97
    assert np.hypot(*away[:2]) < 0.012
    assert abs(away[2]) < 0.015
    # Without what is learnt of the light they are a third of a pixel and more off.
    for k, view in enumerate(model.views):
        model.views[k] = view._replace(voting=view.voting._replace(outline=()), shifts=())
    before, _ = off(frames, truths, model)
    assert np.hypot(*before[:2]) > 0.03
    assert before[2] < -0.03


def test_the_same_of_a_camera_that_brightens_the_dark_as_video_does():
    frames, truths = lit_film((0.5, 0.2, 0.8), exponent=2.2)
    away, found = off(frames, truths, learnt(frames))
    assert found > 0.97
    assert np.hypot(*away[:2]) < 0.015
    assert abs(away[2]) < 0.02


def test_a_dark_side_as_dark_as_the_floor_is_no_outline():
    # Gray levels of the shaded side are those of the floor: it has no edge there.
    frames, truths = lit_film((0.5, -0.2, 0.8), floor=0.2 * BEAD)
    away, found = off(frames, truths, learnt(frames))
    assert found > 0.97
    assert np.hypot(*away[:2]) < 0.012
    assert abs(away[2]) < 0.015


def test_dark_beads_on_a_bright_floor_are_left_as_they_are():
    frames, truths = lit_film((0.5, -0.2, 0.8), floor=0.85 * BEAD, bead=0.3 * BEAD)
    model = learnt(frames)
    assert not model.light.shifts
    assert all(view.voting.outline == () for view in model.views)
    away, _ = off(frames, truths, model)
    assert np.abs(away).max() < 0.01


def test_flat_discs_are_left_as_they_are():
    frames, truths = lit_film((0.0, 0.0, 1.0), ambient=1.0)
    model = learnt(frames)
    assert not model.light.shifts
    away, _ = off(frames, truths, model)
    assert np.abs(away).max() < 0.02


@pytest.mark.parametrize('turned', [False, True])
def test_balls_that_a_rectified_view_stretches_are_left_where_they_are(turned):
    # Shaded alike on all sides, as by light from the camera: what is uneven is their shape.
    frames, truths = lit_film((0.0, 0.0, 1.0), frames=12)
    matrix = np.diag([1.1, 1.0 / 1.1]) ** 0.5
    if turned:
        half = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2.0)
        matrix = half @ matrix @ half.T
    middle = np.array(SIZE[::-1]) / 2.0
    moved = np.column_stack([matrix, middle - matrix @ middle])
    frames = [cv2.warpAffine(frame, moved, SIZE[::-1], borderValue=FLOOR) for frame in frames]
    truths = [
        np.column_stack([truth[:, :2] @ matrix.T + moved[:, 2], truth[:, 2]]) for truth in truths
    ]
    model = learnt(frames)
    assert not model.light.shifts
    away, found = off(frames, truths, model)
    assert found > 0.97
    assert np.abs(away[:2]).max() < 0.01


def test_too_few_beads_or_too_small_ones_tell_no_light():
    frames, truths = lit_film((0.5, -0.2, 0.8), frames=2)
    assert lit_sphere(frames, truths) is not None
    assert lit_sphere(frames[:1], [truths[0][:3]]) is None
    assert lit_sphere(frames[:1], [truths[0][:0]]) is None
    small = [cv2.resize(frame, None, fx=0.3, fy=0.3) for frame in frames]
    assert lit_sphere(small, [0.3 * truth for truth in truths]) is None


def test_a_sphere_is_found_from_wherever_the_discs_lie():
    frames, truths = lit_film((0.5, -0.2, 0.8))
    discs = [
        np.column_stack([truth[:, 0] + 0.08 * RADIUS, truth[:, 1], 0.92 * truth[:, 2]])
        for truth in truths
    ]
    sphere = lit_sphere(frames, discs)
    assert sphere.shifts
    shift = np.concatenate(sphere.of(discs[0])) - np.concatenate(truths[0])
    assert np.abs(shift).max() < 0.015 * RADIUS


def test_an_outline_that_is_shifted_shifts_the_circle():
    outline = 1.0 + outline_of(0.1, -0.05, 0.02)
    angles = 2.0 * np.pi * np.arange(len(outline)) / len(outline)
    expected = 1.02 + 0.1 * np.cos(angles) - 0.05 * np.sin(angles)
    np.testing.assert_allclose(outline, expected)
