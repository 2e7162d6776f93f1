"""The commands ``nanorocks import``, ``info`` and ``salvage``."""

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
from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    float_array_message,
)
from nanorocks_ros.recordings.offered_qos import OfferedQos

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


def run(capsys, *arguments):
    """Run a command; returns exit code, standard output and last line of standard error."""
    code = main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    return code, printed.out, (printed.err.splitlines() or [''])[-1]


def images(folder, count=6):
    folder.mkdir()
    for number in range(count):
        (folder / f'{number}.jpg').write_bytes(jpeg(number))
    return folder


# --- info -----------------------------------------------------------------------------------


def test_info_prints_the_contents_of_a_bag(tmp_path, capsys):
    numbers = [*range(10), *range(15, 20)]
    path = write_bag(tmp_path / 'a bag: é', numbers, metadata={'nanorocks_ros': '9'})
    code, out, _ = run(capsys, 'info', path, '--json')
    printed = json.loads(out)
    assert code == 0
    topics = {topic['name']: topic for topic in printed['topics']}
    assert set(topics) == {CAMERA, SPEED}
    assert topics[CAMERA]['type'] == 'sensor_msgs/msg/CompressedImage'
    assert topics[CAMERA]['count'] == 15
    assert topics[CAMERA]['rate'] == pytest.approx(25.0)
    assert topics[CAMERA]['gaps'] == 1
    assert topics[CAMERA]['longest_gap'] == pytest.approx(0.24)
    assert printed['duration'] == pytest.approx(0.76)
    assert printed['complete'] is True
    assert printed['trays'] == [3]
    assert printed['pictures'] == 'jpeg'
    assert printed['metadata'] == {'nanorocks_ros': '9'}
    problems = [problem['what'] for problem in printed['health']]
    assert any('no camera_info' in problem for problem in problems)
    assert any('frames are missing at 1 place,' in problem for problem in problems)
    code, out, _ = run(capsys, 'info', path)
    assert code == 0
    assert f'{CAMERA} [sensor_msgs/msg/CompressedImage]: 15, 25 Hz, 1 gap of' in out


def test_info_prints_problems_and_remedies(tmp_path, capsys):
    path = write_bag(tmp_path / 'my bag', range(100))
    file = path / 'my bag.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    code, out, _ = run(capsys, 'info', path, '--json')
    printed = json.loads(out)
    assert code == 0
    assert printed['complete'] is False
    assert printed['messages_lost'] == 200 - sum(topic['count'] for topic in printed['topics']) > 0
    (cut,) = [problem for problem in printed['health'] if 'cut short' in problem['what']]
    assert cut['remedy'] == f"nanorocks salvage '{path}' -o NEW copies readable messages"


def test_info_and_salvage_skip_messages_with_impossible_times(tmp_path, capsys):
    path = tmp_path / 'x.mcap'
    writer = McapWriter(str(path))
    writer.start()
    schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
    channel = writer.register_channel('/empty', 'cdr', schema)
    for stamp in (START_NS, START_NS + STEP_NS, START_NS | 1 << 63):
        writer.add_message(channel, stamp, b'\0\1\0\0\0', stamp)
    writer.finish()
    code, out, _ = run(capsys, 'info', path, '--json')
    printed = json.loads(out)
    assert code == 0
    assert (printed['messages_lost'], printed['complete'], printed['duration']) == (1, False, 0.04)
    assert any(
        '1 messages with impossible time stamps were skipped' in problem['what']
        for problem in printed['health']
    )
    assert run(capsys, 'info', path)[0] == 0
    _, out, _ = run(capsys, 'salvage', path, '-o', tmp_path / 'new', '--json')
    printed = json.loads(out)
    assert (printed['messages_recovered'], printed['messages_lost']) == (2, 1)


@pytest.mark.parametrize(('key', 'remedy'), [
    ('import', 'import it again'), ('salvage', 'salvage the damaged bag again'),
])  # fmt: skip
def test_info_reports_an_interrupted_import_or_salvage(tmp_path, capsys, key, remedy):
    path = write_bag(tmp_path / 'bag', metadata={key: 'unfinished'})
    _, out, _ = run(capsys, 'info', path, '--json')
    printed = json.loads(out)
    assert printed['complete'] is False
    (part,) = [problem for problem in printed['health'] if 'holds only part of' in problem['what']]
    assert part['remedy'] == remedy
    _, out, _ = run(capsys, 'info', path)
    assert 'NOT complete' in out


def test_video_packets_in_messages_are_not_supported(tmp_path, capsys):
    path = write_bag(tmp_path / 'bag', pictures=lambda number: b'\0\0\0\1\x67' + bytes(99))
    _, out, _ = run(capsys, 'info', path, '--json')
    assert json.loads(out)['pictures'] == 'h264'
    assert any(
        "'h264', which is not supported" in problem['what']
        for problem in json.loads(out)['health']
    )
    code, _, last = run(capsys, 'analyse', path, '--no-output')
    assert code == 1
    assert "holds 'h264', a video whose frames depend on each other; record JPEG or PNG" in last


def test_control_sequences_in_a_bag_are_escaped(tmp_path, capsys):
    path = write_bag(tmp_path / 'bag', range(3), metadata={HOSTILE: HOSTILE})
    code, out, _ = run(capsys, 'info', path)
    assert code == 0
    assert '\x1b' not in out
    assert not any(line.startswith('nanorocks: all is well') for line in out.splitlines())
    _, out, _ = run(capsys, 'info', path, '--json')
    assert json.loads(out)['metadata'] == {HOSTILE: HOSTILE}


