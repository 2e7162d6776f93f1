"""Records and arrays: one layout, read from the message definitions."""

from __future__ import annotations

import dataclasses
import math
import re
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from nanorocks_ros.errors import FrameError
from nanorocks_ros.records import (
    UNKNOWN_MEASURED,
    BodyEstimate,
    ClusterEstimate,
    CorEstimate,
    CorRelation,
    CorStatus,
    GroundTruth,
    Headline,
    Interval,
    Measured,
    MeasuredInterval,
    Merge,
    PairCollision,
    Quality,
    Rebound,
    SizeStatus,
    SpeedEstimate,
    SpeedMethod,
    StickingStatus,
    TrayState,
)
from nanorocks_ros.wire.array_layouts import enumerated, from_array, layout, to_array
from nanorocks_ros.wire.products import PRODUCTS

DEFINITIONS = Path(__file__).parents[2] / 'msg_defs' / 'nanorocks_msgs' / 'msg'
EPOCH = 1_700_000_000_000_000_000

# Elements that are part of an array in the record.
WHOLE = {
    **{
        f'{name}_{axis}': name
        for name in ('place', 'separation', 'mean_velocity', 'mean_acceleration')
        for axis in 'xy'
    },
    **{
        f'{name}_{k}_drag_time': f'{name}_drag_times' for name in ('before', 'after') for k in '12'
    },
    **{f'{name}_{k}_{axis}': name for name in ('before', 'after') for k in '12' for axis in 'xy'},
    **{
        f'{name}_{k}_error': f'{name}_errors'
        for name in ('before', 'after', 'radius')
        for k in '12'
    },
    **{f'track_{k}': 'tracks' for k in '12'},
    **{f'species_{k}': 'species' for k in '12'},
    **{f'radius_{k}': 'radii' for k in '12'},
    **{f'mass_{k}': 'masses' for k in '12'},
    **{f'temperature_{k}': 'temperatures' for k in '12'},
    **{f'bodies_of_{size}': 'sizes' for size in ('1', '2', '3', '4_to_6', '7_or_more')},
}


def part_of(element, fields):
    """The field that an element is a part of: of an array, a value, or a tuple of species."""
    base = re.sub('_(error|lower|upper)$', '', element)
    if element in WHOLE or base in fields:
        return WHOLE.get(element, base)
    return re.sub('^(first|second)_species_(.*)', r'species_\2s', base)


def numbers(value):
    """The numbers of a value, or of those in a tuple."""
    values = value if isinstance(value, tuple) else (value,)
    return [dataclasses.astuple(measured) for measured in values]


RECORDS = (
    SpeedEstimate(
        stamp_ns=EPOCH + 2_500_000_000,
        tray=3,
        cycle=2,
        cycle_start_ns=EPOCH + 1_000_000_000,
        mean_projected_speed=Measured(4.5e-3, 1e-4),
        window=0.2,
        method=SpeedMethod.BINARISED_AREA,
        quality=Quality.GLARE | Quality.FEW_BEADS,
        species_speeds=(Measured(4e-3),),
    ),
    TrayState(
        stamp_ns=EPOCH + 10**9,
        tray=2,
        cycle=1,
        cycle_start_ns=None,
        noise_power=8.0,
        displacement_x=1e-4,
        displacement_y=-2e-5,
        displacement_error=1e-6,
        velocity_x=math.nan,
        velocity_y=math.nan,
        velocity_error=math.nan,
        quality=Quality.SATURATED,
        glare=0.1,
        color=1,
    ),
    Rebound(
        stamp_ns=EPOCH + 3 * 10**9,
        tray=1,
        cycle=2,
        track=7,
        species=1,
        wall=3,
        incoming=Measured(4e-3, 1e-4),
        outgoing=Measured(3.8e-3, 1.1e-4),
        tangential_incoming=-1e-3,
        tangential_outgoing=-1.1e-3,
        tangential_error=1e-4,
        wall_velocity=Measured(2e-4, 1e-5),
        place=np.array([1e-3, 2e-3]),
    ),
    PairCollision(
        stamp_ns=EPOCH + 4 * 10**9,
        tray=3,
        cycle=1,
        tracks=np.array([3, 9], dtype=np.int32),
        species=np.array([0, 1], dtype=np.int32),
        radii=np.array([1e-3, 1.1e-3]),
        radius_errors=np.array([0.0, 1e-5]),
        masses=np.array([5e-6, 1e-5]),
        before=np.array([[1e-3, 2e-3], [-3e-3, 4e-3]]),
        after=np.array([[-5e-3, 6e-3], [7e-3, -8e-3]]),
        before_errors=np.array([1e-5, 2e-5]),
        after_errors=np.array([3e-5, 4e-5]),
        separation=np.array([1.5e-3, 1.6e-3]),
        separation_error=1e-5,
        temperatures=np.array([9e-6, 8e-6]),
        height=3e-3,
        place=np.array([4e-3, 5e-3]),
    ),
    BodyEstimate(
        stamp_ns=EPOCH + 5 * 10**9,
        tray=1,
        cycle=2,
        beads=15,
        followed=14,
        bodies=Measured(11.5, 0.3),
        mean_size=Measured(1.3, 0.03),
        weighted_size=Measured(1.9, 0.1),
        clustered_share=Measured(0.4, 0.05),
        clusters=Measured(2.0, 0.2),
        sizes=np.array([9.0, 1.0, 0.0, 1.0, 0.5]),
        first_merge_ns=EPOCH + 2 * 10**9,
    ),
    Merge(
        stamp_ns=EPOCH + 2 * 10**9,
        known_ns=EPOCH + 3 * 10**9,
        tray=1,
        cycle=2,
        tracks=np.array([3, 11], dtype=np.int32),
        joins=True,
    ),
    ClusterEstimate(stamp_ns=EPOCH + 1, tray=1, cycle=0, level_area=2e-6, correlation_length=8e-4),
    ClusterEstimate(
        stamp_ns=EPOCH + 1,
        tray=3,
        cycle=2,
        level_area=2e-6,
        correlation_length=8e-4,
        axes_ratio=1.25,
        direction=-0.5,
        breadth=2.75,
        cluster_size=MeasuredInterval(3.5, 0.75, 2.5, 4.5),
        size_status=SizeStatus.MEASURED,
    ),
    CorEstimate(
        stamp_ns=EPOCH,
        tray=1,
        cycle=1,
        status=CorStatus.FINAL,
        relation=CorRelation.PAPER,
        restitution=Interval(0.9, 0.85, 0.95),
        species_haff_times=(UNKNOWN_MEASURED, Measured(2.5, 0.25)),
        samples=120,
    ),
    GroundTruth(
        stamp_ns=EPOCH + 10**9,
        tray=8,
        cycle=1,
        mean_projected_speed=1e-3,
        mean_speed=1.2e-3,
        bodies=15,
        restitution=0.89,
        wall_restitution=0.99,
        sticking_speed=0.0,
    ),
)

