"""Lists on the disk: what is appended is read back, in any way a list is read."""

from __future__ import annotations

import resource

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.outputs.disk_list import Spool, SpoolError, SpoolFile
from nanorocks_ros.records import Merge


def merge(number):
    tracks = np.array([number, number + 1], np.int32)
    return Merge(stamp_ns=number, known_ns=9, tray=1, cycle=2, tracks=tracks, joins=True)


def test_two_spools_of_a_file_keep_their_records_apart(tmp_path):
    file = SpoolFile(tmp_path)
    first, second = Spool(file), Spool(file)
    for number in range(600):
        first.append(merge(number))
        second.append(-number)
    assert [record.stamp_ns for record in first] == list(range(600))
    assert first[299].tracks.tolist() == [299, 300]
    assert list(second) == [-number for number in range(600)]
    # Nothing is left behind.
    assert not list(tmp_path.iterdir())


@given(length=st.integers(0, 700), first=st.integers(-800, 800), last=st.integers(-800, 800))
def test_it_is_read_as_a_list_is(tmp_path_factory, length, first, last):
    spool, expected = Spool(SpoolFile(tmp_path_factory.getbasetemp())), list(range(length))
    for number in expected:
        spool.append(number)
    assert len(spool) == length
    assert bool(spool) == bool(expected)
    assert spool[first:last:97] == expected[first:last:97]
    if -length <= first < length:
        assert spool[first] == expected[first]
    else:
        with pytest.raises(IndexError):
            spool[first]


def test_a_full_disk_is_told_at_once(tmp_path):
    spool = Spool(SpoolFile(tmp_path))
    for number in range(255):
        spool.append(float(number))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(SpoolError, match=r'cannot be written \(File too large\); make room'):
            spool.append(255.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
