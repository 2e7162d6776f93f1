"""A figure shows first what `nanorocks analyse` told of its own tray, then the others."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.records import (
    NS,
    CorEstimate,
    CorRelation,
    CorStatus,
    GroundTruth,
    Headline,
    Interval,
    Measured,
    Quality,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults
from nanorocks_ros.studies.analysis.results.results_folder import write_results

STEEL = """\
materials:
  steel: {density_g_cm3: 7.85, color_bgr: [150, 150, 150]}
trays:
  1:
    dimensions_mm: [90, 60, 4]
    species:
      - {material: steel, diameter_mm: 3, count: 24}
"""


def speeds(cycle=1):
    start = 60 * (cycle - 1) * NS
    return [
        SpeedEstimate(
            stamp_ns=start + k * NS // 10,
            tray=1,
            cycle=cycle,
            cycle_start_ns=start,
            mean_projected_speed=Measured(0.0178 / (1.0 + 0.1 * k / 16.7), 1e-4),
            window=0.3,
            method=SpeedMethod.TRACKING,
        )
        for k in range(1, 221)
    ]


def estimate(cycle=1, beads=0.848, **more):
    return CorEstimate(
        stamp_ns=(60 * (cycle - 1) + 20) * NS,
        tray=1,
        cycle=cycle,
        relation=CorRelation.LIBRARY,
        **{
            'status': CorStatus.FINAL,
            'restitution': Interval(beads, beads - 0.012, beads + 0.012),
            'wall_restitution': Interval(0.931, 0.929, 0.933),
            'paper_restitution': 0.980,
            'headline': Headline.CONTACTS,
            'tension': 3.4,
            'decay_restitution': Interval(0.79, 0.70, 0.86),
            'contact_restitution': Interval(beads, beads - 0.012, beads + 0.012),
            'joint_restitution': Interval(0.842, 0.831, 0.853),
            'samples': 180,
            **more,
        },
    )


def truth(stamp_ns=20 * NS):
    return GroundTruth(
        stamp_ns=stamp_ns,
        tray=1,
        cycle=1,
        mean_projected_speed=0.01,
        mean_speed=0.013,
        bodies=24,
        restitution=0.85,
        wall_restitution=0.93,
        sticking_speed=0.0,
    )


def results(folder, *cors, known=True, trays=STEEL):
    records = [*(record for k in range(len(cors)) for record in speeds(k + 1)), *cors]
    tray = TrayResults(records, truth=[truth()] if known else [])
    settings = with_values(PipelineSettings(), {'trays_file': trays, 'trays': [1]}, 'test')
    write_results(Analysis(epoch_ns=0, trays={1: tray}), folder, Path('film'), settings)
    return folder


def drawn(folder, capsys, kind='decay', *more):
    picture = folder.parent / f'{kind}.svg'
    assert main(['figure', kind, str(folder), '-o', str(picture), '--json', '--force', *more]) == 0
    values = json.loads(capsys.readouterr().out)
    # Texts stand as comments beside their outlines.
    return values, ' '.join(re.findall(r'<!-- (.*?) -->', picture.read_text(), re.DOTALL))


@pytest.fixture
def own(tmp_path):
    return results(tmp_path / 'own', estimate())


def test_the_figure_of_an_own_tray_begins_with_what_analyse_told(own, capsys):
    values, text = drawn(own, capsys)
    first, told = values['published'][0], ' '.join(values['published'])
    assert first.startswith('analyse: beads 0.8480 [0.8360, 0.8600] (95 %), walls 0.9310 [')
    assert 'from contacts alone, since decay and contacts differ by 3.4' in told
    assert 'decay alone 0.790 [0.700, 0.860]' in told
    assert 'closed form of the paper 0.98' in told
    assert values['published'][-1] == 'truth: beads 0.85, walls 0.93'
    assert text.index('24 steel beads; 90 x 60 x 4 mm') < text.index('analyse: beads 0.8480')
    # Nothing of the tray of the flight, whose closed form says 0.98 of other beads.
    assert 'acrylic' not in text


def test_the_figure_against_speed_begins_with_it_as_well(own, capsys):
    _, text = drawn(own, capsys, 'instantaneous')
    assert 'analyse: beads 0.8480 [0.8360, 0.8600]' in text


def test_flags_and_missing_restitutions_are_told_in_words(tmp_path, capsys):
    unknown = estimate(status=CorStatus.NO_DECAY, restitution=Interval())
    values, _ = drawn(results(tmp_path / 'a', unknown, known=False), capsys)
    assert values['published'][0].startswith('analyse: restitution of beads unknown, walls 0.931')
    assert values['published'][1] == 'reason: the speeds do not fall'
    flagged = estimate(quality=Quality.SATURATED)
    values, _ = drawn(results(tmp_path / 'b', flagged, known=False), capsys)
    assert 'flags: more than 1 % of the pixels' in ' '.join(values['published'])
    assert not any('truth' in line for line in values['published'])


def test_several_cycles_are_told_from_the_lowest_to_the_highest(tmp_path, capsys):
    cors = [estimate(cycle, beads) for cycle, beads in ((1, 0.84), (2, 0.86), (3, 0.848))]
    values, _ = drawn(results(tmp_path / 'a', *cors), capsys)
    assert values['published'][0].startswith(
        'analyse, 3 of 3 cycles: beads 0.84 to 0.86, median 0.848, from contacts alone'
    )


def test_another_tray_than_that_of_the_results_is_refused(own, tmp_path, capsys):
    other = tmp_path / 'other.yaml'
    other.write_text(STEEL.replace('count: 24', 'count: 25'))
    picture = tmp_path / 'a.png'
    call = ['figure', 'decay', str(own), '-o', str(picture)]
    assert main([*call, '--trays', str(other)]) == 2
    error = capsys.readouterr().err
    assert 'tray 1' in error
    assert error.count('\n') == 1
    assert not picture.exists()
    same = tmp_path / 'same.yaml'
    same.write_text(STEEL)
    assert main([*call, '--trays', str(same)]) == 0


def test_a_table_without_the_columns_of_this_version_is_told_as_well(own, capsys):
    path = own / 'tray_1_cor.csv'
    rows = [line.split(',') for line in path.read_text().splitlines()]
    kept = [k for k, name in enumerate(rows[0]) if '_68' not in name]
    assert len(kept) < len(rows[0])
    path.write_text('\n'.join(','.join(row[k] for k in kept) for row in rows) + '\n')
    values, _ = drawn(own, capsys)
    assert values['published'][0].startswith('analyse: beads 0.8480 [0.8360, 0.8600]')
