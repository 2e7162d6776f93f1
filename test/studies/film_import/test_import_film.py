"""Import of videos and folders of images: every frame once, upright, with its time."""

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
    set_display_matrix,
    write_images,
    write_video,
)

from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.calibration_file import load_calibration
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.jpeg_header import jpeg_head
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films

CAMERA = '/nanorocks/camera/image_raw/compressed'


@pytest.mark.parametrize('name', ['a.mp4', 'a.avi', 'a.mov', 'a.mkv'])
@pytest.mark.parametrize('codec', ['mjpeg', 'mpeg4', 'libx264'])
def test_every_frame_of_a_video_is_imported_with_its_time(tmp_path, name, codec):
    film = write_video(tmp_path / name, range(12), codec=codec)
    result, numbers, times = imported(film, tmp_path / 'bag')
    assert numbers == list(range(12))
    np.testing.assert_allclose(times, [STEP * k for k in range(12)], atol=0.6)
    assert result.duration == pytest.approx(11 * STEP / 1e3, abs=1e-3)
    assert result.duplicates_dropped == result.damaged == 0
    bag = open_bag(tmp_path / 'bag')
    assert bag.complete
    assert bag.metadata['source'] == name
    assert bag.metadata['import'] == 'complete'
    assert bag.metadata['source_sha256'] == hashlib.sha256(film.read_bytes()).hexdigest()
    assert bag.topics[CAMERA].type == 'sensor_msgs/msg/CompressedImage'


def test_colours_are_preserved(tmp_path):
    write_video(tmp_path / 'a.mkv', range(3), codec='ffv1', pixel_format='bgr0')
    import_films([tmp_path / 'a.mkv'], tmp_path / 'bag', STARTED, lambda _: None)
    for number, frame in enumerate(BagFrames(tmp_path / 'bag').frames()):
        difference = frame.image.astype(int) - picture(number)
        assert np.abs(difference[45:, 70:]).max() <= 4


@pytest.mark.parametrize('name', ['a.avi', 'a.mp4'])
def test_jpegs_of_a_video_are_copied_byte_for_byte(tmp_path, name):
    film = write_video(tmp_path / name, range(5))
    result, _, _ = imported(film, tmp_path / 'bag')
    bag = open_bag(tmp_path / 'bag')
    contents = [bytes(bag.deserialize(m).data) for m in bag.messages([CAMERA])]
    assert contents == packets_of(film)
    assert result.provenance['pictures'] == 'as stored'


def test_jpegs_without_huffman_tables_get_the_standard_ones(tmp_path):
    """USB cameras omit the tables; OpenCV writes the standard ones, so they can be removed."""
    folder = tmp_path / 'images'
    folder.mkdir()
    for number in range(3):
        content = cv2.imencode('.jpg', picture(number))[1].tobytes()
        while b'\xff\xc4' in content:
            offset = content.index(b'\xff\xc4')
            content = content[:offset] + content[offset + 2 + content[offset + 3] :]
        assert not jpeg_head(content).tables
        (folder / f'{number}.jpg').write_bytes(content)
    settings = ImportSettings(start_ns=START_NS, rate=Fraction(25))
    result, numbers, _ = imported(folder, tmp_path / 'bag', settings)
    assert numbers == [0, 1, 2]
    assert result.provenance['pictures'] == 'as stored'
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
def test_frames_out_of_order_are_sorted_by_time(tmp_path, times, order, moved):
    write_video(tmp_path / 'a.mkv', range(6), times=times)
    result, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == order
    assert stamps == [0, 40, 80, 120, 160, 200]
    assert any(f'{moved} frames were out of order' in notice for notice in result.notices)


def test_an_impossible_time_is_replaced(tmp_path):
    write_video(tmp_path / 'a.mkv', range(8), times=[0, 40, 80, 120, 80, 200, 240, 280])
    result, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == list(range(8))
    assert stamps == [0, 40, 80, 120, 160, 200, 240, 280]
    assert any('1 frames with impossible time stamps' in notice for notice in result.notices)


def test_time_continues_after_the_clock_was_set_back(tmp_path):
    times = [*range(0, 400, 40), *range(0, 400, 40)]
    write_video(tmp_path / 'a.mkv', range(20), times=times)
    result, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == list(range(20))
    assert stamps == list(range(0, 800, 40))
    assert any('1 times the clock was set back' in notice for notice in result.notices)


