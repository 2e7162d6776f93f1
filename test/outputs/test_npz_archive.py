"""NPZ archives: what is written is read back, and damaged files are refused."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError, SimulationError
from nanorocks_ros.outputs.npz_archive import read_archive, write_archive


def test_arrays_are_read_back_whatever_the_suffix_of_the_file(tmp_path):
    path = tmp_path / 'state'
    write_archive(path, {'a': np.arange(3.0), 'b': np.array('text')})
    arrays = read_archive(path)
    np.testing.assert_array_equal(arrays['a'], np.arange(3.0))
    assert str(arrays['b']) == 'text'
    assert [file.name for file in tmp_path.iterdir()] == ['state']


def test_an_error_has_the_type_that_the_caller_names(tmp_path):
    path = tmp_path / 'nowhere' / 'a.npz'
    with pytest.raises(RecordingError, match=r'a\.npz: cannot be written \(No such file'):
        write_archive(path, {})
    with pytest.raises(SimulationError, match=r'a\.npz: cannot be written \(No such file'):
        write_archive(path, {}, SimulationError)


@pytest.mark.parametrize('bits', [0xFF, 0x01, 0x08])
def test_a_damaged_byte_is_found_wherever_it_is(tmp_path, bits):
    path = tmp_path / 'a.npz'
    write_archive(path, {'a': np.arange(3.0), 'b': np.array('text')})
    content = path.read_bytes()
    refused = 0
    for k in range(len(content)):
        path.write_bytes(content[:k] + bytes([content[k] ^ bits]) + content[k + 1 :])
        try:
            arrays_read = read_archive(path)
        except RecordingError as error:
            assert 'is damaged' in error.what  # noqa: PT017
            refused += 1
            continue
        # A byte that holds nothing, such as the date, or one of a name.
        if set(arrays_read) == {'a', 'b'}:
            assert arrays_read['a'].tolist() == [0.0, 1.0, 2.0]
            assert str(arrays_read['b']) == 'text'
    assert refused > len(content) // 2