# --- salvage --------------------------------------------------------------------------------


def test_salvage_prints_the_documented_json(tmp_path, capsys):
    path = write_bag(tmp_path / 'bag', range(100))
    file = path / 'bag.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    new = tmp_path / 'ñew bag'
    code, out, _ = run(capsys, 'salvage', path, '-o', new, '--json')
    printed = json.loads(out)
    assert code == 0
    assert printed['messages_recovered'] == len(list(open_bag(new).messages())) > 50
    assert printed['messages_recovered'] + printed['messages_lost'] == 200
    code, _, last = run(capsys, 'salvage', path, '-o', new)
    assert code == 1
    assert last.endswith('exists already and is not overwritten; pass another path')


# --- names that are not UTF-8-----------------------------------------------------------------


@pytest.mark.parametrize('command', ['import', 'import --each', 'salvage', 'info'])
def test_names_that_are_not_utf_8_are_printed_escaped(tmp_path, command):
    """Standard output accepts UTF-8 only."""
    path = os.fsencode(tmp_path) + b'/lat\xe9\n'
    os.mkdir(path)
    folder = Path(os.fsdecode(path))
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


# --- invalid input -------------------------------------------------------------------------

BAD = {
    'nothing.mcap': (b'', 'is empty (0 bytes)'),
    'magic.mcap': (b'\x89PNG\r\n\x1a\n' + bytes(99), 'is not an MCAP file'),
    'one.bag': (b'#ROSBAG V2.0\n' + bytes(99), 'is a ROS 1 bag; convert it first'),
    'text.txt': (b'no bag at all', ' a bag; '),
    'broken.db3': (b'SQLite format 3\x00' + bytes(999), 'cannot be read as a recording'),
}


@pytest.mark.parametrize('name', BAD)
@pytest.mark.parametrize('command', ['info', 'salvage', 'analyse'])
def test_an_invalid_bag_is_reported_in_one_line_with_exit_code_1(tmp_path, capsys, command, name):
    content, problem = BAD[name]
    (tmp_path / name).write_bytes(content)
    more = ['-o', tmp_path / 'new'] if command == 'salvage' else []
    code, out, last = run(capsys, command, tmp_path / name, *more)
    assert code == 1
    assert out == ''
    assert problem in last
    assert '; ' in last


@pytest.mark.parametrize('arguments', [
    ['--rate', 'fast'], ['--rate', '0'], ['--rate', '30', '--quality', '101'],
    ['--rate', '30', '--start', 'noon'], ['--rate', '30', '--start', '1969-01-01'],
    ['--rate', '30', '--calibration', 'nowhere.yaml'], [],
])  # fmt: skip
def test_a_wrong_call_of_import_is_exit_code_2(tmp_path, capsys, arguments):
    folder = images(tmp_path / 'images')
    code, _, last = run(capsys, 'import', folder, '-o', tmp_path / 'bag', *arguments)
    assert code == 2
    assert '; ' in last
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize('arguments', [
    ['--rate', '1e-8'], ['--rate', '1', '--start', '2038-01-19T03:14:05Z'],
])  # fmt: skip
def test_a_film_after_2038_is_refused(tmp_path, capsys, arguments):
    folder = images(tmp_path / 'images', 20)
    code, _, last = run(capsys, 'import', folder, '-o', tmp_path / 'bag', *arguments)
    assert code == 1
    assert 'a time stamp is after 2038-01-19, ' in last
    assert last.endswith('pass an earlier --start, or the true --rate')


def test_each_prints_the_failed_films_at_the_end(tmp_path, capsys):
    folder = tmp_path / 'films'
    folder.mkdir()
    images(folder / 'good')
    (folder / 'bad.mp4').write_bytes(b'no film')
    code, out, last = run(
        capsys, 'import', folder, '--each', '-o', tmp_path / 'bags', '--rate', '30', '--json'
    )
    printed = json.loads(out)
    assert code == 1
    assert [result['bag'] for result in printed['imported']] == [str(tmp_path / 'bags' / 'good')]
    (failed,) = printed['failed']
    assert failed['video'] == str(folder / 'bad.mp4')
    assert 'is not a readable video' in failed['reason']
    assert '1 of 2 videos could not be imported' in last


# --- full disks and read-only folders --------------------------------------------------------


def limited(size, *arguments):
    """Run the command with a limit on the file size, which acts like a full disk."""
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
def test_a_full_disk_is_reported_and_written_messages_are_readable(tmp_path, command):
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
def test_a_read_only_folder_is_reported(tmp_path, capsys, command):
    closed = tmp_path / 'closed'
    closed.mkdir(mode=0o500)
    source = images(tmp_path / 'images') if command == 'import' else write_bag(tmp_path / 'bag')
    more = ['--rate', '30'] if command == 'import' else []
    code, _, last = run(capsys, command, source, '-o', closed / 'new', *more)
    assert code == 1
    assert 'cannot be written (Permission denied)' in last


@pytest.mark.parametrize('command', ['import', 'salvage'])
def test_a_bag_below_a_file_is_refused(tmp_path, capsys, command):
    (tmp_path / 'file').touch()
    source = images(tmp_path / 'images') if command == 'import' else write_bag(tmp_path / 'bag')
    more = ['--rate', '30'] if command == 'import' else []
    code, _, last = run(capsys, command, source, '-o', tmp_path / 'file' / 'new', *more)
    assert code == 1
    assert 'is no folder; write elsewhere' in last
