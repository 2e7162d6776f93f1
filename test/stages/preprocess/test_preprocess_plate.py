"""The whole plate through the preprocessor: motion, cycles, flags, and wrong maps."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from plates import SCALE, Plate, settings

from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.pipeline.composition import Pipeline, trays_of
from nanorocks_ros.records import ClusterEstimate, Frame, Notice, Quality, TrayImage
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

LENS = Camera(width=640, height=420, focal=(560.0, 560.0), centre=(324.0, 208.0))


def preprocessor(view=None, **values):
    chosen = settings(**values)
    return Preprocessor(chosen, trays_of(chosen), 'cam', view)


def pushed(stage, frames):
    records = [*(item for frame in frames for item in stage.push(frame)), *stage.flush()]
    images = [record for record in records if isinstance(record, TrayImage)]
    return images, [record.text for record in records if isinstance(record, Notice)]


def swing(number):
    since = max(number - 4, 0)
    return 2.0 * np.sin(0.4 * since), -1.2 * np.sin(0.4 * since)


@pytest.fixture(scope='module')
def swinging():
    """A plate through a lens that starts to swing at the fifth frame."""
    plate = Plate(LENS)
    return [plate.frame(k, swing(k)) for k in range(16)]


def test_the_trays_are_held_still_and_their_motion_is_told(swinging):
    images, texts = pushed(preprocessor(View(camera=LENS)), swinging)
    assert texts == []
    assert [image.tray for image in images[:8]] == list(range(1, 9))
    for number in (2, 5, 8):
        own = [image for image in images if image.tray == number]
        moved = np.array([record.displacement for record in own]) * SCALE
        assert moved == pytest.approx(np.array([swing(k) for k in range(16)]), abs=0.1)
        speed = np.diff(moved, axis=0) * 30 / SCALE
        assert np.array([record.velocity for record in own[1:]]) == pytest.approx(speed, abs=1e-9)
        first = own[0].gray.astype(float)
        assert max(np.abs(record.gray - first).mean() for record in own) < 3.0


def test_without_stabilisation_the_trays_move_in_their_pictures(swinging):
    steady, _ = pushed(preprocessor(View(camera=LENS)), swinging[:9])
    moving, _ = pushed(
        preprocessor(View(camera=LENS), **{'preprocess.stabilise': False}), swinging[:9]
    )
    change = [
        np.abs(images[-8].gray.astype(float) - images[0].gray).mean()
        for images in (steady, moving)
    ]
    assert change[1] > 1.5 * change[0]
    assert all(math.isnan(speed.displacement[0]) for speed in moving)


def test_all_trays_count_the_shake_of_the_plate_together(swinging):
    images, _ = pushed(preprocessor(View(camera=LENS)), swinging)
    cycles = np.array([image.cycle for image in images]).reshape(-1, 8)
    assert (cycles == cycles[:, :1]).all()
    assert cycles[:, 0].tolist() == [0] * 5 + [1] * 11
    assert {image.cycle_start_ns for image in images} == {None, swinging[4].stamp_ns}


def test_the_pipeline_hands_the_count_on_to_its_stages(swinging):
    pipeline = Pipeline(settings(), 'cam', View(camera=LENS))
    for frame in swinging:
        pipeline.push(frame)
    clusters = [record for record in pipeline.flush() if isinstance(record, ClusterEstimate)]
    last_ns = max(estimate.stamp_ns for estimate in clusters)
    cycles = {
        (estimate.tray, estimate.cycle) for estimate in clusters if estimate.stamp_ns == last_ns
    }
    assert cycles == {(tray, 1) for tray in range(1, 9)}


def test_a_lens_of_another_size_is_refused(plate):
    other = Camera(width=1280, height=840, focal=(1120.0, 1120.0), centre=(640.0, 420.0))
    message = r'^cam: the frame is 640x420 px, the calibration .* for 1280x840 px; calibrate'
    with pytest.raises(FrameError, match=message):
        preprocessor(View(camera=other)).push(plate.frame())


def test_trays_below_the_break_of_half_a_frame_are_left_out_and_flagged_afterwards(plate):
    frames = [plate.frame(k) for k in range(4)]
    broken = frames[2].image.copy()
    broken[230:] = 128
    frames[2] = replace(frames[2], image=broken)
    images, texts = pushed(preprocessor(), frames)
    seen = [[image.tray for image in images if image.stamp_ns == f.stamp_ns] for f in frames]
    assert seen[2] == [1, 2, 3, 6, 8]
    assert seen[3] == list(range(1, 9))
    flagged = {image.tray for image in images if image.quality & Quality.HALF_FRAME}
    assert flagged == {4, 5, 7}
    assert any('breaks off at row 230 of 420' in text for text in texts)


def test_a_tray_that_is_hidden_is_flagged_and_moves_with_its_plate(plate):
    frames = [plate.frame(k) for k in range(3)]
    hidden = plate.picture((1.5, 0.5), seed=9)
    x, y, width, height = plate.regions[3]
    hidden[y - 12 : y + height + 12, x - 12 : x + width + 12] = 90
    frames[1] = replace(frames[1], image=hidden)
    images, _ = pushed(preprocessor(), frames)
    lost = [image for image in images if image.quality & Quality.STABILISATION_LOST]
    assert [(record.tray, record.stamp_ns) for record in lost] == [(3, frames[1].stamp_ns)]
    assert np.array(lost[0].displacement) * SCALE == pytest.approx([1.5, 0.5], abs=0.1)
    assert lost[0].quality & Quality.LOW_CONTRAST


def test_a_tray_alone_that_is_hidden_is_not_known_to_be_anywhere(plate):
    regions = list(plate.regions[3])
    stage = preprocessor(**{'trays': [3], 'preprocess.regions_px': regions})
    flat = replace(plate.frame(1), image=np.full((*plate.shape, 3), (88, 90, 92), np.uint8))
    images, _ = pushed(stage, [plate.frame(0), flat, plate.frame(2)])
    assert [math.isnan(image.displacement[0]) for image in images] == [False, True, False]
    assert images[1].quality & Quality.STABILISATION_LOST


def test_a_tray_that_seems_to_leave_its_plate_is_put_back(plate):
    still = plate.picture(seed=1)
    carried = still.copy()
    x, y, width, height = plate.regions[3]
    rows, columns = slice(y - 14, y + height + 14), slice(x - 11, x + width + 14)
    carried[rows, columns] = still[rows, x - 14 : x + width + 11]
    frames = [plate.frame(0), replace(plate.frame(1), image=carried)]
    images, _ = pushed(preprocessor(), frames)
    tray = images[8 + 2]
    assert tray.quality & Quality.STABILISATION_LOST
    assert np.abs(np.array(tray.displacement) * SCALE).max() < 0.1


def test_glare_is_flagged_with_the_share_that_it_hides(plate):
    frame = plate.frame()
    x, y, width, height = plate.regions[4]
    bright = frame.image.copy()
    bright[y : y + height, x : x + width // 2] = 255
    images, _ = pushed(preprocessor(), [replace(frame, image=bright)])
    tray = images[3]
    assert tray.quality == Quality.GLARE | Quality.SATURATED
    assert tray.glare == pytest.approx(0.5, abs=0.1)
    assert images[4].quality == 0
    assert images[4].glare == 0.0


def test_a_gray_camera_works_in_gray_and_says_so(plate):
    frames = [
        Frame(stamp_ns=record.stamp_ns, encoding='mono8', image=record.image[:, :, 1].copy())
        for record in (plate.frame(k, (0.3 * k, 0.0)) for k in range(3))
    ]
    images, _ = pushed(preprocessor(), frames)
    assert all(image.color is None and image.quality == Quality.GRAY_CAMERA for image in images)
    assert images[-1].displacement[0] * SCALE == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        (
            {'preprocess.pixels_per_metre': 0.85 * SCALE},
            r'^cam: preprocess.pixels_per_metre looks wrong: the trays look as at '
            r'4[789]\d\d px/m, not at 4080; set it to about that and see with nanorocks look',
        ),
        ('shift', r'^cam: preprocess.regions_px looks wrong: the trays look shifted by 1\d, -'),
        ('tray 5', r'^cam: preprocess.regions_px looks wrong for tray 5: no walls are seen'),
    ],
)
def test_a_wrong_scale_or_map_is_told_with_the_number_that_looks_wrong(plate, values, message):
    regions = {number: list(region) for number, region in plate.regions.items()}
    if values == 'shift':
        for region in regions.values():
            region[0], region[1] = region[0] - 16, region[1] + 12
    elif values == 'tray 5':
        regions[5][0], regions[5][1] = 370, 300
    if isinstance(values, str):
        flat = [side for number in range(1, 9) for side in regions[number]]
        values = {'preprocess.regions_px': flat}
    images, texts = pushed(preprocessor(**values), [plate.frame(k) for k in range(18)])
    (text,) = [message for message in texts if 'looks wrong' in message]
    assert re.search(message, text)
    assert any(image.quality & Quality.WRONG_SCALE for image in images[-8:])


def test_a_map_that_is_right_is_not_called_wrong(plate):
    images, texts = pushed(preprocessor(), [plate.frame(k) for k in range(18)])
    assert texts == []
    assert all(image.quality == 0 for image in images)


@pytest.mark.parametrize('noise', [1.0, 4.0])
def test_the_scale_of_a_film_from_close_by_is_found(noise):
    camera = SimulationSettings(width_px=720, height_px=720, pixels_per_metre=38.7e3, noise=noise)
    shots = [frame for frame, _ in film(camera, load_trays()[1], 18)]
    chosen = with_values(PipelineSettings(), {}, 'test')
    images, texts = pushed(Preprocessor(chosen, trays_of(chosen), 'cam', None), shots)
    (text,) = [message for message in texts if 'looks wrong' in message]
    assert float(text.split(' px/m')[0].split()[-1]) == pytest.approx(38700.0, rel=0.01)
    assert images[-1].quality & Quality.WRONG_SCALE
    values = {'preprocess.check_tray_positions': False}
    chosen = with_values(PipelineSettings(), values, 'test')
    images, texts = pushed(Preprocessor(chosen, trays_of(chosen), 'cam', None), shots)
    assert not [message for message in texts if 'looks wrong' in message]
    assert not images[-1].quality & Quality.WRONG_SCALE


def test_frames_of_any_rate_and_with_gaps_give_speeds_by_their_stamps(plate):
    times = [0, 33, 50, 120, 900, 950]
    frames = [
        replace(plate.frame(k, (0.02 * ms, 0.0)), stamp_ns=ms * 1_000_000)
        for k, ms in enumerate(times)
    ]
    images, _ = pushed(preprocessor(), frames)
    speeds = [image.velocity[0] * SCALE for image in images if image.tray == 2]
    assert speeds[1:] == pytest.approx([20.0] * 5, abs=4.0)


def test_trays_that_do_not_lie_in_the_picture_are_refused(plate):
    with pytest.raises(ConfigurationError, match='lies outside a picture of 640 x 420 px'):
        preprocessor(**{'preprocess.pixels_per_metre': 9000.0}).push(plate.frame())
