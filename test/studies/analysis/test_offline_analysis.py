"""Analysis of bags without ROS: results, damage, and what cannot be used."""

from __future__ import annotations

import csv
import errno
import itertools
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.records import CorEstimate, SpeedEstimate
from nanorocks_ros.settings import CoolingSettings, PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.analysis.results.results_folder import write_results
from nanorocks_ros.studies.analysis.results.results_json import as_json
from nanorocks_ros.studies.results.results_provenance import BAG_NAME
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array, layout

NS = 1_000_000_000
SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'


@pytest.fixture(scope='module')
def analysis():
    return analyse(SAMPLE, PipelineSettings())


def raw_bag(path, stamps, pictures=None, encoding='mono8', topic=topics.RAW, metadata=None):
    """A bag of raw gray pictures: a bright square that moves to the right."""
    table = {
        topics.EPOCH.absolute(): offered_topic(topics.EPOCH),
        topic.absolute(): offered_topic(topic),
    }
    with BagWriter(path, table, metadata=metadata or {}) as bag:
        bag.write(topics.EPOCH.absolute(), stamps[0], time_message(stamps[0]))
        for number, stamp_ns in enumerate(stamps):
            pixels = np.full((210, 210), 120, np.uint8)
            pixels[50:70, 20 + number % 150 : 40 + number % 150] = 200
            if pictures is not None:
                pixels = pictures(number)
            message = image_message(stamp_ns, 'camera', 'mono8', pixels)
            message.encoding = encoding
            bag.write(topic.absolute(), stamps[0] + number * NS // 30, message)
    return path


def at_30_hz(count):
    return [10 * NS + k * NS // 30 for k in range(count)]


def test_the_sample_bag_gives_one_cycle_with_its_truth(analysis):
    results = as_json(analysis)
    assert results['frames'] > 600
    assert results['frames_lost'] == 0
    assert results['complete']
    tray = results['trays']['1']
    (cycle,) = tray['cycles']
    assert cycle['status'] == 'final'
    assert cycle['relation'] == 'library'
    assert cycle['restitution_lower'] < 0.89 < cycle['restitution_upper']
    assert cycle['wall_restitution_lower'] < 0.99 < cycle['wall_restitution_upper']
    assert cycle['paper_restitution'] > 0.95
    assert cycle['restitution_lower'] < cycle['restitution'] < cycle['restitution_upper']
    assert cycle['start'] == pytest.approx(1.0, abs=0.05)
    assert tray['truth']['restitution'] == pytest.approx(0.89)
    assert tray['truth']['wall_restitution'] == pytest.approx(0.99)


def test_the_speeds_from_the_frames_are_those_of_the_truth(analysis):
    results = analysis.trays[1]
    stamps = np.array([speed.stamp_ns for speed in results.truth])
    true = np.array([speed.mean_projected_speed for speed in results.truth])
    ratios = [
        speed.mean_projected_speed.value / np.interp(speed.stamp_ns, stamps, true)
        for speed in results.speeds
        if speed.cycle == 1
    ]
    assert len(ratios) > 150
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)


def test_results_are_written_as_tables_and_as_a_bag(analysis, tmp_path):
    folder = tmp_path / 'out'
    write_results(analysis, folder, SAMPLE, PipelineSettings())
    with (folder / 'tray_1_speed.csv').open(encoding='utf-8') as file:
        rows = list(csv.reader(file))
    fields = layout(SpeedEstimate).fields
    assert rows[0] == [field.name for field in fields]
    assert len(rows) - 1 == len(analysis.trays[1].speeds)
    bag = open_bag(folder / BAG_NAME)
    cors = [
        from_array(
            CorEstimate,
            bag.deserialize(message).data,
            tray=1,
            epoch_ns=analysis.epoch_ns,
            where=message.topic,
        )
        for message in bag.messages([topics.COR.absolute(1)])
    ]
    expected = [cor.restitution.value for cor in analysis.trays[1].cors]
    assert [cor.restitution.value for cor in cors] == pytest.approx(
        expected, rel=1e-6, nan_ok=True
    )
    assert bag.metadata['source'] == SAMPLE.name


def test_earlier_results_are_replaced_and_anything_else_is_left_alone(analysis, tmp_path):
    folder = tmp_path / 'out'
    write_results(analysis, folder, SAMPLE, PipelineSettings())
    # What somebody put beside them stays.
    (folder / 'notes.txt').write_text('precious')
    (folder / 'figures').mkdir()
    (folder / 'figures' / 'decay.png').write_bytes(b'picture')
    (folder / 'tray_5_speed.parquet').write_bytes(b'of an earlier analysis')
    write_results(analysis, folder, SAMPLE, PipelineSettings())
    assert (folder / 'notes.txt').read_text() == 'precious'
    assert (folder / 'figures' / 'decay.png').read_bytes() == b'picture'
    assert not (folder / 'tray_5_speed.parquet').exists()
    assert open_bag(folder / BAG_NAME).complete
    other = tmp_path / 'thesis'
    other.mkdir()
    (other / 'chapter.txt').write_text('precious')
    with pytest.raises(RecordingError, match='holds no results of ours'):
        write_results(analysis, other, SAMPLE, PipelineSettings())
    assert (other / 'chapter.txt').read_text() == 'precious'


def test_missing_frames_are_counted(tmp_path):
    stamps = [stamp for k, stamp in enumerate(at_30_hz(90)) if not 40 <= k < 47]
    assert analyse(raw_bag(tmp_path / 'bag', stamps), PipelineSettings()).frames_lost == 7


def test_a_late_frame_is_dropped_and_told(tmp_path):
    stamps = at_30_hz(60)
    stamps[30], stamps[31] = stamps[31], stamps[30]
    analysis = analyse(raw_bag(tmp_path / 'bag', stamps), PipelineSettings())
    assert analysis.frames == 59
    assert any('came 0.033 s late and was dropped' in notice for notice in analysis.notices)


def test_time_that_goes_back_starts_afresh_and_is_told(tmp_path):
    stamps = at_30_hz(60)
    analysis = analyse(raw_bag(tmp_path / 'bag', stamps + stamps), PipelineSettings())
    assert analysis.frames == 120
    assert any(
        'time went back by 1.967 s; starting afresh' in notice for notice in analysis.notices
    )


def test_a_scene_in_which_nothing_moves_gives_no_restitution(tmp_path):
    rng = np.random.default_rng(1)
    still = rng.integers(90, 140, (210, 210))

    def picture(_):
        return (still + rng.normal(0, 2, still.shape)).astype(np.uint8)

    analysis = analyse(raw_bag(tmp_path / 'bag', at_30_hz(120), picture), PipelineSettings())
    assert analysis.trays[1].cors == []
    assert all(cluster.cycle == 0 for cluster in analysis.trays[1].clusters)


def run(*arguments):
    return main([str(argument) for argument in arguments])


def error_of(capsys):
    lines = capsys.readouterr().err.strip().splitlines()
    assert not any('Traceback' in line for line in lines)
    return lines[-1]


def test_the_command_prints_the_same_numbers_bit_for_bit_as_one_json_object(
    analysis, capsys, tmp_path
):
    assert run('analyse', SAMPLE, '--json', '-o', tmp_path / 'out') == 0
    results = json.loads(capsys.readouterr().out)
    assert results == json.loads(json.dumps(as_json(analysis)))
    assert set(results) >= {'frames', 'frames_lost', 'seconds', 'trays'}
    tray = results['trays']['1']
    assert len(tray['time']) == len(tray['mean_projected_speed'])
    assert len(tray['time']) == len(tray['method']) == len(tray['quality'])
    assert set(tray['method']) == {'tracking'}
    assert not any(tray['quality'])
    assert all(speed > 0.0 for speed in tray['first_species_speed'][-5:])
    assert set(tray['second_species_speed']) == {None}
    assert set(tray['cycles'][0]) >= {
        'start',
        'initial_speed',
        'haff_time',
        'restitution',
        'restitution_lower',
        'restitution_upper',
        'wall_restitution',
        'relation',
        'status',
        'cluster_size',
        'bodies',
        'onset',
        'sticking_speed',
    }
    assert 0.8 < tray['cycles'][0]['wall_restitution'] < 1.0


def test_the_command_prints_the_restitution_beside_the_truth_for_people(capsys):
    assert run('analyse', SAMPLE, '--no-output', '--cooling-update-interval', '20') == 0
    text = capsys.readouterr().out
    assert 'cycle 1: COR 0.' in text
    assert 'truth:   COR 0.89, walls 0.99' in text


def test_a_parameter_file_for_the_nodes_does_for_the_command(analysis, capsys, tmp_path):
    path = tmp_path / 'mine.yaml'
    cooling = '{probability: 0.5, update_interval: 20.0}'
    path.write_text(f'/**:\n  ros__parameters:\n    cooling: {cooling}\n')
    assert run('analyse', SAMPLE, '--json', '--no-output', '--parameters', path) == 0
    narrow, wide = (
        cycle['restitution_upper'] - cycle['restitution_lower']
        for results in (json.loads(capsys.readouterr().out), as_json(analysis))
        for cycle in results['trays']['1']['cycles'][:1]
    )
    assert narrow < 0.5 * wide


def empty_bag(path):
    with BagWriter(path, {topics.RAW.absolute(): offered_topic(topics.RAW)}, metadata={}):
        pass
    return path


def other_bag(path):
    with BagWriter(path, {'/chatter': offered_topic(topics.EPOCH)}, metadata={}) as bag:
        bag.write('/chatter', NS, time_message(NS))
    return path


def text_file(path):
    path.write_text('not a bag at all, however long this may be')
    return path


@pytest.mark.parametrize(
    ('make', 'message'),
    [
        (lambda path: path, 'does not exist'),
        (text_file, 'neither a video nor a bag'),
        (empty_bag, 'holds no messages'),
        (other_bag, r'(found '),
        (lambda path: raw_bag(path, at_30_hz(3), encoding='bayer_rggb16'), 'bayer_rggb16'),
    ],
    ids=['missing', 'no bag', 'empty', 'no camera', 'encoding'],
)
def test_input_that_cannot_be_used_is_exit_code_1_and_one_line(capsys, tmp_path, make, message):
    path = make(tmp_path / 'input')
    assert run('analyse', path, '--no-output') == 1
    line = error_of(capsys)
    assert str(path) in line
    assert message.lower() in line.lower()


def test_where_results_cannot_go_is_said_before_anything_is_analysed(capsys, tmp_path):
    thesis = tmp_path / 'thesis'
    thesis.mkdir()
    (thesis / 'chapter.txt').write_text('precious')
    for output, message in (
        (thesis, f'{thesis}: exists and holds no results of ours; pass another --output'),
        ('/proc/out', '/proc/out: cannot be written'),
    ):
        assert run('analyse', SAMPLE, '-o', output) == 1
        printed = capsys.readouterr()
        assert not printed.out
        assert message in printed.err
        assert '--output' in printed.err
    assert (thesis / 'chapter.txt').read_text() == 'precious'


def test_a_bag_without_the_camera_says_which_topics_it_has(capsys, tmp_path):
    assert run('analyse', other_bag(tmp_path / 'bag')) == 1
    line = error_of(capsys)
    assert '/chatter' in line
    assert '--image-topic' in line


def test_a_size_that_changes_keeps_what_came_before(capsys, tmp_path):
    def picture(number):
        return np.full((210, 210 if number < 40 else 230), 100 + number % 7, np.uint8)

    path = raw_bag(tmp_path / 'bag', at_30_hz(60), picture)
    assert run('analyse', path, '--json', '-o', tmp_path / 'out') == 1
    printed = capsys.readouterr()
    assert json.loads(printed.out)['frames'] == 40
    assert 'changed from 210x210 to 230x210 px' in printed.err.splitlines()[-1]
    assert (tmp_path / 'out' / 'tray_1_cluster.csv').is_file()


def test_a_bag_cut_short_is_analysed_up_to_the_cut(analysis, capsys, tmp_path):
    path = tmp_path / 'cut'
    shutil.copytree(SAMPLE, path)
    (storage,) = path.glob('*.mcap')
    content = storage.read_bytes()
    storage.write_bytes(content[: len(content) * 3 // 5])
    assert run('analyse', path, '--json', '--no-output') == 0
    printed = capsys.readouterr()
    results = json.loads(printed.out)
    assert 0.4 * analysis.frames < results['frames'] < 0.8 * analysis.frames
    assert not results['complete']
    assert any('is cut short' in line for line in printed.err.splitlines())


@pytest.mark.parametrize('key', ['import', 'salvage'])
def test_of_a_bag_whose_making_was_interrupted_it_is_said(capsys, tmp_path, key):
    path = raw_bag(tmp_path / 'bag', at_30_hz(60), metadata={key: 'unfinished'})
    assert run('analyse', path, '--json', '--no-output') == 0
    printed = capsys.readouterr()
    results = json.loads(printed.out)
    assert results['frames'] == 60
    assert not results['complete']
    assert 'holds only part of' in results['notices'][0]
    assert 'holds only part of' in printed.err


@pytest.mark.parametrize(
    ('flags', 'message'),
    [
        (('--trays', '9'), 'trays: 9 is outside [1, 8]'),
        (('--speed-interval', '-1'), 'speed.interval: -1 is outside'),
        (('--speed-interval', 'nan'), 'speed.interval'),
        (('--cooling-duration', '.nan'), 'cooling.duration: nan is not finite'),
        (('--speed-method', 'guess'), "'guess' is none of"),
        (('--parameters', '/no/such.yaml'), '/no/such.yaml: No such file'),
    ],
)
def test_a_wrong_call_is_exit_code_2_and_one_line(capsys, flags, message):
    assert run('analyse', SAMPLE, '--no-output', *flags) == 2
    assert message in error_of(capsys)


def test_the_truth_covers_the_recording_in_order_of_time(analysis):
    truth = analysis.trays[1].truth
    assert all(a.stamp_ns < b.stamp_ns for a, b in itertools.pairwise(truth))
    assert math.isclose(
        analysis.seconds, (truth[-1].stamp_ns - truth[0].stamp_ns) / NS, abs_tol=1e-3
    )


def test_one_picture_that_cannot_be_decoded_is_left_out_and_told(capsys, tmp_path):
    path = tmp_path / 'bag'
    name = topics.RAW_COMPRESSED.absolute()
    source = open_bag(SAMPLE)
    with BagWriter(path, {name: offered_topic(topics.RAW_COMPRESSED)}, metadata={}) as bag:
        for number, message in enumerate(source.messages([name])):
            if number == 90:
                break
            content = source.deserialize(message)
            if number == 40:
                content.data = content.data[:200]
            bag.write(name, message.log_time_ns, content)
    assert run('analyse', path, '--json', '--no-output') == 1
    printed = capsys.readouterr()
    assert json.loads(printed.out)['frames'] == 89
    assert '1 frames could not be used' in printed.err


def test_an_image_topic_that_holds_no_images_is_refused(capsys):
    assert run('analyse', SAMPLE, '--no-output', '--image-topic', '/nanorocks/tray_1/truth') == 1
    assert 'holds std_msgs/msg/Float32MultiArray, not images' in error_of(capsys)


def test_a_second_pass_says_what_one_alone_does(tmp_path):
    name = topics.RAW_COMPRESSED.absolute()
    source = open_bag(SAMPLE)
    shown, length = 9 * NS, 10 * NS
    settings = PipelineSettings(cooling=CoolingSettings(update_interval=3.0))

    def cycles(passes):
        path = tmp_path / f'{passes} passes'
        with BagWriter(path, {name: offered_topic(topics.RAW_COMPRESSED)}, metadata={}) as bag:
            for again in range(passes):
                for message in source.messages([name]):
                    if message.log_time_ns < source.start_ns + shown:
                        content = source.deserialize(message)
                        bag.write(name, message.log_time_ns + again * length, content)
        return as_json(analyse(path, settings))['trays']['1']['cycles']

    # Contacts of the last seconds count, though time goes back before they are known.
    (alone,) = cycles(1)
    assert cycles(2) == [alone, alone]


def test_nothing_but_our_own_results_is_ever_removed(analysis, tmp_path):
    beside = tmp_path / 'out.part'
    beside.mkdir()
    (beside / 'thesis.txt').write_text('precious')
    for _ in range(2):
        write_results(analysis, tmp_path / 'out', SAMPLE, PipelineSettings())
    assert (beside / 'thesis.txt').read_text() == 'precious'
    assert sorted(path.name for path in tmp_path.iterdir()) == ['out', 'out.part']


def test_results_are_written_though_nobody_reads_what_is_printed(tmp_path):
    path = raw_bag(tmp_path / 'bag', at_30_hz(40))
    code = 'from nanorocks_ros.cli.main import main; raise SystemExit(main())'
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run(
        [sys.executable, '-c', code, 'analyse', path, '--json', '-o', tmp_path / 'out'],
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writing)
    assert 'Traceback' not in ended.stderr
    assert open_bag(tmp_path / 'out' / BAG_NAME).complete


def test_a_result_that_cannot_be_written_is_printed_all_the_same(tmp_path, capsys, monkeypatch):
    path = raw_bag(tmp_path / 'bag', at_30_hz(40))

    def full(*_):
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr('nanorocks_ros.studies.analysis.results.results_folder._write_bag', full)
    assert run('analyse', path, '--json', '-o', tmp_path / 'out') == 1
    printed = capsys.readouterr()
    assert json.loads(printed.out)['frames'] == 40
    assert 'cannot be written: No space left on device' in printed.err.splitlines()[-1]
    assert not (tmp_path / 'out').exists()


def test_a_bag_without_a_name_has_its_results_beside_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(raw_bag(tmp_path / 'bag', at_30_hz(40)))
    assert run('analyse', '.') == 0
    assert (tmp_path / 'bag_results' / BAG_NAME).is_dir()
    assert f'results in {tmp_path}/bag_results' in capsys.readouterr().err


@pytest.mark.parametrize('place', [0, 20, 39])
def test_one_far_future_stamp_costs_its_frame_alone(tmp_path, place):
    start = 1_000_000_000 * NS
    stamps = [start + number * NS // 30 for number in range(40)]
    clean = analyse(raw_bag(tmp_path / 'clean', stamps), PipelineSettings(trays=(1,)))
    changed = [*stamps]
    # The log times follow the first stamp, and have to stay below the end of ROS times.
    changed[place] = (2**31 - 100) * NS
    bag = raw_bag(tmp_path / 'bag', changed)
    result = analyse(bag, PipelineSettings(trays=(1,)))
    assert not result.complete
    assert result.refused == 1
    assert result.frames == clean.frames - 1
    assert result.frames_lost <= 1
    assert result.seconds < 2.0
