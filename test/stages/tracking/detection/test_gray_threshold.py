import cv2
import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import TrackingSettings
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector
from nanorocks_ros.stages.tracking.detection.gray_threshold import GrayThreshold, covered_share
from nanorocks_ros.stages.tracking.detection.pixel_classes import FLOOR, RED

_SCALE = 16000.0
_FLOOR, _GRAIN = 160.0, 50.0


def _grains_of(tray):
    return [species for species in tray.species if species.material == 'JSC-1']


def _picture(shadows, blur, seed=1):
    """Tray 7: discs of its grains beside its beads, shadows below; centres and radii, [px]."""
    tray = load_trays()[7]
    random = np.random.default_rng(seed)
    size = _SCALE * np.array(tray.dimensions[:2])
    shape = tuple(int(side) for side in size[::-1])
    places, radii, red = [], [], []
    for species in tray.species:
        for _ in range(species.count):
            radius = 0.5 * _SCALE * random.uniform(species.diameter_low, species.diameter_high)
            while True:
                place = random.uniform(radius, size - radius)
                apart = np.linalg.norm(np.reshape(places, (-1, 2)) - place, axis=1)
                if np.all(apart > np.array(radii) + radius + 2.0):
                    break
            places.append(place)
            radii.append(radius)
            red.append(species.material == 'acrylic')
    light = np.ones(shape, dtype=np.float32)
    image = np.full((*shape, 3), _FLOOR, dtype=np.float32)
    for place, radius in zip(places, radii, strict=True):
        shadow = np.zeros(shape, dtype=np.float32)
        _draw(shadow, place + _SCALE * np.array([0.5e-3, 0.3e-3]), radius, 1.0)
        light *= 1.0 - shadows * cv2.GaussianBlur(shadow, (0, 0), 0.12e-3 * _SCALE)
    image *= light[:, :, np.newaxis]
    for place, radius, is_red in zip(places, radii, red, strict=True):
        _draw(image, place, radius, (30.0, 30.0, 180.0) if is_red else (_GRAIN,) * 3)
    image = cv2.GaussianBlur(image, (0, 0), blur) + random.normal(0.0, 2.0, image.shape)
    gray = ~np.array(red)
    picture = np.clip(image, 0.0, 255.0).astype(np.uint8)
    return tray, picture, np.array(places)[gray], np.array(radii)[gray]


def _draw(image, place, radius, level):
    centre = tuple(round(16.0 * (value - 0.5)) for value in place)
    cv2.circle(image, centre, round(16.0 * radius), level, -1, cv2.LINE_8, 4)


def _found(shadows, blur):
    """Shares of the grains that are found, and of the discs that are none."""
    tray, picture, places, radii = _picture(shadows, blur)
    detector = BeadDetector(TrackingSettings(), tray, _SCALE)
    for _ in range(6):
        grains = detector.detect(picture)[1]
    distances = np.linalg.norm(grains.positions[:, np.newaxis] - places, axis=2) / radii
    return np.mean(distances.min(axis=0) < 0.5), np.mean(distances.min(axis=1) > 0.8)


@pytest.mark.parametrize(('shadows', 'blur'), [(0.0, 0.6), (0.45, 0.6), (0.2, 2.0)])
def test_grains_are_found_and_their_shadows_are_not(shadows, blur):
    right, wrong = _found(shadows, blur)
    assert right > 0.97
    assert wrong < 0.02


def test_the_covered_share_is_that_of_discs_at_random():
    tray = load_trays()[7]
    grains = _grains_of(tray)
    random = np.random.default_rng(2)
    length, width = tray.dimensions[:2]
    beads, free, covered = [], 0, 0
    while len(beads) < 25:
        place = random.uniform(1e-3, [length - 1e-3, width - 1e-3])
        if all(np.linalg.norm(place - other) > 2e-3 for other in beads):
            beads.append(place)
    points = random.uniform(0.0, [length, width], (4000, 2))
    points = points[[min(np.linalg.norm(beads - point, axis=1)) > 1e-3 for point in points]]
    for _ in range(20):
        diameters = random.uniform(grains[0].diameter_low, grains[0].diameter_high, 4000)
        mean = 0.5 * grains[0].diameter
        places = random.uniform(mean, [length - mean, width - mean], (4000, 2))
        outside = [min(np.linalg.norm(beads - place, axis=1)) > 1e-3 for place in places]
        places, diameters = places[outside][: grains[0].count], diameters[outside]
        for place, diameter in zip(places, diameters, strict=False):
            covered += np.count_nonzero(np.linalg.norm(points - place, axis=1) < 0.5 * diameter)
        free += len(points)
    assert covered_share(tray, grains) == pytest.approx(1.0 - np.exp(-covered / free), rel=0.05)


def test_the_threshold_leaves_the_share_of_the_grains_above_it():
    darkness = np.zeros((40, 100), dtype=np.uint8)
    darkness[:, :30], darkness[:, :20] = 100, 180
    classes = np.full(darkness.shape, FLOOR, dtype=np.uint8)
    threshold = GrayThreshold(0.2)
    for _ in range(4):
        threshold.update(darkness, classes)
    assert 100.0 * 100 / 255 <= threshold.percent < 100.0 * 180 / 255
    shares = [(darkness > 2.55 * threshold.percent).mean()]
    assert shares == [pytest.approx(0.2)]


def test_pixels_of_coloured_beads_do_not_count():
    darkness = np.zeros((40, 100), dtype=np.uint8)
    darkness[:, :50], darkness[:, :10] = 250, 130
    classes = np.full(darkness.shape, FLOOR, dtype=np.uint8)
    classes[:, 10:50] = RED
    threshold = GrayThreshold(0.2)
    threshold.update(darkness, classes)
    assert threshold.percent < 100.0 * 130 / 255


def test_grains_in_layers_keep_the_fixed_threshold():
    threshold = GrayThreshold(0.0)
    threshold.update(np.full((8, 8), 250, dtype=np.uint8), np.full((8, 8), FLOOR, dtype=np.uint8))
    assert threshold.percent == GrayThreshold(0.0).percent