# And one of every kind in the register.
RECORDS += tuple(
    from_array(
        product.record,
        np.ones(len(layout(product.record).elements)),
        tray=1,
        epoch_ns=EPOCH,
        where='test',
    )
    for product in PRODUCTS
)


@pytest.mark.parametrize('record', RECORDS, ids=lambda record: type(record).__name__)
def test_a_record_comes_back_from_its_array_to_float32_rounding(record):
    values = to_array(record, EPOCH)
    assert values.dtype == np.float32
    back = from_array(type(record), values, tray=record.tray, epoch_ns=EPOCH, where='test')
    for field in dataclasses.fields(record):
        before, after = getattr(record, field.name), getattr(back, field.name)
        assert type(after) is type(before)
        if isinstance(before, Interval | Measured | MeasuredInterval | tuple):
            np.testing.assert_allclose(numbers(after), numbers(before), rtol=2**-23)
        elif isinstance(before, np.ndarray):
            assert after.dtype == before.dtype
            np.testing.assert_allclose(after, before, rtol=2**-23)
        elif isinstance(before, float):
            assert after == pytest.approx(before, rel=2**-23, nan_ok=True)
        elif isinstance(before, Enum):
            assert after == before
        else:
            assert after == pytest.approx(before, abs=2)


@pytest.mark.parametrize('days', [0, 1, 7, 365])
def test_a_time_is_exact_however_long_ago_the_epoch(days):
    stamp_ns = EPOCH + days * 86_400 * 10**9 + 123_456_789
    speed = dataclasses.replace(RECORDS[0], stamp_ns=stamp_ns, cycle_start_ns=stamp_ns - 10**9)
    values = to_array(speed, EPOCH)
    back = from_array(SpeedEstimate, values, tray=3, epoch_ns=EPOCH, where='test')
    assert abs(back.stamp_ns - stamp_ns) < 1000
    assert abs(back.cycle_start_ns - speed.cycle_start_ns) < 1000
    elements = dict(zip(layout(SpeedEstimate).labels, values.tolist(), strict=True))
    in_array = elements['time'] + elements['time_remainder']
    assert in_array == pytest.approx((stamp_ns - EPOCH) / 1e9, abs=1e-6)


@pytest.mark.parametrize('record', RECORDS, ids=lambda record: type(record).__name__)
def test_the_layout_is_the_message_definition_as_an_independent_parser_reads_it(record):
    name = type(record).__name__
    text = (DEFINITIONS / f'{name}.msg').read_text()
    parsed = get_types_from_msg(text, f'nanorocks_msgs/msg/{name}')
    constants, fields = parsed[f'nanorocks_msgs/msg/{name}']
    array = layout(type(record))
    kinds = {field: kind[1][0] for field, kind in fields if kind[0] == Nodetype.BASE}
    numbers = {field: kind for field, kind in kinds.items() if kind != 'string'}
    assert {field.name: field.number for field in array.fields} == numbers
    assert [field.name for field in array.fields] == list(numbers)
    exact = [field for field, kind in numbers.items() if kind == 'float64']
    assert array.labels == [*numbers, *(f'{field}_remainder' for field in exact)]
    assert array.label == ','.join(array.labels)
    assert array.constants == {key: int(value) for key, _, value in constants}
    assert all(field.unit and field.doc for field in array.elements)


