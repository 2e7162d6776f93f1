"""Videos and folders of images become bags: every picture once, upright, when it was taken."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from fractions import Fraction

import cv2
import numpy as np
import pytest
from PIL import Image
from videos import (
    CALIBRATION,
    NS,
    START_NS,
    STARTED,
    STEP,
    imported,
    packets_of,
    picture,
    turn_video,
    write_images,
    write_video,
)

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.calibration_file import load_calibration
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.jpeg_header import jpeg_head
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import as_json, import_films

CAMERA = '/nanorocks/camera/image_raw/compressed'


@pytest.mark.parametrize('name', ['a.mp4', 'a.avi', 'a.mov', 'a.mkv'])
@pytest.mark.parametrize('codec', ['mjpeg', 'mpeg4', 'libx264'])
def test_every_picture_of_a_video_comes_with_its_time(tmp_path, name, codec):
    film = write_video(tmp_path / name, range(12), codec=codec)
    found, numbers, times = imported(film, tmp_path / 'bag')
    assert numbers == list(range(12))
    np.testing.assert_allclose(times, [STEP * k for k in range(12)], atol=0.6)
    assert found.duration == pytest.approx(11 * STEP / 1e3, abs=1e-3)
    assert found.duplicates_dropped == found.broken == 0
    bag = open_bag(tmp_path / 'bag')
    assert bag.complete
    assert bag.metadata['source'] == name
    assert bag.metadata['import'] == 'complete'
    assert bag.metadata['source_sha256'] == hashlib.sha256(film.read_bytes()).hexdigest()
    assert bag.topics[CAMERA].type == 'sensor_msgs/msg/CompressedImage'


def test_colours_are_those_of_the_video(tmp_path):
    write_video(tmp_path / 'a.mkv', range(3), codec='ffv1', form='bgr0')
    import_films([tmp_path / 'a.mkv'], tmp_path / 'bag', STARTED, lambda _: None)
    for number, frame in enumerate(BagFrames(tmp_path / 'bag').frames()):
        difference = frame.image.astype(int) - picture(number)
        assert np.abs(difference[45:, 70:]).max() <= 4


@pytest.mark.parametrize('name', ['a.avi', 'a.mp4'])
def test_jpegs_of_a_video_go_in_byte_for_byte(tmp_path, name):
    film = write_video(tmp_path / name, range(5))
    found, _, _ = imported(film, tmp_path / 'bag')
    bag = open_bag(tmp_path / 'bag')
    contents = [bytes(bag.deserialize(m).data) for m in bag.messages([CAMERA])]
    assert contents == packets_of(film)
    assert found.provenance['pictures'] == 'as stored'


def test_jpegs_without_huffman_tables_get_the_standard_ones(tmp_path):
    """As cameras on USB send them; OpenCV writes the standard tables, so they can be taken out."""
    folder = tmp_path / 'images'
    folder.mkdir()
    for number in range(3):
        content = cv2.imencode('.jpg', picture(number))[1].tobytes()
        while b'\xff\xc4' in content:
            place = content.index(b'\xff\xc4')
            content = content[:place] + content[place + 2 + content[place + 3] :]
        assert not jpeg_head(content).tables
        (folder / f'{number}.jpg').write_bytes(content)
    settings = ImportSettings(start_ns=START_NS, rate=Fraction(25))
    found, numbers, _ = imported(folder, tmp_path / 'bag', settings)
    assert numbers == [0, 1, 2]
    assert found.provenance['pictures'] == 'as stored'
    for number, frame in enumerate(BagFrames(tmp_path / 'bag').frames()):
        expected = cv2.imdecode(cv2.imencode('.jpg', picture(number))[1], cv2.IMREAD_COLOR)
        np.testing.assert_array_equal(frame.image, expected)


# --- times ----------------------------------------------------------------------------------


def test_a_variable_rate_is_kept(tmp_path):
    times = [0, 40, 55, 200, 230, 900]
    write_video(tmp_path / 'a.mkv', range(6), times=times)
    _, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == list(range(6))
    assert stamps == times


@pytest.mark.parametrize(('times', 'order', 'moved'), [
    ([0, 80, 40, 120, 160, 200], [0, 2, 1, 3, 4, 5], 1),
    ([80, 0, 40, 120, 160, 200], [1, 2, 0, 3, 4, 5], 2),
])  # fmt: skip
def test_pictures_out_of_order_are_sorted_by_their_times(tmp_path, times, order, moved):
    write_video(tmp_path / 'a.mkv', range(6), times=times)
    found, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == order
    assert stamps == [0, 40, 80, 120, 160, 200]
    assert any(f'{moved} frames came out of order' in notice for notice in found.notices)


def test_a_time_that_cannot_be_is_replaced(tmp_path):
    write_video(tmp_path / 'a.mkv', range(8), times=[0, 40, 80, 120, 80, 200, 240, 280])
    found, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == list(range(8))
    assert stamps == [0, 40, 80, 120, 160, 200, 240, 280]
    assert any('1 frames have a time that cannot be' in notice for notice in found.notices)


def test_a_clock_that_was_set_back_goes_on(tmp_path):
    times = [*range(0, 400, 40), *range(0, 400, 40)]
    write_video(tmp_path / 'a.mkv', range(20), times=times)
    found, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == list(range(20))
    assert stamps == list(range(0, 800, 40))
    assert any('1 times the clock was set back' in notice for notice in found.notices)


def test_the_rate_of_the_camera_can_be_given(tmp_path):
    write_video(tmp_path / 'a.avi', range(5))
    settings = ImportSettings(start_ns=START_NS, rate=Fraction(500))
    _, _, stamps = imported(tmp_path / 'a.avi', tmp_path / 'bag', settings)
    assert stamps == [0, 2, 4, 6, 8]


@pytest.mark.parametrize(('tags', 'expected'), [
    ({'creation_time': '2023-11-14T22:13:20Z'}, START_NS),
    ({'creation_time': '1904-01-01T00:00:00Z'}, NS * NS),
    ({}, NS * NS),
])  # fmt: skip
def test_a_film_begins_when_its_container_says(tmp_path, tags, expected):
    write_video(tmp_path / 'a.mp4', range(3), tags=tags)
    found = import_films([tmp_path / 'a.mp4'], tmp_path / 'bag', ImportSettings(), lambda _: None)
    assert found.start_ns == open_bag(tmp_path / 'bag').start_ns == expected
    unknown = expected == NS * NS
    assert unknown == any('does not say when it was taken' in notice for notice in found.notices)


def test_parts_of_a_film_follow_one_another(tmp_path):
    films = [write_video(tmp_path / f'{k}.avi', range(4 * k, 4 * k + 4)) for k in range(3)]
    _, numbers, stamps = imported(films, tmp_path / 'bag')
    assert numbers == list(range(12))
    assert stamps == [STEP * k for k in range(12)]


def test_a_pause_between_parts_is_kept(tmp_path):
    films = []
    for k, begin in enumerate(('22:13:20', '22:13:50')):
        tags = {'creation_time': f'2023-11-14T{begin}Z'}
        films.append(write_video(tmp_path / f'{k}.mp4', range(4 * k, 4 * k + 4), tags=tags))
    found, _, stamps = imported(films, tmp_path / 'bag', ImportSettings())
    assert stamps[3] == pytest.approx(3 * STEP, abs=0.1)
    assert stamps[4] == 30_000
    assert any('begins 29.9 s after the part before it' in notice for notice in found.notices)


# --- pictures stored twice ------------------------------------------------------------------


@pytest.mark.parametrize('codec', ['mjpeg', 'mpeg4', 'libx264', 'ffv1'])
@pytest.mark.parametrize('times', [2, 3])
def test_pictures_stored_twice_are_dropped_and_counted(tmp_path, codec, times):
    stored = [number for number in range(15) for _ in range(times)]
    options = {'flags': '+qscale', 'global_quality': '236'} if 'm' in codec else {}
    write_video(tmp_path / 'a.mkv', stored, codec=codec, **options)
    found, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == list(range(15))
    assert found.duplicates_dropped == 15 * (times - 1)
    np.testing.assert_allclose(stamps, [times * STEP * k for k in range(15)], atol=0.6)


def test_single_repeats_are_found_among_others(tmp_path):
    stored = [0, 1, 2, 3, 3, 4, 5, 6, 7, 7, 7, 8, 9]
    write_video(tmp_path / 'a.mp4', stored, codec='libx264')
    found, numbers, _ = imported(tmp_path / 'a.mp4', tmp_path / 'bag')
    assert numbers == list(range(10))
    assert found.duplicates_dropped == 3


def test_of_a_picture_that_stands_still_a_frame_a_second_is_kept(tmp_path):
    write_video(tmp_path / 'a.mkv', [0, 1, *[2] * 60, 3], codec='ffv1', form='bgr0')
    found, numbers, _ = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == [0, 1, 2, 2, 2, 3]
    assert found.duplicates_dropped == 57
    assert any('stood still for 2.4 s' in notice for notice in found.notices)


# --- rotation, calibration ------------------------------------------------------------------


@pytest.mark.parametrize(('turn', 'rotation'), [
    ((0, 1, -1, 0), cv2.ROTATE_90_CLOCKWISE),
    ((-1, 0, 0, -1), cv2.ROTATE_180),
    ((0, -1, 1, 0), cv2.ROTATE_90_COUNTERCLOCKWISE),
])  # fmt: skip
@pytest.mark.parametrize('codec', ['mjpeg', 'mpeg4'])
def test_a_rotation_flag_is_applied_and_reported(tmp_path, turn, rotation, codec):
    film = turn_video(write_video(tmp_path / 'a.mp4', range(3), codec=codec), *turn)
    found = import_films([film], tmp_path / 'bag', STARTED, lambda _: None)
    for number, frame in enumerate(BagFrames(tmp_path / 'bag').frames()):
        expected = cv2.rotate(picture(number), rotation)
        assert frame.image.shape == expected.shape
        assert np.abs(frame.image.astype(int) - expected).mean() < 8
    assert any('as its rotation flag says' in notice for notice in found.notices)


def test_the_calibration_goes_into_the_camera_info(tmp_path):
    (tmp_path / 'lens.yaml').write_text(CALIBRATION)
    calibration = load_calibration(tmp_path / 'lens.yaml')
    settings = ImportSettings(
        start_ns=START_NS, calibration=calibration, calibration_name='lens.yaml'
    )
    write_video(tmp_path / 'a.avi', range(3))
    imported(tmp_path / 'a.avi', tmp_path / 'bag', settings)
    bag = open_bag(tmp_path / 'bag')
    (message,) = bag.messages(['/nanorocks/camera/camera_info'])
    assert tuple(bag.deserialize(message).p) == calibration.info.p
    assert tuple(bag.deserialize(message).d) == calibration.info.d
    assert bag.topics['/nanorocks/camera/camera_info'].qos.transient_local
    assert BagFrames(tmp_path / 'bag').view() is not None
    other = turn_video(write_video(tmp_path / 'b.mp4', range(2)), 0, 1, -1, 0)
    with pytest.raises(ConfigurationError, match=r'lens\.yaml: is for 96x64 px, .* has 64x96 px'):
        import_films([other], tmp_path / 'c', settings, lambda _: None)
    assert not (tmp_path / 'c').exists()


# --- folders of images ----------------------------------------------------------------------


RATE = ImportSettings(start_ns=START_NS, rate=Fraction(10))


@pytest.mark.parametrize(('ending', 'pictures'), [
    ('jpg', 'as stored'), ('png', 'as stored'), ('bmp', 'JPEG of quality 95'),
])  # fmt: skip
def test_a_folder_of_images_is_one_film_in_natural_order(tmp_path, ending, pictures):
    folder = write_images(tmp_path / 'images', [f'run {k}.{ending}' for k in range(12)])
    (folder / 'notes.txt').write_text('not an image')
    found, numbers, stamps = imported(folder, tmp_path / 'bag', RATE)
    assert numbers == list(range(12))
    assert stamps == [100 * k for k in range(12)]
    assert found.provenance['pictures'] == pictures
    first = next(iter(open_bag(tmp_path / 'bag').messages([CAMERA])))
    assert ((folder / f'run 0.{ending}').read_bytes() in first.cdr) == (pictures == 'as stored')


@pytest.mark.parametrize('names', [
    ['1700000000.000.png', '1700000000.040.png', '1700000000.095.png'],
    ['cam_1700000000000.png', 'cam_1700000000040.png', 'cam_1700000000095.png'],
    ['1700000000000000000.png', '1700000000040000000.png', '1700000000095000000.png'],
    ['2023-11-14T22-13-20.000.png', '2023-11-14T22-13-20.040.png', '2023-11-14T22-13-20.095.png'],
    ['20231114_221320_000.png', '20231114_221320_040.png', '20231114_221320_095.png'],
])  # fmt: skip
def test_names_of_images_may_say_when_they_were_taken(tmp_path, names):
    folder = write_images(tmp_path / 'images', names)
    _, numbers, stamps = imported(folder, tmp_path / 'bag', ImportSettings())
    assert numbers == [0, 1, 2]
    assert stamps == [0, 40, 95]


def test_exif_may_say_when_images_were_taken_and_how_the_camera_was_held(tmp_path):
    folder = tmp_path / 'images'
    folder.mkdir()
    for number, fraction in enumerate(('00', '04', '15')):
        notes = Image.Exif()
        notes[0x0112] = 6
        notes.get_ifd(0x8769).update({0x9003: '2023:11:14 22:13:20', 0x9291: fraction})
        turned = Image.fromarray(picture(number)[..., ::-1]).rotate(90, expand=True)
        turned.save(folder / f'{number}.jpg', exif=notes, quality=95)
    found, numbers, stamps = imported(folder, tmp_path / 'bag', ImportSettings())
    assert numbers == [0, 1, 2]
    assert stamps == [0, 40, 150]
    assert found.provenance['pictures'] == 'JPEG of quality 95'


@pytest.mark.parametrize('names', [
    ['0001.png', '0002.png', '0003.png'],
    ['1700000000.000.png', '1700000000.040.png', 'x.png'],
    ['a_20231114.png', 'b_20231115.png', 'c_20231116.png'],
])  # fmt: skip
def test_images_of_which_nothing_says_when_they_were_taken_need_a_rate(tmp_path, names):
    folder = write_images(tmp_path / 'images', names)
    with pytest.raises(ConfigurationError, match=r'nothing says when .*; pass --rate'):
        import_films([folder], tmp_path / 'bag', STARTED, lambda _: None)
    assert not (tmp_path / 'bag').exists()


def test_a_broken_image_keeps_its_place_in_time(tmp_path):
    folder = write_images(tmp_path / 'images', [f'{k}.jpg' for k in range(6)])
    (folder / '2.jpg').write_bytes((folder / '2.jpg').read_bytes()[:-200])
    (folder / '4.jpg').write_bytes(b'')
    found, numbers, stamps = imported(folder, tmp_path / 'bag', RATE)
    assert numbers == [0, 1, 3, 5]
    assert stamps == [0, 100, 300, 500]
    assert found.broken == 2


# --- what cannot be used --------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'content', 'what'), [
    ('a.mp4', b'', 'is no video that can be read'),
    ('a.mp4', b'nothing like it' * 99, 'is no video that can be read'),
    ('notes.txt', b'text that a library takes for a film\n' * 99, 'holds no film'),
    ('a.mcap', b'\x89MCAP0\r\n' + bytes(99), 'holds no film'),
])  # fmt: skip
def test_a_video_that_is_none_is_refused(tmp_path, name, content, what):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=what) as caught:
        import_films([tmp_path / name], tmp_path / 'bag', STARTED, lambda _: None)
    assert '\n' not in str(caught.value)
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize(('name', 'codec'), [('a.avi', 'mjpeg'), ('a.mkv', 'libx264')])
def test_a_video_cut_short_is_imported_up_to_the_cut(tmp_path, name, codec):
    film = write_video(tmp_path / name, range(30), codec=codec)
    content = film.read_bytes()
    film.write_bytes(content[: content.index(packets_of(film)[20]) + 10])
    _, numbers, _ = imported(film, tmp_path / 'bag')
    assert 10 <= len(numbers) <= 20
    assert numbers == sorted(set(numbers))


def test_a_video_with_damage_in_its_middle_is_imported_around_it(tmp_path):
    film = write_video(tmp_path / 'a.avi', range(20))
    content = bytearray(film.read_bytes())
    place = content.index(packets_of(film)[8])
    content[place : place + 4] = bytes(4)
    film.write_bytes(content)
    found, numbers, stamps = imported(film, tmp_path / 'bag')
    assert numbers == [k for k in range(20) if k != 8]
    assert stamps == [STEP * k for k in numbers]
    assert found.broken == 1
    assert any('1 frames are damaged' in notice for notice in found.notices)


def test_parts_of_different_sizes_are_refused(tmp_path):
    one = write_video(tmp_path / 'a.mp4', range(2), codec='mpeg4')
    other = turn_video(write_video(tmp_path / 'b.mp4', range(2), codec='mpeg4'), 0, 1, -1, 0)
    with pytest.raises(RecordingError, match=r'has pictures of 64x96 px, .* of 96x64 px'):
        import_films([one, other], tmp_path / 'bag', STARTED, lambda _: None)


def test_a_bag_that_exists_is_not_overwritten(tmp_path):
    write_video(tmp_path / 'a.avi', range(2))
    (tmp_path / 'bag').mkdir()
    with pytest.raises(RecordingError, match='exists already and is not overwritten'):
        import_films([tmp_path / 'a.avi'], tmp_path / 'bag', STARTED, lambda _: None)
    assert list((tmp_path / 'bag').iterdir()) == []


def test_hostile_names_and_notes_come_through(tmp_path):
    name = os.fsdecode(b'Ble\xef \xc3\xa9t\xc3\xa9: {x} "%s" \n- a: [\xff.avi')
    tags = {'comment': '!!python/object:os.system [}\x07\n...', 'title': '#'}
    film = write_video(tmp_path / 'a.mkv', range(2), tags=tags).rename(tmp_path / name)
    _, numbers, _ = imported(film, tmp_path / 'a bag: é')
    assert numbers == [0, 1]
    bag = open_bag(tmp_path / 'a bag: é')
    assert bag.notices == ()
    assert '!!python/object' in bag.metadata['camera.COMMENT']


def test_notes_that_are_not_utf8_are_kept_as_they_can_be_shown(tmp_path):
    video = write_video(tmp_path / 'a.mkv', range(3), tags={'comment': 'Muenster'})
    video.write_bytes(video.read_bytes().replace(b'Muenster', 'M\xfcnsterx'.encode('latin-1')))
    imported(video, tmp_path / 'bag')
    assert open_bag(tmp_path / 'bag').metadata['camera.COMMENT'] == r'M\xfcnsterx'


# --- as a command ---------------------------------------------------------------------------

COMMAND = [
    sys.executable,
    '-c',
    'from nanorocks_ros.cli.main import main; exit(main())',
    'import',
]


def many_images(folder, count=1500):
    """A folder of so many images that its import can be interrupted."""
    write_images(folder, ['0.png', '1.png'])
    for k in range(2, count):
        (folder / f'{k}.png').hardlink_to(folder / f'{k % 2}.png')
    return folder


def interrupted(arguments, bag):
    """Import until something is in a bag, then Ctrl-C; the last line that was said."""
    process = subprocess.Popen([*COMMAND, *arguments], stderr=subprocess.PIPE, text=True)
    try:
        end = time.monotonic() + 60
        while not (bag.is_dir() and any(path.stat().st_size > 9999 for path in bag.iterdir())):
            assert time.monotonic() < end
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    return said.splitlines()[-1]


def test_an_interrupted_import_leaves_a_bag_that_can_be_read(tmp_path):
    folder, bag = many_images(tmp_path / 'images'), tmp_path / 'bag'
    options = ('--rate', '30', '--start', '2023-11-14T22:13:20Z')
    said = interrupted([str(folder), '-o', str(bag), *options], bag)
    assert said.startswith('nanorocks: interrupted; files written so far')
    left = open_bag(bag)
    assert not left.complete
    assert left.notices == (
        f'{bag}: holds only part of the film, since its import was interrupted',
    )
    assert left.metadata['import'] == 'unfinished'
    assert 0 < left.topics[CAMERA].count < 1500


def test_an_interrupted_import_of_many_goes_on_where_it_was(tmp_path):
    write_video(tmp_path / 'a.avi', range(3))
    films = [tmp_path / 'a.avi', many_images(tmp_path / 'b')]
    bags = tmp_path / 'bags'
    options = ('--rate', '30', '--start', '2023-11-14T22:13:20Z')
    arguments = [*map(str, films), '--each', '-o', str(bags), *options]
    said = interrupted(arguments, bags / '.unfinished' / 'b')
    assert said == 'nanorocks: interrupted; the same command goes on with what is left'
    # Of what is in the folder everything is whole.
    assert [path.name for path in bags.iterdir() if not path.name.startswith('.')] == ['a']
    done = subprocess.run([*COMMAND, *arguments, '--json'], capture_output=True, check=True)
    found = json.loads(done.stdout)
    assert found['skipped'] == [str(bags / 'a')]
    assert [one['bag'] for one in found['imported']] == [str(bags / 'b')]
    assert BagFrames(bags / 'b').count == found['frames']
    assert sorted(os.listdir(bags)) == ['a', 'b']


def test_what_is_printed_is_what_programs_rely_on(tmp_path):
    write_video(tmp_path / 'a.mkv', [0, 1, 1, 2], codec='ffv1', form='bgr0')
    found, _, _ = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    printed = as_json(found)
    assert {k: printed[k] for k in ('frames', 'duplicates_dropped', 'duration', 'bag')} == {
        'frames': 3,
        'duplicates_dropped': 1,
        'duration': 0.12,
        'bag': str(tmp_path / 'bag'),
    }