def test_the_rate_of_the_camera_can_be_set(tmp_path):
    write_video(tmp_path / 'a.avi', range(5))
    settings = ImportSettings(start_ns=START_NS, rate=Fraction(500))
    _, _, stamps = imported(tmp_path / 'a.avi', tmp_path / 'bag', settings)
    assert stamps == [0, 2, 4, 6, 8]


@pytest.mark.parametrize(('tags', 'expected'), [
    ({'creation_time': '2023-11-14T22:13:20Z'}, START_NS),
    ({'creation_time': '1904-01-01T00:00:00Z'}, NS * NS),
    ({}, NS * NS),
])  # fmt: skip
def test_the_start_is_the_creation_time_of_the_container(tmp_path, tags, expected):
    write_video(tmp_path / 'a.mp4', range(3), tags=tags)
    result = import_films([tmp_path / 'a.mp4'], tmp_path / 'bag', ImportSettings(), lambda _: None)
    assert result.start_ns == open_bag(tmp_path / 'bag').start_ns == expected
    unknown = expected == NS * NS
    assert unknown == any(
        'the time of recording is unknown' in notice for notice in result.notices
    )


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
    result, _, stamps = imported(films, tmp_path / 'bag', ImportSettings())
    assert stamps[3] == pytest.approx(3 * STEP, abs=0.1)
    assert stamps[4] == 30_000
    assert any(
        'starts 29.9 s after the end of the previous part' in notice for notice in result.notices
    )


# --- duplicate frames ----------------------------------------------------------------------


@pytest.mark.parametrize('codec', ['mjpeg', 'mpeg4', 'libx264', 'ffv1'])
@pytest.mark.parametrize('times', [2, 3])
def test_duplicate_frames_are_dropped_and_counted(tmp_path, codec, times):
    stored = [number for number in range(15) for _ in range(times)]
    options = {'flags': '+qscale', 'global_quality': '236'} if 'm' in codec else {}
    write_video(tmp_path / 'a.mkv', stored, codec=codec, **options)
    result, numbers, stamps = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == list(range(15))
    assert result.duplicates_dropped == 15 * (times - 1)
    np.testing.assert_allclose(stamps, [times * STEP * k for k in range(15)], atol=0.6)


def test_single_repeats_are_found_among_others(tmp_path):
    stored = [0, 1, 2, 3, 3, 4, 5, 6, 7, 7, 7, 8, 9]
    write_video(tmp_path / 'a.mp4', stored, codec='libx264')
    result, numbers, _ = imported(tmp_path / 'a.mp4', tmp_path / 'bag')
    assert numbers == list(range(10))
    assert result.duplicates_dropped == 3


def test_one_frame_per_second_of_a_still_picture_is_kept(tmp_path):
    write_video(tmp_path / 'a.mkv', [0, 1, *[2] * 60, 3], codec='ffv1', pixel_format='bgr0')
    result, numbers, _ = imported(tmp_path / 'a.mkv', tmp_path / 'bag')
    assert numbers == [0, 1, 2, 2, 2, 3]
    assert result.duplicates_dropped == 57
    assert any('stood still for 2.4 s' in notice for notice in result.notices)


# --- rotation, calibration ------------------------------------------------------------------


@pytest.mark.parametrize(('matrix', 'rotation'), [
    ((0, 1, -1, 0), cv2.ROTATE_90_CLOCKWISE),
    ((-1, 0, 0, -1), cv2.ROTATE_180),
    ((0, -1, 1, 0), cv2.ROTATE_90_COUNTERCLOCKWISE),
])  # fmt: skip
@pytest.mark.parametrize('codec', ['mjpeg', 'mpeg4'])
def test_a_rotation_flag_is_applied_and_reported(tmp_path, matrix, rotation, codec):
    film = set_display_matrix(write_video(tmp_path / 'a.mp4', range(3), codec=codec), *matrix)
    result = import_films([film], tmp_path / 'bag', STARTED, lambda _: None)
    for number, frame in enumerate(BagFrames(tmp_path / 'bag').frames()):
        expected = cv2.rotate(picture(number), rotation)
        assert frame.image.shape == expected.shape
        assert np.abs(frame.image.astype(int) - expected).mean() < 8
    assert any('according to its rotation flag' in notice for notice in result.notices)


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
    other = set_display_matrix(write_video(tmp_path / 'b.mp4', range(2)), 0, 1, -1, 0)
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
    result, numbers, stamps = imported(folder, tmp_path / 'bag', RATE)
    assert numbers == list(range(12))
    assert stamps == [100 * k for k in range(12)]
    assert result.provenance['pictures'] == pictures
    first = next(iter(open_bag(tmp_path / 'bag').messages([CAMERA])))
    assert ((folder / f'run 0.{ending}').read_bytes() in first.cdr) == (pictures == 'as stored')


