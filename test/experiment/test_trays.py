"""The flown trays, and trays files that are refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.appearance import Appearance
from nanorocks_ros.experiment.trays import (
    load_trays,
    require_measurable,
    tray_by_number,
)

PAPER = json.loads((Path(__file__).parents[1] / 'paper_values.json').read_text())

GOOD = """\
densities_g_cm3: {acrylic: 1.18}
trays:
  1:
    dimensions_mm: [15, 15, 3]
    species:
      - {material: acrylic, diameter_mm: 2, count: 15}
"""


@pytest.mark.parametrize('number', range(1, 9))
def test_trays_agree_with_table_1_of_the_paper(number):
    tray = load_trays()[number]
    printed = PAPER['table1_trays'][str(number)]
    assert [1e3 * side for side in tray.dimensions] == pytest.approx(printed['dims_mm'])
    assert tray.chalk == printed.get('chalk', False)
    assert len(tray.species) == len(printed['species'])
    for beads, expected in zip(tray.species, printed['species'], strict=True):
        diameters = expected['d_mm']
        low, high = diameters if isinstance(diameters, list) else (diameters, diameters)
        assert beads.material == expected['material']
        assert (beads.diameter_low, beads.diameter_high) == pytest.approx(
            (1e-3 * low, 1e-3 * high)
        )
        if 'N' in expected:
            assert beads.count == expected['N']
        else:
            assert beads.mass == pytest.approx(1e-3 * expected['mass_g'])


def test_densities_are_those_of_the_paper():
    densities = {
        beads.material: beads.density for tray in load_trays().values() for beads in tray.species
    }
    for material, density in PAPER['densities_g_cm3'].items():
        if material != 'where':
            assert densities[material] == pytest.approx(1e3 * density)


@pytest.mark.parametrize('number', [6, 7, 8])
def test_jsc1_counts_follow_from_table_3(number):
    tray = load_trays()[number]
    clusters, size, _, percent = PAPER['table3_clusters']['rows'][str(number)]
    counted = sum(beads.count for beads in tray.species if beads.mass is None)
    grains = tray.count - counted
    assert grains == pytest.approx(100 * clusters * size / percent - counted, abs=1.0)


@pytest.mark.parametrize('number', [6, 7, 8])
def test_jsc1_counts_from_mass_are_kept_beside_them_and_agree_within_a_third(number):
    beads = load_trays()[number].species[-1]
    by_mass = beads.mass / (beads.density * math.pi / 6 * (0.75e-3) ** 3)
    assert beads.count_from_mass == pytest.approx(by_mass)
    assert 0.66 < beads.count_from_mass / beads.count < 1.33


def test_derived_quantities_of_tray_1_are_those_of_the_worked_example():
    tray = load_trays()[1]
    expected = PAPER['worked_example_tray1']['recomputed']
    assert tray.number_density == pytest.approx(expected['n_m3'])
    assert 1e6 * tray.mean_mass == pytest.approx(expected['m_mg_from_density'])


def test_a_user_file_is_read(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text(GOOD)
    assert load_trays(path)[1].count == 15


def test_beads_of_the_flight_have_its_look_unless_it_is_told(tmp_path):
    assert not any(tray.is_learnt for tray in load_trays().values())
    path = tmp_path / 'mine.yaml'
    path.write_text(GOOD.replace('count: 15', 'count: 15, look: bright'))
    assert load_trays(path)[1].species[0].appearance == Appearance(sign=1)


def test_other_beads_are_learnt_from_the_film(tmp_path):
    path = tmp_path / 'mine.yaml'
    steel = 'materials: {steel: {density_g_cm3: 7.8, color_bgr: [90, 90, 90]}}\n'
    path.write_text(steel + GOOD.replace('acrylic, d', 'steel, d'))
    tray = load_trays(path)[1]
    assert tray.is_learnt
    assert tray.species[0].appearance == Appearance()
    assert tray.species[0].expected == 15


def test_beads_may_be_followed_by_diameter_and_look_alone():
    tray = load_trays(
        'trays:\n'
        '  1:\n'
        '    dimensions_mm: [300, 200]\n'
        '    inside_mm: [[10, 10], [290, 10], [290, 190], [10, 190]]\n'
        '    masks_mm: [[[140, 0], [160, 0], [150, 20]]]\n'
        '    species:\n'
        '      - {diameter_mm: [9, 11], look: auto, colour: "#c03020"}\n'
    )[1]
    species = tray.species[0]
    assert species.appearance == Appearance(sign=0, colour=(32.0, 48.0, 192.0))
    assert (species.material, species.expected) == ('bead', None)
    assert species.count == 740
    assert math.isnan(species.density)
    assert math.isnan(tray.dimensions[2])
    assert tray.inside[1] == pytest.approx((0.29, 0.01))
    assert len(tray.masks[0]) == 3


def test_restitutions_need_more_than_following_beads():
    for tray in load_trays().values():
        require_measurable(tray)
    text = (
        'trays:\n  1:\n    dimensions_mm: [30, 20]\n'
        '    species:\n      - {material: lead, look: auto, diameter_mm: 2}\n'
    )
    with pytest.raises(ConfigurationError, match=r'height .* count of lead, density of lead; add'):
        require_measurable(load_trays(text)[1])
    whole = text.replace('20]', '20, 3]').replace('mm: 2}', 'mm: 2, count: 5}')
    require_measurable(load_trays('densities_g_cm3: {lead: 11.3}\n' + whole)[1])


def test_a_tray_that_does_not_exist_is_named_with_those_that_do():
    with pytest.raises(ConfigurationError, match=r'tray 9: does not exist; choose one of 1, 2, 3'):
        tray_by_number(load_trays(), 9)


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('count: 15', 'count: 0', r':6: 0 is no positive number'),
        ('count: 15', 'count: 1.5', r':6: count 1.5 is no whole number'),
        (
            'count: 15',
            'count: 2000000',
            r':6: beads of a species .* set NANOROCKS_MAX_BEADS to more',
        ),
        ('count: 15', 'count: 0x7fffffffffffffffff', r':6: beads of a species .*above the limit'),
        ('count: 15', 'count: many', r":6: 'many' is no positive number"),
        ('diameter_mm: 2', 'diameter_mm: .nan', r':6: nan is no positive number'),
        ('diameter_mm: 2', 'diameter_mm: -2', r':6: -2 is no positive number'),
        ('diameter_mm: 2', 'diameter_mm: 4', r':6: beads of 4 mm in a tray of 3 mm'),
        ('diameter_mm: 2', 'diameter_mm: [2, 1]', r':6: diameter \[2.0, 1.0\]'),
        (
            'material: acrylic',
            'material: lead',
            r":6: material 'lead' is not described \(known: JSC-1, acrylic, copper, glass\); "
            r'add "materials: \{lead: \{density_g_cm3: 1\.0, color_bgr: \[90, 90, 90\]\}\}"',
        ),
        ('{acrylic: 1.18}', '{acrylic: 0}', ':1: 0 is no positive number'),
        (', count: 15', '', r':6: lacks count; add it'),
        ('count: 15', 'count: 15, hue: red', r":6: unknown entry 'hue'; use colour, count"),
        ('[15, 15, 3]', '[15, 15]', r':4: 2 dimensions; give length, width, height'),
        (
            'count: 15',
            'count: 15, look: shiny',
            r":6: unknown look 'shiny'; use auto, bright, dark",
        ),
        ('count: 15', 'count: 15, colour: mauve', r":6: unknown colour 'mauve'; use auto, black"),
        ('material: acrylic, ', '', r':6: lacks material; add it, or "look: auto"'),
        (
            '[15, 15, 3]',
            '[15, 15, 3]\n    masks_mm: [[[0, 0], [1, 1]]]',
            r':5: is no polygon; give',
        ),
        ('  1:', '  one:', r":4: tray number 'one'; number the trays"),
        ('trays:', 'trays: [', r':\d+: not YAML'),
        ('species:', 'species: none', r':\d+: (not YAML|species is no list)'),
    ],
)
def test_a_bad_file_is_refused_with_the_line_and_the_remedy(tmp_path, old, new, message):
    path = tmp_path / 'bad.yaml'
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(ConfigurationError, match=message) as caught:
        load_trays(path)
    assert str(caught.value).startswith(str(path))
    assert '; ' in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('text', ['', '# nothing\n', '- 1\n', 'trays: {}\n'])
def test_a_file_of_another_form_is_refused(tmp_path, text):
    path = tmp_path / 'other.yaml'
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=str(path)):
        load_trays(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r'none\.yaml: No such file'):
        load_trays(tmp_path / 'none.yaml')


def test_a_tray_listed_twice_is_refused(tmp_path):
    path = tmp_path / 'twice.yaml'
    path.write_text(GOOD + GOOD.split('trays:\n')[1])
    with pytest.raises(ConfigurationError, match='1 stands twice; remove one'):
        load_trays(path)
