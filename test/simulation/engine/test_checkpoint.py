"""A checkpoint continues bit by bit; damaged and foreign files are refused."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
from gases import ALL_RULES, BOX, KERNELS, RULES, mixture

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import Kernel
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

HALF, END = 7.3, 20.0
TIMES = np.linspace(HALF, END, 12)


def gas_for(name, kernel=Kernel.SCAN, n=20):
    box = tuple(1.4 * side for side in BOX)
    rules = CollisionRules(box=box, **ALL_RULES[name])
    return HardSphereGas(mixture(8, n, rules), rules, kernel)


def remaining_record(gas):
    return gas.follow(END, TIMES, TIMES, log=True)


def assert_identical(first, second):
    """Assert that two run records agree bit by bit."""
    for field in ('times', 'positions', 'velocities', 'spins', 'bodies', 'events'):
        a, b = getattr(first, field), getattr(second, field)
        assert (a is None) == (b is None), field
        if a is not None:
            np.testing.assert_array_equal(a, b)
    for field in type(first.observations).__slots__:
        np.testing.assert_array_equal(
            getattr(first.observations, field), getattr(second.observations, field)
        )


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', ALL_RULES)
def test_a_loaded_gas_continues_bit_by_bit(tmp_path, name, kernel):
    path = tmp_path / 'gas.npz'
    straight = gas_for(name, kernel)
    straight.run_until(HALF)
    straight.save(path)
    expected = remaining_record(straight)
    loaded = HardSphereGas.load(path)
    assert loaded.now == HALF
    assert loaded.kernel == kernel
    assert_identical(remaining_record(loaded), expected)
    assert len(expected.events) > 30
    assert loaded.counts == straight.counts
    for field in ('ledger', 'bodies', 'stuck', 'radii', 'masses'):
        np.testing.assert_array_equal(getattr(loaded, field), getattr(straight, field))


@pytest.mark.parametrize('kernel', KERNELS)
def test_saving_changes_nothing(tmp_path, kernel):
    saved, unsaved = gas_for('rough and sticking', kernel), gas_for('rough and sticking', kernel)
    for gas in (saved, unsaved):
        gas.run_until(HALF)
    saved.save(tmp_path / 'gas')
    assert_identical(remaining_record(saved), remaining_record(unsaved))


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_gas_can_be_saved_before_its_first_event_and_again_and_again(tmp_path, kernel):
    expected = gas_for('random', kernel)
    gas = gas_for('random', kernel)
    for end in (0.0, 0.1, 3.0, HALF):
        path = tmp_path / f'after {end}'
        gas.run_until(end)
        gas.save(path)
        gas = HardSphereGas.load(path)
    expected.run_until(HALF)
    assert_identical(remaining_record(gas), remaining_record(expected))


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_gas_stopped_in_the_middle_of_its_events_can_be_saved(tmp_path, kernel):
    straight, stopped = gas_for('sticking', kernel), gas_for('sticking', kernel)
    with pytest.raises(SimulationError, match='events taken'):
        stopped.follow(HALF, most_events=50)
    stopped.save(tmp_path / 'gas')
    loaded = HardSphereGas.load(tmp_path / 'gas')
    for gas in (straight, loaded):
        gas.run_until(HALF)
    assert_identical(remaining_record(loaded), remaining_record(straight))


def test_a_loaded_gas_can_be_kicked_and_seen_by_species(tmp_path):
    gas = gas_for('species')
    gas.run_until(HALF)
    gas.save(tmp_path / 'gas')
    loaded = HardSphereGas.load(tmp_path / 'gas')
    velocities = np.random.default_rng(1).normal(size=(20, 3))
    records = []
    for copy in (gas, loaded):
        copy.kick(velocities)
        records.append(remaining_record(copy))
    assert_identical(*records)
    np.testing.assert_array_equal(loaded.beads().species, mixture(8, 20, SPECIES).species)


SPECIES = CollisionRules(box=tuple(1.4 * side for side in BOX), **RULES['species'])


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / 'gas.npz'
    gas = gas_for('rough and sticking', n=3)
    gas.run_until(1.0)
    gas.save(path)
    return path


def test_a_checkpoint_is_replaced_atomically(saved):
    gas = gas_for('elastic', n=4)
    gas.save(saved)
    assert HardSphereGas.load(saved).radii.size == 4
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_an_unwritable_path_is_named(tmp_path):
    gas = gas_for('elastic', n=3)
    for path in (tmp_path / 'no folder' / 'gas', tmp_path):
        with pytest.raises(SimulationError) as error:
            gas.save(path)
        assert str(path) in str(error.value)
        assert 'write elsewhere' in str(error.value)
    assert list(tmp_path.iterdir()) == []


def refused(path):
    with pytest.raises(SimulationError) as error:
        HardSphereGas.load(path)
    assert str(path) in str(error.value)
    return str(error.value)


def test_a_missing_file_is_named(tmp_path):
    assert 'No such file' in refused(tmp_path / 'nothing')
    refused(tmp_path)


def test_a_file_cut_short_anywhere_is_refused(saved):
    content = saved.read_bytes()
    for length in range(0, len(content), max(1, len(content) // 60)):
        saved.write_bytes(content[:length])
        refused(saved)


def loaded_or_refused(path):
    """None when the file is refused, and named."""
    try:
        return HardSphereGas.load(path)
    except SimulationError as error:
        return None if str(path) in str(error) else error


def test_a_file_with_one_changed_bit_is_refused_or_the_same_gas(saved):
    """Some bits of a zip archive are of no consequence: dates, versions."""
    content = saved.read_bytes()
    expected = HardSphereGas.load(saved)
    random = np.random.default_rng(1)
    refusals = 0
    for place in random.choice(len(content), 150, replace=False):
        changed = bytearray(content)
        changed[place] ^= 1 << random.integers(8)
        saved.write_bytes(changed)
        loaded_gas = loaded_or_refused(saved)
        if loaded_gas is None:
            refusals += 1
        else:
            for a, b in zip(loaded_gas._state, expected._state, strict=True):
                np.testing.assert_array_equal(a, b)
    assert refusals > 75


@pytest.mark.parametrize(('place', 'value'), [(8, 1), (10, 8), (10, 12), (10, 14), (10, 99)])
def test_an_archive_said_to_be_encrypted_or_packed_otherwise_is_refused(saved, place, value):
    """In the directory of the archive: flags, and deflate, bzip2, LZMA, and a method unknown."""
    changed = bytearray(saved.read_bytes())
    changed[changed.index(b'PK\x01\x02') + place] = value
    saved.write_bytes(changed)
    refused(saved)


def foreign(kind):
    """What else somebody may name."""
    buffer = io.BytesIO()
    if kind == 'other arrays':
        np.savez(buffer, positions=np.zeros((3, 3)))
    elif kind == 'one array':
        np.save(buffer, np.zeros((3, 3)))
    elif kind == 'pickled array':
        np.save(buffer, np.array([{}], dtype=object), allow_pickle=True)
    elif kind == 'text':
        buffer.write(b'time,x,y,z\n0,1,2,3\n')
    elif kind == 'other archive':
        with zipfile.ZipFile(buffer, 'w') as archive:
            archive.writestr('readme.txt', 'nothing of a gas')
    return buffer.getvalue()


@pytest.mark.parametrize(
    'kind', ['other arrays', 'one array', 'pickled array', 'text', 'other archive', 'nothing']
)
def test_a_foreign_file_is_refused(tmp_path, kind):
    path = tmp_path / 'other'
    path.write_bytes(foreign(kind))
    refused(path)


def test_a_gas_of_another_release_is_refused(saved):
    with np.load(saved) as file:
        arrays = dict(file)
    arrays['form'] = np.asarray([99, 1])
    from nanorocks_ros.simulation.engine import checkpoint as module

    digest = arrays.pop(module._DIGEST)
    assert digest.size == 32
    np.savez(saved.open('wb'), **arrays, **{module._DIGEST: module._digest(arrays)})
    assert 'another release' in refused(saved)