@pytest.mark.parametrize('names', [
    ['1700000000.000.png', '1700000000.040.png', '1700000000.095.png'],
    ['cam_1700000000000.png', 'cam_1700000000040.png', 'cam_1700000000095.png'],
    ['1700000000000000000.png', '1700000000040000000.png', '1700000000095000000.png'],
    ['2023-11-14T22-13-20.000.png', '2023-11-14T22-13-20.040.png', '2023-11-14T22-13-20.095.png'],
    ['20231114_221320_000.png', '20231114_221320_040.png', '20231114_221320_095.png'],
])  # fmt: skip
def test_times_are_read_from_the_names_of_images(tmp_path, names):
    folder = write_images(tmp_path / 'images', names)
    _, numbers, stamps = imported(folder, tmp_path / 'bag', ImportSettings())
    assert numbers == [0, 1, 2]
    assert stamps == [0, 40, 95]


def test_time_and_orientation_of_images_are_read_from_exif(tmp_path):
    folder = tmp_path / 'images'
    folder.mkdir()
    for number, fraction in enumerate(('00', '04', '15')):
        exif = Image.Exif()
        exif[0x0112] = 6
        exif.get_ifd(0x8769).update({0x9003: '2023:11:14 22:13:20', 0x9291: fraction})
        rotated = Image.fromarray(picture(number)[..., ::-1]).rotate(90, expand=True)
        rotated.save(folder / f'{number}.jpg', exif=exif, quality=95)
    result, numbers, stamps = imported(folder, tmp_path / 'bag', ImportSettings())
    assert numbers == [0, 1, 2]
    assert stamps == [0, 40, 150]
    assert result.provenance['pictures'] == 'JPEG of quality 95'


@pytest.mark.parametrize('names', [
    ['0001.png', '0002.png', '0003.png'],
    ['1700000000.000.png', '1700000000.040.png', 'x.png'],
    ['a_20231114.png', 'b_20231115.png', 'c_20231116.png'],
])  # fmt: skip
def test_images_without_times_need_a_rate(tmp_path, names):
    folder = write_images(tmp_path / 'images', names)
    with pytest.raises(
        ConfigurationError, match=r'have no time stamps: .*; give .* --rate 30 -o '
    ):
        import_films([folder], tmp_path / 'bag', STARTED, lambda _: None)
    assert not (tmp_path / 'bag').exists()


def test_a_damaged_image_does_not_shift_the_others_in_time(tmp_path):
    folder = write_images(tmp_path / 'images', [f'{k}.jpg' for k in range(6)])
    (folder / '2.jpg').write_bytes((folder / '2.jpg').read_bytes()[:-200])
    (folder / '4.jpg').write_bytes(b'')
    result, numbers, stamps = imported(folder, tmp_path / 'bag', RATE)
    assert numbers == [0, 1, 3, 5]
    assert stamps == [0, 100, 300, 500]
    assert result.damaged == 2


# --- invalid input -------------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'content', 'problem'), [
    ('a.mp4', b'', 'is not a readable video'),
    ('a.mp4', b'nothing like it' * 99, 'is not a readable video'),
    ('notes.txt', b'text that a library takes for a film\n' * 99, 'holds no film'),
    ('a.mcap', b'\x89MCAP0\r\n' + bytes(99), 'holds no film'),
])  # fmt: skip
def test_a_file_that_is_not_a_video_is_refused(tmp_path, name, content, problem):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=problem) as caught:
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
    offset = content.index(packets_of(film)[8])
    content[offset : offset + 4] = bytes(4)
    film.write_bytes(content)
    result, numbers, stamps = imported(film, tmp_path / 'bag')
    assert numbers == [k for k in range(20) if k != 8]
    assert stamps == [STEP * k for k in numbers]
    assert result.damaged == 1
    assert any('1 frames that are damaged' in notice for notice in result.notices)


def test_parts_of_different_sizes_are_refused(tmp_path):
    film = write_video(tmp_path / 'a.mp4', range(2), codec='mpeg4')
    other = set_display_matrix(
        write_video(tmp_path / 'b.mp4', range(2), codec='mpeg4'), 0, 1, -1, 0
    )
    with pytest.raises(RecordingError, match=r'has frames of 64x96 px, .* of 96x64 px'):
        import_films([film, other], tmp_path / 'bag', STARTED, lambda _: None)


