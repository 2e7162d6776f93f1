"""Pages of the documentation that are generated: topics, tables, parameters, flags, Python.

``python -m nanorocks_ros.tools.docs_pages.wire_pages`` writes them; a test fails when they are
stale.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros import settings as st
from nanorocks_ros.records import Quality
from nanorocks_ros.records.result_words import FLAGS
from nanorocks_ros.tools.docs_pages.python_page import python_page
from nanorocks_ros.tools.docs_pages.table_page import tables_page
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout
from nanorocks_ros.wire.bead_truth import beads_layout
from nanorocks_ros.wire.products import PRODUCTS

if TYPE_CHECKING:
    from collections.abc import Iterable

_NOTE = '<!-- Made by `make docs` from the code; change that instead. -->\n\n'
_GROUPS = (
    (
        'All nodes behind the camera, and `nanorocks analyse`',
        'Each node reads those it needs; one file can serve the whole graph. On the command '
        'line `speed.method` is `--speed-method`.',
        st.PipelineSettings(),
    ),
    ('`simulator`, and `pipeline` under `simulation.`', '', st.SimulationSettings()),
    (
        '`simulator` with `whole_scene`, under `scene.`, and `nanorocks simulate --scene`',
        'On the command line `scene.noise` is `--scene-noise`.',
        st.SceneSettings(),
    ),
    (
        '`nanorocks simulate --scene`',
        'On the command line `compression.rate` is `--compression-rate`.',
        st.CompressionSettings(),
    ),
    ('`simulator`', '', st.FilmSettings()),
    ('`simulator`, `bag_player`, `pipeline`', '', st.PacingSettings()),
    ('`bag_player`, `pipeline`', '', st.BagSettings()),
    (
        '`bag_player`',
        '`position` and `rate` can be set while it plays; see [replay.md](../use/replay.md).',
        st.PlayerSettings(),
    ),
    ('`preprocessor`, `pipeline`', '', st.CameraSettings()),
    ('`pipeline`', '', st.SourceSettings()),
    ('`pipeline`', 'See [replay.md](../use/replay.md#record).', st.RecordSettings()),
    ('`pipeline`, the live page', '', st.LivePageSettings()),
    (
        '`dashboard`, `pipeline` under `dashboard_`, and `nanorocks dashboard`',
        'The port of the page that the pipeline serves is `dashboard_port`; on the command line '
        'it is `--port`.',
        st.DashboardSettings(),
    ),
    ('`dashboard`', '', st.DashboardGraphSettings()),
    ('`pipeline`', '', st.WorkSettings()),
)


def _table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = ['| ' + ' | '.join(header) + ' |']
    lines.append('|' + '|'.join(' --- ' for _ in lines[0].split(' | ')) + '|')
    lines += ['| ' + ' | '.join(cell.replace('|', '\\|') for cell in row) + ' |' for row in rows]
    return '\n'.join(lines) + '\n'


def topics_page() -> str:
    """Topics and array layouts."""
    text = _NOTE + '# Topics\n\n'
    text += (
        f'Relative names, under `{topics.NAMESPACE}` unless the namespace is moved; `K` is the '
        'number of a tray. All are reliable; a latched topic is transient local, so that a late '
        'subscriber still gets the last message.\n\n'
    )
    text += _table(
        ('topic', 'type', 'depth', 'latched', 'content'),
        (
            (
                f'`{topic.name.format(tray="K")}`',
                topic.type,
                str(topic.depth),
                'yes' if topic.latched else '',
                topic.doc,
            )
            for topic in topics.TOPICS
        ),
    )
    text += (
        '\nBeside these, every node publishes `/diagnostics` once a second, and `bag_player` '
        '`/clock`.\n\n# Array layouts\n\n'
        'The arrays are `std_msgs/Float32MultiArray`: `layout.dim[0].label` holds the field '
        'names, separated by commas. SI units; NaN means "not known yet". `epoch` tells what '
        '`time` counts from. Read from `msg_defs/nanorocks_msgs/msg/`, which also builds as an '
        'interface package.\n'
    )
    for product in PRODUCTS:
        array = layout(product.record)
        text += f'\n## {array.name}\n\n{array.doc}\n\n'
        text += _table(
            ('element', 'field', 'unit', 'meaning'),
            (
                (str(index), f'`{field.name}`', field.unit, field.doc)
                for index, field in enumerate(array.fields)
            ),
        )
        if array.constants:
            named = ', '.join(f'`{name}` = {value}' for name, value in array.constants.items())
            text += f'\nConstants: {named}.\n'
    return text + _beads_section()


def _beads_section() -> str:
    """The array whose length is that of the list of beads."""
    array = beads_layout()
    head, row = len(array.head), len(array.bead)
    text = f'\n## BeadsTruth\n\n{array.doc}\n\n'
    text += (
        f'{head} elements (`layout.dim[0]`), then {row} for each bead (`dim[1]`: how many beads, '
        '`dim[2]`: the names); a bead keeps its row, which is its identity.\n\n'
    )
    fields = [
        *((str(index), field) for index, field in enumerate(array.head)),
        *((f'{head + index} + {row} i', field) for index, field in enumerate(array.bead)),
    ]
    return text + _table(
        ('element', 'field', 'unit', 'meaning'),
        ((place, f'`{field.name}`', field.unit, field.doc) for place, field in fields),
    )


def parameters_page() -> str:
    """Every parameter with its default and range."""
    text = _NOTE + '# Parameters\n'
    for title, remark, settings in _GROUPS:
        text += f'\n## {title}\n\n{type(settings).__doc__}\n\n'
        text += f'{remark}\n\n' if remark else ''
        text += _table(
            ('parameter', 'default', 'unit', 'range', 'meaning'),
            (
                (f'`{row.name}`', _default(row.default), row.unit, _range(row), row.doc)
                for row in st.rows(settings)
            ),
        )
    return text


def flags_page() -> str:
    """Every flag with its meaning and remedy, from the register of words."""
    text = _NOTE + '# Flags\n\n'
    text += (
        '`quality` of an array is a sum of these values, 0 where no fault is known; tables, JSON '
        'and `/diagnostics` name them. '
        '[speed.md](../method/speed.md#the-flags) says when the less obvious ones are set.\n\n'
    )
    return text + _table(
        ('flag', 'value', 'meaning', 'what to do'),
        (
            (f'`{flag.name.lower()}`', str(flag.value), FLAGS[flag].text, FLAGS[flag].remedy)
            for flag in Quality
            if flag.name
        ),
    )


def _default(value: st.Value) -> str:
    if isinstance(value, tuple):
        return ', '.join(f'{number:g}' for number in value) or 'empty'
    if isinstance(value, bool):
        return str(value).lower()
    return f'{value:g}' if isinstance(value, float) else str(value) or 'empty'


def _range(row: st.SettingRow) -> str:
    if row.bounds.choices:
        return ', '.join(f'`{choice}`' for choice in row.bounds.choices)
    if isinstance(row.default, bool | str):
        return ''
    return f'{row.bounds.low:g} to {row.bounds.high:g}'


FILES = {
    'docs/reference/topics.md': topics_page,
    'docs/reference/parameters.md': parameters_page,
    'docs/reference/flags.md': flags_page,
    'docs/reference/python.md': python_page,
    'docs/reference/tables.md': tables_page,
}


def write(root: Path) -> None:
    """Write everything that is generated into a source tree."""
    for name, content in FILES.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content(), encoding='utf-8')


if __name__ == '__main__':
    write(Path(sys.argv[1] if len(sys.argv) > 1 else '.'))
