"""The sample bag gives the numbers of the reference, and the golden check sees a change of one."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from benchmarks import golden, golden_columns, golden_reference

# The reference was written on one processor. OpenCV, BLAS and NumPy without AVX2 and FMA move the
# mean, minimum and maximum of 35 of the 364 columns, by at most 1e-3 of the largest value;
# `make golden` on the processor of the reference finds all of them bit-identical.
TOLERANCE = '0.01'
SPEED = 'results/tray_1_speed.csv'


@pytest.fixture(scope='module')
def outputs(tmp_path_factory):
    """What the commands make of the sample bag, compared with the reference on the way."""
    folder = tmp_path_factory.mktemp('golden') / 'kept'
    assert golden.main(['--only', 'sample', '--keep', str(folder), '--tolerance', TOLERANCE]) == 0
    return folder


@pytest.fixture
def changed(outputs, tmp_path):
    """A copy of the outputs with one speed 5 % larger."""
    copy = tmp_path / 'changed'
    shutil.copytree(outputs, copy)
    path = copy / 'sample' / SPEED
    lines = path.read_text(encoding='utf-8').splitlines()
    column = lines[0].split(',').index('mean_projected_speed')
    speeds = [float(line.split(',')[column]) for line in lines[1:]]
    row = int(np.argmax(speeds))
    cells = lines[1 + row].split(',')
    cells[column] = repr(speeds[row] * 1.05)
    lines[1 + row] = ','.join(cells)
    path.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return copy, row


def check(folder, *options):
    return golden.main(['--only', 'sample', '--keep', str(folder), '--no-run', *options])


def test_the_sample_bag_gives_the_numbers_of_the_reference(outputs, capsys):
    assert check(outputs, '--tolerance', TOLERANCE) == 0
    assert 'columns are bit-identical' in capsys.readouterr().out


def test_a_changed_number_is_located(changed, capsys):
    folder, _ = changed
    assert check(folder, '--tolerance', TOLERANCE) == golden.EXIT_DIFFERENT
    (row,) = [line for line in capsys.readouterr().out.splitlines() if SPEED in line]
    assert 'mean_projected_speed' in row
    assert 'relative 0.05' in row


def test_kept_outputs_are_compared_number_by_number(outputs, changed, capsys):
    folder, row = changed
    assert check(outputs, '--against', str(outputs)) == 0
    assert check(folder, '--against', str(outputs)) == golden.EXIT_DIFFERENT
    table = capsys.readouterr().out
    assert f'in row {row}, relative 0.05' in table
    assert 'golden: 1 of' in table


def test_a_lost_row_and_a_lost_file_are_differences(outputs, tmp_path, capsys):
    copy = tmp_path / 'copy'
    shutil.copytree(outputs, copy)
    path = copy / 'sample' / SPEED
    lines = path.read_text(encoding='utf-8').splitlines()
    path.write_text('\n'.join(lines[:-1]) + '\n', encoding='utf-8')
    (copy / 'sample/results/tray_1_cor.csv').unlink()
    assert check(copy, '--tolerance', '1') == golden.EXIT_DIFFERENT
    table = capsys.readouterr().out
    assert f'{len(lines) - 1} -> {len(lines) - 2}' in table
    assert 'gone' in table


def test_the_reference_is_read_as_it_was_written(outputs, tmp_path, monkeypatch):
    summaries = {
        'sample': {
            file: {name: golden_columns.summarise(column) for name, column in columns.items()}
            for file, columns in golden_columns.read_outputs(outputs / 'sample').items()
        }
    }
    monkeypatch.setattr(golden_reference, 'REFERENCE', tmp_path / 'golden.json')
    golden_reference.write_reference(summaries)
    assert golden_reference.read_reference() == summaries


def test_a_folder_of_somebody_else_is_left_alone(tmp_path, capsys):
    (tmp_path / 'sample').mkdir()
    (tmp_path / 'sample' / 'thesis.tex').touch()
    assert golden.main(['--only', 'sample', '--keep', str(tmp_path)]) == golden.EXIT_CALL
    assert 'name another folder' in capsys.readouterr().err
    assert (tmp_path / 'sample' / 'thesis.tex').exists()