def test_a_bag_that_exists_is_not_overwritten(tmp_path):
    write_video(tmp_path / 'a.avi', range(2))
    (tmp_path / 'bag').mkdir()
    with pytest.raises(RecordingError, match='exists already and is not overwritten'):
        import_films([tmp_path / 'a.avi'], tmp_path / 'bag', STARTED, lambda _: None)
    assert list((tmp_path / 'bag').iterdir()) == []


def test_unusual_names_and_tags_are_kept(tmp_path):
    name = os.fsdecode(b'Ble\xef \xc3\xa9t\xc3\xa9: {x} "%s" \n- a: [\xff.avi')
    tags = {'comment': '!!python/object:os.system [}\x07\n...', 'title': '#'}
    film = write_video(tmp_path / 'a.mkv', range(2), tags=tags).rename(tmp_path / name)
    _, numbers, _ = imported(film, tmp_path / 'a bag: é')
    assert numbers == [0, 1]
    bag = open_bag(tmp_path / 'a bag: é')
    assert bag.notices == ()
    assert '!!python/object' in bag.metadata['camera.COMMENT']


def test_tags_that_are_not_utf8_are_escaped(tmp_path):
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
MANY = 4000


def many_images(folder, count=MANY):
    """A folder of so many images that its import can be interrupted, also on a busy machine."""
    write_images(folder, ['0.png', '1.png'])
    for k in range(2, count):
        (folder / f'{k}.png').hardlink_to(folder / f'{k % 2}.png')
    return folder


def interrupted(arguments, bag):
    """Interrupt an import once a bag has content; returns the last line of standard error."""
    process = subprocess.Popen([*COMMAND, *arguments], stderr=subprocess.PIPE, text=True)
    try:
        end = time.monotonic() + 60
        while not (bag.is_dir() and any(path.stat().st_size > 9999 for path in bag.iterdir())):
            assert time.monotonic() < end
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, line = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    return line.splitlines()[-1]


def test_an_interrupted_import_leaves_a_bag_that_can_be_read(tmp_path):
    folder, bag = many_images(tmp_path / 'images'), tmp_path / 'bag'
    options = ('--rate', '30', '--start', '2023-11-14T22:13:20Z')
    line = interrupted([str(folder), '-o', str(bag), *options], bag)
    assert line.startswith('nanorocks: interrupted; files written so far')
    left = open_bag(bag)
    assert not left.complete
    assert left.notices == (
        f'{bag}: holds only part of the film because its import was interrupted',
    )
    assert left.metadata['import'] == 'unfinished'
    assert 0 < left.topics[CAMERA].count < MANY


def test_an_interrupted_import_of_many_continues(tmp_path):
    write_video(tmp_path / 'a.avi', range(3))
    films = [tmp_path / 'a.avi', many_images(tmp_path / 'b')]
    bags = tmp_path / 'bags'
    options = ('--rate', '30', '--start', '2023-11-14T22:13:20Z')
    arguments = [*map(str, films), '--each', '-o', str(bags), *options]
    line = interrupted(arguments, bags / '.unfinished' / 'b')
    assert line == (
        'nanorocks: interrupted; run the same command again to import the remaining videos'
    )
    # All bags in the folder are complete.
    assert [path.name for path in bags.iterdir() if not path.name.startswith('.')] == ['a']
    done = subprocess.run([*COMMAND, *arguments, '--json'], capture_output=True, check=True)
    printed = json.loads(done.stdout)
    assert printed['skipped'] == [str(bags / 'a')]
    assert [imported['bag'] for imported in printed['imported']] == [str(bags / 'b')]
    assert BagFrames(bags / 'b').count == printed['frames']
    assert sorted(os.listdir(bags)) == ['a', 'b']


def test_the_printed_json_has_the_documented_keys(tmp_path, capsys):
    film = write_video(tmp_path / 'a.mkv', [0, 1, 1, 2], codec='ffv1', pixel_format='bgr0')
    assert main(['import', str(film), '-o', str(tmp_path / 'bag'), '--json']) == 0
    printed = json.loads(capsys.readouterr().out)
    assert set(printed) == {
        'frames', 'duplicates_dropped', 'duration', 'bag', 'start', 'frames_damaged', 'pictures',
        'notices',
    }  # fmt: skip
    assert {k: printed[k] for k in ('frames', 'duplicates_dropped', 'duration', 'bag')} == {
        'frames': 3,
        'duplicates_dropped': 1,
        'duration': 0.12,
        'bag': str(tmp_path / 'bag'),
    }
