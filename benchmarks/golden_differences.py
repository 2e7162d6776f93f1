"""Differences between two sets of results of the golden check, and their table."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.golden_columns import digest_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from benchmarks.golden_columns import Column, Summary

_HEADER = ('case', 'file', 'column', 'rows', 'difference')
_STATISTICS = ('mean', 'min', 'max')


@dataclass(slots=True)
class Comparison:
    """What a comparison gave.

    Parameters
    ----------
    columns : int
        Columns on either side.
    accepted : int
        Columns that differ, but no more than the tolerance.
    differences : list of tuple
        Case, file, column, rows before and after, size of the difference.
    """

    columns: int = 0
    accepted: int = 0
    differences: list[tuple[str, ...]] = field(default_factory=list)

    def table(self) -> str:
        """The differences as a table in Markdown, and a line that sums up."""
        lines = [_HEADER, *self.differences]
        widths = [max(len(line[index]) for line in lines) for index in range(len(_HEADER))]
        lines.insert(1, tuple('-' * width for width in widths))
        padded = (
            [cell.ljust(width) for cell, width in zip(line, widths, strict=True)] for line in lines
        )
        rows = [f'| {" | ".join(cells)} |' for cells in padded]
        total = f'golden: {len(self.differences)} of {self.columns} columns differ'
        return '\n'.join((*rows, total))


def compare_summaries(
    before: Mapping[str, Any], after: Mapping[str, Any], tolerance: float
) -> Comparison:
    """Compare the summaries of columns: case -> file -> column -> summary.

    Parameters
    ----------
    before, after : dict
    tolerance : float
        Relative difference of mean, min and max up to which columns of as many rows are accepted;
        0: none.
    """
    comparison = Comparison()
    for key, old, new in _pairs(before, after):
        comparison.columns += 1
        if old is not None and new is not None and old == new:
            continue
        rows = _rows(old and old['rows'], new and new['rows'])
        size = math.nan if old is None or new is None else _relative_difference(old, new)
        if size <= tolerance > 0:
            comparison.accepted += 1
        else:
            comparison.differences.append((*key, rows, _summary_difference(old, new, size)))
    return comparison


def compare_outputs(before: Mapping[str, Any], after: Mapping[str, Any]) -> Comparison:
    """Compare columns number by number: case -> file -> column -> values."""
    comparison = Comparison()
    for key, old, new in _pairs(before, after):
        comparison.columns += 1
        if old is not None and new is not None and digest_of(old) == digest_of(new):
            continue
        counts = (None if column is None else len(column) for column in (old, new))
        comparison.differences.append((*key, _rows(*counts), _value_difference(old, new)))
    return comparison


def _pairs(
    before: Mapping[str, Any], after: Mapping[str, Any]
) -> Iterator[tuple[tuple[str, str, str], Any, Any]]:
    """Case, file and column of either side, with what each side has; None: nothing."""
    for case in before | after:
        old_files, new_files = before.get(case, {}), after.get(case, {})
        for file in old_files | new_files:
            old_columns, new_columns = old_files.get(file, {}), new_files.get(file, {})
            for name in old_columns | new_columns:
                yield (case, file, name), old_columns.get(name), new_columns.get(name)


def _rows(before: int | None, after: int | None) -> str:
    old, new = ('-' if count is None else str(count) for count in (before, after))
    return old if old == new else f'{old} -> {new}'


def _relative_difference(old: Summary, new: Summary) -> float:
    """Largest difference of the statistics, by the largest magnitude of the old column.

    NaN where they cannot be compared: other rows, other words, other numbers of NaN.
    """
    if any(old.get(name) != new.get(name) for name in ('rows', 'nan', 'words')):
        return math.nan
    if not old.keys() == new.keys() >= set(_STATISTICS):
        return math.nan
    scale = max(abs(old['min']), abs(old['max']))
    largest = max(abs(new[name] - old[name]) for name in _STATISTICS)
    if largest == 0:
        return 0.0
    return largest / scale if scale else math.inf


def _summary_difference(old: Summary | None, new: Summary | None, size: float) -> str:
    if old is None or new is None:
        return 'new' if old is None else 'gone'
    if not math.isnan(size):
        return f'relative {size:.2g}'
    names = ('nan', *_STATISTICS, 'words')
    parts = [
        f'{name} {old.get(name, "none")} -> {new.get(name, "none")}'
        for name in names
        if old.get(name) != new.get(name)
    ]
    return ', '.join(parts) or 'digest'


def _value_difference(old: Column | None, new: Column | None) -> str:
    """How many values differ, and by how much at most; over the rows that both have."""
    if old is None or new is None:
        return 'new' if old is None else 'gone'
    rows = min(len(old), len(new))
    if isinstance(old, list) or isinstance(new, list):
        pairs = enumerate(zip(map(str, old), map(str, new), strict=False))
        different = [(row, *pair) for row, pair in pairs if pair[0] != pair[1]]
        if not different:
            return 'only the number of rows'
        row, first, second = different[0]
        return f'{len(different)} words, first in row {row}: {first} -> {second}'
    first_values, second_values = old[:rows].astype(float), new[:rows].astype(float)
    same = (first_values == second_values) | (np.isnan(first_values) & np.isnan(second_values))
    if same.all():
        return (
            'only the number of rows'
            if len(old) != len(new)
            else 'only the sign of zero, or below 2^-53'
        )
    apart = np.abs(second_values - first_values)
    unknown = int((~same & np.isnan(apart)).sum())
    text = f'{int((~same).sum())} values'
    if unknown:
        text += f', {unknown} of them known on one side alone'
    if unknown < (~same).sum():
        row = int(np.nanargmax(np.where(same, math.nan, apart)))
        with np.errstate(divide='ignore', invalid='ignore'):
            relative = np.nanmax(np.where(same, math.nan, apart / np.abs(first_values)))
        text += f', absolute {apart[row]:.3g} in row {row}, relative {relative:.3g}'
    return text
