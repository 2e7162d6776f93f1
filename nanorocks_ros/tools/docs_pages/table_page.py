"""The page of the documentation on tables, from the registers of their columns.

Tested by ``test/tools/docs_pages/test_wire_pages.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.studies.analysis.cycle_summaries import SIZE_MEASURES
from nanorocks_ros.studies.analysis.long_term import campaign_columns
from nanorocks_ros.studies.analysis.results.tracks_files import COLUMNS as TRACKS
from nanorocks_ros.studies.batch.batch_tables import cycle_columns
from nanorocks_ros.studies.gas_statistics.statistics_files import TABLES as STATISTICS
from nanorocks_ros.studies.inspection.autocorrelations import COLUMNS as AUTOCORRELATIONS
from nanorocks_ros.studies.inspection.speed_comparison import COLUMNS as SPEEDS
from nanorocks_ros.studies.measure.measure_tables import (
    CONTACTS,
    MEAN_SPEEDS,
    RESTITUTION_COLUMNS,
    RESTITUTIONS,
)
from nanorocks_ros.studies.measure.track_speeds import SPEED_COLUMNS
from nanorocks_ros.studies.results.contact_columns import CONTACT_COLUMNS
from nanorocks_ros.studies.results.record_columns import columns_of
from nanorocks_ros.studies.synthetic.trajectory import EVENT_COLUMNS
from nanorocks_ros.wire.array_layouts import layout
from nanorocks_ros.wire.products import MEASURED

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from nanorocks_ros.outputs.tables.table_columns import Column

_INTRODUCTION = """\
<!-- Made by `make docs` from the code; change that instead. -->

# Tables

Every table that a command writes follows one convention; pandas, R and Excel read it as it is.

- **One header row** of plain names: letters, digits, underscores, no units, nothing before it. The
  names are those of the JSON, of the Parquet files and of Python. Commas separate, the text is
  UTF-8, the decimal mark is a point.
- **SI units**: seconds, metres, metres per second. A name with another unit ends in it, `x_px`.
- **Times** are seconds since `epoch`, in double precision; `epoch_ns` of the description (below)
  is that instant in nanoseconds since 1970.
- **Words** stand for codes and flags: `method` is `tracking`, `status` is `final`, `quality` is
  `good`, or the [flags](flags.md) joined by `;`. Truth values are `true` and `false`.
- **What is not known is an empty cell**: `NaN` in pandas, `NA` in R; `null` in JSON, `NaN` in
  Parquet. So is a number that is not finite.
- **Intervals**: `X_lower` and `X_upper` are the ends of the interval of `cooling.probability`,
  95 % unless another is set, `X_lower_68` and `X_upper_68` of that of 68 %; `X_error` is one
  standard error. That of `cluster_size` is of 68 %.

The numbers of a bag are single precision, those of tables double: they agree to seven digits.

## Description and provenance

Units, meanings, words and provenance stand beside the tables, as a
[Data Package](https://specs.frictionlessdata.io/tabular-data-package/) that programs read, too: a
folder of results has its `datapackage.json`, a single table `tracks.csv` its `tracks.csv.json`.
Parquet files hold all of it themselves.

`provenance` of the results of `nanorocks analyse` says what they follow from: the content of the
trays file (that of the flight where none was told), the scale and where it was from
(`calibration`, `trays file`, `recording`, `settings` or `default`), all settings, the versions of
the libraries, the command and the date. Figures and reports take the tray from there, and refuse
another one.

## Reading

```text
pandas    pandas.read_csv('results/tray_1_cor.csv')
R         read.csv("results/tray_1_cor.csv")
Excel     open it; where the decimal mark is a comma, Data, From Text/CSV, locale English
```

Tables of earlier versions, with `time [s]` in the header, `nan` in cells, codes for words, or a
line of units before the header, are still read by all commands.

"""


def tables_page() -> str:
    """The convention, and the columns of every table."""
    return _INTRODUCTION + '\n'.join(_sections())


def _sections() -> Iterator[str]:
    yield '## `nanorocks analyse`\n'
    yield 'A table for each tray `K`; those of which there is nothing are left out.\n'
    for product in MEASURED:
        record = layout(product.record)
        yield f'### `tray_K_{product.name}.csv`\n\n{record.doc}\n'
        yield _table(columns_of(product.record))
    yield '## `nanorocks analyse` of many recordings\n\n### `cycles.csv`\n'
    yield 'A row for each cycle of each tray. `trays.csv` has the means over all cycles.\n'
    yield _table(cycle_columns('1'))
    yield '## `nanorocks track`, `nanorocks measure`\n\n### `tracks.csv`\n'
    yield (
        'A row for each bead in each frame. Of a trays file that was made for the film the '
        'lengths and speeds stand there in px of the frame, too, as `x_px`; in px alone where '
        'the scale is not known.\n'
    )
    yield _table(TRACKS)
    yield '## `nanorocks measure`\n'
    yield 'Without a given length, lengths of a film are in px, and columns are `X_px`.\n'
    measured: dict[str, tuple[Column, ...]] = {
        MEAN_SPEEDS: SPEED_COLUMNS,
        CONTACTS: CONTACT_COLUMNS,
        RESTITUTIONS: RESTITUTION_COLUMNS,
    }
    for name, columns in measured.items():
        yield f'### `tray_K_{name}.csv`\n'
        yield _table(columns)
    yield '## `nanorocks speeds --table`\n'
    yield _table(SPEEDS)
    yield '## `nanorocks autocorrelation --table`\n'
    yield _table(AUTOCORRELATIONS)
    yield '## `nanorocks figure long-term --table`\n'
    yield _table(campaign_columns(SIZE_MEASURES[0]))
    yield '## `nanorocks statistics`\n'
    for name, columns in STATISTICS.items():
        yield f'### `{name}`\n'
        yield _table(columns)
    yield '## `nanorocks simulate --events`\n\nIn Parquet, and as arrays in `.npz`.\n'
    yield _table(EVENT_COLUMNS)


def _table(columns: Sequence[Column]) -> str:
    lines = ['| column | kind | unit | meaning |', '| --- | --- | --- | --- |']
    lines += [
        f'| `{column.name}` | {column.kind} | {column.unit} | {_meaning(column)} |'
        for column in columns
    ]
    return '\n'.join(lines) + '\n'


def _meaning(column: Column) -> str:
    if not column.words or column.several:
        return column.doc
    words = ', '.join(f'`{word}`' for word in column.words)
    return f'{column.doc}: {words}'
