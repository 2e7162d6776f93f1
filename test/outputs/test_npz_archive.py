"""NPZ archives: what is written is read back, and damaged files are refused."""

from __future__ import annotations

import io
import zipfile

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


def claiming(path, shape, dtype='<f8', content=b'', compression=zipfile.ZIP_STORED):
    """An archive with one array whose header claims a shape; its checksums are right."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {'descr': dtype, 'fortran_order': False, 'shape': shape}
    )
    with zipfile.ZipFile(path, 'w', compression) as archive:
        archive.writestr('a.npy', header.getvalue() + content)
    return path


@pytest.mark.parametrize('shape', [(1 << 40,), (1 << 20, 1 << 20), (3, 1 << 61)])
def test_a_shape_that_the_file_does_not_hold_is_refused_before_memory_is_taken(tmp_path, shape):
    path = claiming(tmp_path / 'x.npz', shape, content=bytes(80))
    with pytest.raises(RecordingError, match=r'is damaged, or no \.npz file of arrays'):
        read_archive(path)


def test_arrays_above_the_limit_are_refused_with_the_setting(tmp_path, monkeypatch):
    monkeypatch.setenv('NANOROCKS_MAX_ARRAY_BYTES', '100000')
    path = claiming(
        tmp_path / 'x.npz', (100_000,), content=bytes(800_000), compression=zipfile.ZIP_DEFLATED
    )
    assert path.stat().st_size < 2000
    with pytest.raises(RecordingError, match='NANOROCKS_MAX_ARRAY_BYTES'):
        read_archive(path)
    monkeypatch.setenv('NANOROCKS_MAX_ARRAY_BYTES', '1000000')
    assert read_archive(path)['a'].shape == (100_000,)