@pytest.mark.parametrize('record', RECORDS, ids=lambda record: type(record).__name__)
def test_typed_messages_have_a_header_and_a_word_for_every_code(record):
    name = type(record).__name__
    text = (DEFINITIONS / f'{name}.msg').read_text()
    _, fields = get_types_from_msg(text, f'nanorocks_msgs/msg/{name}')[
        f'nanorocks_msgs/msg/{name}'
    ]
    assert fields[0] == ('header', (Nodetype.NAME, 'std_msgs/msg/Header'))
    beside = {field for field, _ in fields[1:]} - {
        field.name for field in layout(type(record)).fields
    }
    assert beside == set(enumerated(record))


def test_codes_have_their_words():
    assert enumerated(RECORDS[0]) == {
        'method_name': 'binarised_area',
        'quality_names': ['few_beads', 'glare'],
    }


@pytest.mark.parametrize('record', RECORDS, ids=lambda record: type(record).__name__)
def test_every_array_starts_with_time_and_cycle_and_holds_the_whole_record(record):
    names = [field.name for field in layout(type(record)).fields]
    assert names[:2] == ['time', 'cycle']
    expected = {field.name for field in dataclasses.fields(record)} - {'tray'}
    renamed = {
        'stamp_ns': 'time',
        'cycle_start_ns': 'cycle_start',
        'known_ns': 'known',
        'first_merge_ns': 'first_merge',
    }
    parts = [
        name if name in expected or name in renamed.values() else part_of(name, expected)
        for name in names
    ]
    assert set(parts) == {renamed.get(name, name) for name in expected}
    shapes = {
        name: np.size(value)
        for name in expected
        if isinstance(value := getattr(record, name), np.ndarray)
    }
    assert {name: parts.count(name) for name in shapes} == shapes


@pytest.mark.parametrize(
    ('record_type', 'enumerations'),
    [(SpeedEstimate, (SpeedMethod,)), (CorEstimate, (CorStatus, CorRelation))],
)
def test_the_constants_are_those_of_the_code(record_type, enumerations):
    expected = {member.name: member.value for kind in enumerations for member in kind}
    if record_type is CorEstimate:
        expected |= {f'HEADLINE_{member.name}': member.value for member in Headline}
    assert layout(record_type).constants == expected


def test_the_constants_of_clusters_are_those_of_the_code():
    expected = {member.name: member.value for member in SizeStatus}
    expected |= {f'STICKING_{member.name}': member.value for member in StickingStatus}
    assert layout(ClusterEstimate).constants == expected


def test_not_known_is_nan_and_never_zero():
    values = to_array(next(record for record in RECORDS if isinstance(record, CorEstimate)), EPOCH)
    names = [field.name for field in layout(CorEstimate).fields]
    assert math.isnan(values[names.index('haff_time')])
    before_the_first = dataclasses.replace(RECORDS[0], cycle_start_ns=None)
    assert math.isnan(to_array(before_the_first, EPOCH)[2])


def test_an_array_of_an_earlier_version_has_no_remainders():
    count = len(layout(SpeedEstimate).fields)
    values = to_array(RECORDS[0], EPOCH)[:count]
    back = from_array(SpeedEstimate, values, tray=3, epoch_ns=EPOCH, where='test')
    assert abs(back.stamp_ns - RECORDS[0].stamp_ns) < 1000


def test_an_array_of_another_release_is_refused():
    with pytest.raises(
        FrameError, match=r'/speed: 3 elements where SpeedEstimate has 15; use the'
    ):
        from_array(SpeedEstimate, [1.0, 2.0, 3.0], tray=1, epoch_ns=0, where='/speed')


def test_an_array_without_a_time_is_refused():
    values = to_array(RECORDS[0], EPOCH)
    values[0] = math.nan
    with pytest.raises(FrameError, match='time is nan'):
        from_array(SpeedEstimate, values, tray=1, epoch_ns=EPOCH, where='/speed')


@pytest.mark.parametrize(
    ('element', 'value'), [(1, math.nan), (1, math.inf), (6, 9.0), (6, math.nan)]
)
def test_an_element_that_means_nothing_is_refused(element, value):
    values = to_array(RECORDS[0], EPOCH)
    values[element] = value
    name = layout(SpeedEstimate).fields[element].name
    with pytest.raises(FrameError, match=f'/speed: {name} is '):
        from_array(SpeedEstimate, values, tray=1, epoch_ns=EPOCH, where='/speed')
