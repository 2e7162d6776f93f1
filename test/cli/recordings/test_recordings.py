"""``nanorocks import``, ``info`` and ``salvage`` as people and programs call them."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.writer import Writer as McapWriter

from nanorocks_ros.cli.main import main
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter, OfferedQos, OfferedTopic
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    float_array_message,
)

CAMERA = '/nanorocks/camera/image_raw/compressed'
SPEED = '/nanorocks/tray_3/speed'
START_NS = 1_700_000_000_000_000_000
STEP_NS = 40_000_000
HOSTILE = 'red\x1b[31m <script>alert(1)</script>\nnanorocks: all is well'


def jpeg(number, size=(64, 48)):
    noise = np.random.default_rng(number).integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)
    return cv2.imencode('.jpg', noise)[1].tobytes()


def write_bag(path, numbers=range(20), pictures=jpeg, metadata=None):
    table = {
        CAMERA: OfferedTopic(msgtype='sensor_msgs/msg/CompressedImage', qos=OfferedQos()),
        SPEED: OfferedTopic(msgtype='std_msgs/msg/Float32MultiArray', qos=OfferedQos()),
    }
    with BagWriter(path, table, metadata=metadata or {}) as bag:
        for number in numbers:
            stamp_ns = START_NS + number * STEP_NS
            picture = compressed_image_message(stamp_ns, 'camera', 'jpeg', pictures(number))
            bag.write(CAMERA, stamp_ns, picture)
            bag.write(SPEED, stamp_ns, float_array_message(['time'], [number]))
    return path


def called(capsys, *arguments):
    """Exit code, what was printed, and the last line on standard error."""
    code = main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    return code, printed.out, (printed.err.splitlines() or [''])[-1]


def images(folder, count=6):
    folder.mkdir()
    for number in range(count):
        (folder / f'{number}.jpg').write_bytes(jpeg(number))
    return folder


# --- info -----------------------------------------------------------------------------------


def test_info_says_what_a_bag_holds(tmp_path, capsys):
    numbers = [*range(10), *range(15, 20)]
    path = write_bag(tmp_path / 'a bag: é', numbers, metadata={'nanorocks_ros': '9'})
    code, out, _ = called(capsys, 'info', path, '--json')
    found = json.loads(out)
    assert code == 0
    topics = {one['name']: one for one in found['topics']}
    assert set(topics) == {CAMERA, SPEED}
    assert topics[CAMERA]['type'] == 'sensor_msgs/msg/CompressedImage'
    assert topics[CAMERA]['count'] == 15
    assert topics[CAMERA]['rate'] == pytest.approx(25.0)
    assert topics[CAMERA]['gaps'] == 1
    assert topics[CAMERA]['longest_gap'] == pytest.approx(0.24)
    assert found['duration'] == pytest.approx(0.76)
    assert found['complete'] is True
    assert found['trays'] == [3]
    assert found['pictures'] == 'jpeg'
    assert found['metadata'] == {'nanorocks_ros': '9'}
    said = [one['what'] for one in found['health']]
    assert any('no camera_info' in one for one in said)
    assert any('frames are missing at 1 places' in one for one in said)
    code, out, _ = called(capsys, 'info', path)
    assert code == 0
    assert f'{CAMERA} [sensor_msgs/msg/CompressedImage]: 15, 25 Hz, 1 gaps' in out


def test_info_says_what_is_wrong_and_what_to_do(tmp_path, capsys):
    path = write_bag(tmp_path / 'my bag', range(100))
    file = path / 'my bag.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    code, out, _ = called(capsys, 'info', path, '--json')
    found = json.loads(out)
    assert code == 0
    assert found['complete'] is False
    assert found['messages_lost'] == 200 - sum(one['count'] for one in found['topics']) > 0
    (cut,) = [one for one in found['health'] if 'cut short' in one['what']]
    assert cut['remedy'] == f"nanorocks salvage '{path}' -o NEW copies what can be read"


def test_info_and_salvage_leave_out_messages_of_a_time_that_cannot_be(tmp_path, capsys):
    path = tmp_path / 'x.mcap'
    writer = McapWriter(str(path))
    writer.start()
    schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
    channel = writer.register_channel('/empty', 'cdr', schema)
    for stamp in (START_NS, START_NS + STEP_NS, START_NS | 1 << 63):
        writer.add_message(channel, stamp, b'\0\1\0\0\0', stamp)
    writer.finish()
    code, out, _ = called(capsys, 'info', path, '--json')
    found = json.loads(out)
    assert code == 0
    assert (found['messages_lost'], found['complete'], found['duration']) == (1, False, 0.04)
    assert any('1 messages have a time that cannot be' in one['what'] for one in found['health'])
    assert called(capsys, 'info', path)[0] == 0
    _, out, _ = called(capsys, 'salvage', path, '-o', tmp_path / 'new', '--json')
    found = json.loads(out)
    assert (found['messages_recovered'], found['messages_lost']) == (2, 1)


@pytest.mark.parametrize(('key', 'remedy'), [
    ('import', 'import it again'), ('salvage', 'salvage the damaged bag again'),
])  # fmt: skip
def test_info_says_that_the_making_of_a_bag_was_interrupted(tmp_path, capsys, key, remedy):
    path = write_bag(tmp_path / 'bag', metadata={key: 'unfinished'})
    _, out, _ = called(capsys, 'info', path, '--json')
    found = json.loads(out)
    assert found['complete'] is False
    (part,) = [one for one in found['health'] if 'holds only part of' in one['what']]
    assert part['remedy'] == remedy
    _, out, _ = called(capsys, 'info', path)
    assert 'NOT complete' in out


def test_films_within_messages_are_told_from_pictures(tmp_path, capsys):
    path = write_bag(tmp_path / 'bag', pictures=lambda number: b'\0\0\0\1\x67' + bytes(99))
    _, out, _ = called(capsys, 'info', path, '--json')
    assert json.loads(out)['pictures'] == 'h264'
    assert any(
        "'h264', which is not supported" in one['what'] for one in json.loads(out)['health']
    )
    code, _, last = called(capsys, 'analyse', path, '--no-output')
    assert code == 1
    assert "holds 'h264', a film whose pictures need each other; record JPEG or PNG" in last


def test_what_strangers_wrote_into_a_bag_does_not_reach_the_terminal(tmp_path, capsys):
    path = write_bag(tmp_path / 'bag', range(3), metadata={HOSTILE: HOSTILE})
    code, out, _ = called(capsys, 'info', path)
    assert code == 0
    assert '\x1b' not in out
    assert not any(line.startswith('nanorocks: all is well') for line in out.splitlines())
    _, out, _ = called(capsys, 'info', path, '--json')
    assert json.loads(out)['metadata'] == {HOSTILE: HOSTILE}


# --- salvage --------------------------------------------------------------------------------


def test_salvage_prints_what_programs_rely_on(tmp_path, capsys):
    path = write_bag(tmp_path / 'bag', range(100))
    file = path / 'bag.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    new = tmp_path / 'ñew bag'
    code, out, _ = called(capsys, 'salvage', path, '-o', new, '--json')
    found = json.loads(out)
    assert code == 0
    assert found['messages_recovered'] == len(list(open_bag(new).messages())) > 50
    assert found['messages_recovered'] + found['messages_lost'] == 200
    code, _, last = called(capsys, 'salvage', path, '-o', new)
    assert code == 1
    assert last.endswith('exists already and is not overwritten; pass another path')


# --- names of any bytes ---------------------------------------------------------------------


@pytest.mark.parametrize('command', ['import', 'import --each', 'salvage', 'info'])
def test_names_that_are_no_utf_8_are_shown_all_the_same(tmp_path, command):
    """Where standard output takes nothing but UTF-8."""
    place = os.fsencode(tmp_path) + b'/lat\xe9\n'
    os.mkdir(place)
    folder = Path(os.fsdecode(place))
    bag = write_bag(folder / 'bag')
    arguments = {
        'info': [bag],
        'salvage': [bag, '-o', folder / 'new'],
    }.get(command) or [images(folder / 'images'), '--rate', '30', '-o', folder / 'new']
    code = 'from nanorocks_ros.cli.main import main; exit(main())'
    done = subprocess.run(
        [sys.executable, '-c', code, *command.split(), *(str(argument) for argument in arguments)],
        env={**os.environ, 'PYTHONIOENCODING': 'utf-8:strict'},
        timeout=120,
        check=False,
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr.decode()
    assert b'imported, ' in done.stdout or b'lat\\udce9\\n/' in done.stdout


# --- what cannot be used --------------------------------------------------------------------

BAD = {
    'nothing.mcap': (b'', 'is empty (0 bytes)'),
    'magic.mcap': (b'\x89PNG\r\n\x1a\n' + bytes(99), 'is not an MCAP file'),
    'one.bag': (b'#ROSBAG V2.0\n' + bytes(99), 'is a ROS 1 bag; convert it first'),
    'text.txt': (b'no bag at all', 'is not a bag'),
    'broken.db3': (b'SQLite format 3\x00' + bytes(999), 'cannot be read as a recording'),
}


@pytest.mark.parametrize('name', BAD)
@pytest.mark.parametrize('command', ['info', 'salvage', 'analyse'])
def test_a_bag_that_is_none_is_one_line_and_exit_code_1(tmp_path, capsys, command, name):
    content, what = BAD[name]
    (tmp_path / name).write_bytes(content)
    more = ['-o', tmp_path / 'new'] if command == 'salvage' else []
    code, out, last = called(capsys, command, tmp_path / name, *more)
    assert code == 1
    assert out == ''
    assert what in last
    assert '; ' in last


@pytest.mark.parametrize('arguments', [
    ['--rate', 'fast'], ['--rate', '0'], ['--rate', '30', '--quality', '101'],
    ['--rate', '30', '--start', 'noon'], ['--rate', '30', '--start', '1969-01-01'],
    ['--rate', '30', '--calibration', 'nowhere.yaml'], [],
])  # fmt: skip
def test_a_wrong_call_of_import_is_exit_code_2(tmp_path, capsys, arguments):
    folder = images(tmp_path / 'images')
    code, _, last = called(capsys, 'import', folder, '-o', tmp_path / 'bag', *arguments)
    assert code == 2
    assert '; ' in last
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize('arguments', [
    ['--rate', '1e-8'], ['--rate', '1', '--start', '2038-01-19T03:14:05Z'],
])  # fmt: skip
def test_a_film_beyond_what_a_ros_time_holds_is_refused(tmp_path, capsys, arguments):
    folder = images(tmp_path / 'images', 20)
    code, _, last = called(capsys, 'import', folder, '-o', tmp_path / 'bag', *arguments)
    assert code == 1
    assert 'a stamp lies beyond what a ROS time holds, which ends on 2038-01-19; ' in last
    assert last.endswith('pass an earlier --start, or the true --rate')


def test_each_ends_with_what_could_not_be_imported(tmp_path, capsys):
    folder = tmp_path / 'films'
    folder.mkdir()
    images(folder / 'good')
    (folder / 'bad.mp4').write_bytes(b'no film')
    code, out, last = called(
        capsys, 'import', folder, '--each', '-o', tmp_path / 'bags', '--rate', '30', '--json'
    )
    found = json.loads(out)
    assert code == 1
    assert [one['bag'] for one in found['imported']] == [str(tmp_path / 'bags' / 'good')]
    (failed,) = found['failed']
    assert failed['video'] == str(folder / 'bad.mp4')
    assert 'is no video that can be read' in failed['reason']
    assert '1 of 2 videos could not be imported' in last


# --- a full disk, folders that cannot be written ---------------------------------------------


def limited(size, *arguments):
    """Run the command where no file may grow beyond a size, which the system says like this."""
    code = 'import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); '
    code += 'from nanorocks_ros.cli.main import main; exit(main())'
    return subprocess.run(
        [sys.executable, '-c', code, *(str(argument) for argument in arguments)],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
        stderr=subprocess.PIPE,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize('command', ['import', 'salvage'])
def test_a_disk_that_is_full_is_said_and_costs_nothing_that_was_written(tmp_path, command):
    big = (1280, 960)
    if command == 'import':
        source = tmp_path / 'images'
        source.mkdir()
        for number in range(12):
            (source / f'{number}.jpg').write_bytes(jpeg(number, big))
        arguments = ['import', source, '--rate', '30']
    else:
        source = write_bag(tmp_path / 'bag', range(12), lambda number: jpeg(number, big))
        arguments = ['salvage', source]
    ended = limited(4_000_000, *arguments, '-o', tmp_path / 'new')
    assert ended.returncode == 1
    assert 'Traceback' not in ended.stderr
    assert 'cannot be written (File too large)' in ended.stderr.splitlines()[-1]
    left = open_bag(tmp_path / 'new')
    assert 2 <= left.topics[CAMERA].count < 12
    assert len(list(left.messages([CAMERA]))) == left.topics[CAMERA].count


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
@pytest.mark.parametrize('command', ['import', 'salvage'])
def test_a_folder_that_cannot_be_written_is_said(tmp_path, capsys, command):
    closed = tmp_path / 'closed'
    closed.mkdir(mode=0o500)
    source = images(tmp_path / 'images') if command == 'import' else write_bag(tmp_path / 'bag')
    more = ['--rate', '30'] if command == 'import' else []
    code, _, last = called(capsys, command, source, '-o', closed / 'new', *more)
    assert code == 1
    assert 'cannot be written (Permission denied)' in last


@pytest.mark.parametrize('command', ['import', 'salvage'])
def test_a_bag_below_a_file_is_refused(tmp_path, capsys, command):
    (tmp_path / 'file').touch()
    source = images(tmp_path / 'images') if command == 'import' else write_bag(tmp_path / 'bag')
    more = ['--rate', '30'] if command == 'import' else []
    code, _, last = called(capsys, command, source, '-o', tmp_path / 'file' / 'new', *more)
    assert code == 1
    assert 'cannot be written (Not a directory)' in last
