"""Materials of the package, and those that a file of trays describes."""

from __future__ import annotations

import json
from dataclasses import astuple

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.materials import known_materials
from nanorocks_ros.experiment.trays import load_trays, tray_values
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera

STEEL = 'steel: {density_g_cm3: 7.8, color_bgr: [150, 150, 150]}'
TRAYS = """
trays:
  1:
    dimensions_mm: [15, 15, 3]
    species:
      - {material: steel, diameter_mm: 2, count: 3}
"""


def load(tmp_path, text):
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    return load_trays(path)


def beads_of(tmp_path, text):
    return load(tmp_path, text)[1].species[0]


def test_the_flown_materials_are_red_blue_and_gray():
    hues = {name: material.hue for name, material in known_materials().items()}
    assert hues == {'acrylic': 1, 'glass': -1, 'copper': 1, 'JSC-1': 0}


def test_every_flown_bead_is_of_a_known_material():
    flown = {species.properties for tray in load_trays().values() for species in tray.species}
    assert flown == set(known_materials().values())


def test_a_material_of_the_trays_file_has_defaults_for_all_but_density_and_colour(tmp_path):
    steel = beads_of(tmp_path, f'materials: {{{STEEL}}}{TRAYS}').properties
    assert (steel.name, steel.density, steel.shape, steel.hue) == ('steel', 7800.0, 'sphere', 0)
    assert (steel.position_error_px, steel.chalk_position_error_px) == (0.3, 0.6)
    assert astuple(steel.look) == (150.0, 150.0, 150.0, 0.4, 0.6, 0.45, 0.0, 0.0, 90.0)


def test_a_material_of_the_trays_file_can_say_all(tmp_path):
    rest = 'shape: grain, position_error_px: 0.1, look: {color_bgr: [9, 8, 7], highlight: 200}'
    text = f'materials: {{{STEEL[:-1]}, {rest}}}}}{TRAYS}'
    steel = beads_of(tmp_path, text).properties
    assert (steel.shape, steel.position_error_px, steel.color) == ('grain', 0.1, (150, 150, 150))
    assert (steel.look.blue, steel.look.red, steel.look.highlight) == (9.0, 7.0, 200.0)


def test_a_described_material_is_drawn_in_its_colour(tmp_path):
    green = STEEL.replace('150, 150, 150', '20, 200, 20')
    tray = load(tmp_path, f'materials: {{{green}}}{TRAYS}')[1]
    settings = SimulationSettings(width_px=320, height_px=260, noise=0.0)
    camera = TrayCamera(settings, tray, np.array([0.001]), ('steel',))
    corner = np.array([camera.region.x, camera.region.y])
    column, row = (0.0075 * settings.pixels_per_metre + corner).astype(int)
    blue, level, red = camera.picture(np.full((1, 3), 0.0075), 0)[row, column].astype(int)
    assert level > blue + 60
    assert level > red + 60


@pytest.mark.parametrize('densities', ['', 'densities_g_cm3: {steel: 7.8}'])
def test_the_remedy_for_an_unknown_material_can_be_pasted(tmp_path, densities):
    text = f'{densities}{TRAYS}'
    with pytest.raises(ConfigurationError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert message.startswith(f'{tmp_path / "mine.yaml"}:6: material ')
    assert "'steel' is not described (known: JSC-1, acrylic, copper, glass)" in message
    assert '\n' not in message
    pasted = message.split('"')[1]
    density = beads_of(tmp_path, f'{pasted}\n{text}').density
    assert density == (7800.0 if densities else 1000.0)


def test_a_density_of_the_file_replaces_that_of_a_known_material(tmp_path):
    text = TRAYS.replace('steel', 'acrylic')
    beads = beads_of(tmp_path, f'densities_g_cm3: {{acrylic: 1.2}}{text}')
    assert beads.density == 1200.0
    assert beads.properties.look == known_materials()['acrylic'].look


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('density_g_cm3: 7.8, ', '', ":1: 'steel' has no density; add density_g_cm3"),
        (', color_bgr: [150, 150, 150]', '', ':1: lacks color_bgr; add it'),
        ('7.8', '-1', ':1: -1 is no positive number'),
        ('[150, 150, 150]', '[150, 150]', r':1: color \[150.0, 150.0\]; give blue, green and red'),
        ('[150, 150, 150]', '[1, 2, 300]', r':1: color \[1.0, 2.0, 300.0\]'),
        ('150]', '150], shape: cube', ":1: unknown shape 'cube'; use sphere, oval, grain"),
        ('150]', '150], size: 3', ":1: unknown entry 'size'; use chalk_position_error_px"),
        ('150]', '150], look: {glow: 2}', ':1: glow 2; give 0 to 1'),
        ('150]', '150], look: {shine: 1}', ":1: unknown entry 'shine'; use ambient"),
    ],
)
def test_a_bad_description_is_refused_with_the_line_and_the_remedy(tmp_path, old, new, message):
    text = f'materials: {{{STEEL}}}{TRAYS}'
    assert old in text
    with pytest.raises(ConfigurationError, match=message):
        load(tmp_path, text.replace(old, new, 1))


def test_a_density_given_twice_is_refused(tmp_path):
    text = f'densities_g_cm3: {{steel: 7.8}}\nmaterials: {{{STEEL}}}{TRAYS}'
    with pytest.raises(ConfigurationError, match=":2: the density of 'steel' is given twice"):
        load(tmp_path, text)


def test_provenance_holds_the_properties_of_a_described_material_alone(tmp_path):
    flown = tray_values(load_trays()[1])['species'][0]
    assert list(flown) == [
        'material', 'diameter_low', 'diameter_high', 'density', 'count', 'mass',
    ]  # fmt: skip
    own = tray_values(load(tmp_path, f'materials: {{{STEEL}}}{TRAYS}')[1])
    assert own['species'][0]['properties']['color'] == (150.0, 150.0, 150.0)
    assert json.loads(json.dumps(own))['species'][0]['density'] == 7800.0
