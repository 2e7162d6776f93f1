"""Diameters that are not told are found in the film, or refused with a remedy."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_discs import SIZE, disc_frames

from benchmarks.drawn_scenes import DrawnScene, draw
from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings, PreprocessSettings
from nanorocks_ros.studies.measure.found_diameters import guessed_diameter, with_found_diameters

DARK, BRIGHT, RED = (40, 40, 40), (250, 250, 250), (30, 30, 190)
SCALE = 8000.0
TRAY = """\
film: {{pixels_per_metre: 8000, region_px: [0, 0, {}, {}], container: assumed}}
trays:
  1:
    dimensions_mm: [45, 30]
    species:
{}"""


def trays_file(folder, *species):
    """A trays file with these species."""
    rows = ''.join(f'      - {{{kind}}}\n' for kind in species)
    path = folder / 'mine.yaml'
    path.write_text(TRAY.format(*SIZE, rows), encoding='utf-8')
    return path


def bag_of(folder, frames):
    """A bag of frames."""
    images = folder / 'images'
    images.mkdir()
    for number, frame in enumerate(frames):
        cv2.imwrite(str(images / f'{number:03d}.png'), frame)
    bag = folder / 'bag'
    assert main(['import', str(images), '--rate', '30', '-o', str(bag)]) == 0
    return bag


@pytest.fixture(scope='module')
def discs(tmp_path_factory):
    """A bag of red discs of 20 px."""
    return bag_of(tmp_path_factory.mktemp('discs'), disc_frames([RED]))


@pytest.mark.parametrize('colour', [DARK, BRIGHT, RED])
def test_the_diameter_of_discs_of_any_look_is_guessed(colour):
    size = guessed_diameter(disc_frames([colour]))
    assert size.diameter == pytest.approx(20.0, rel=0.06)
    assert size.spread < 0.1
    assert size.discs > size.frames


def test_an_empty_film_is_refused():
    noise = np.random.default_rng(1).integers(160, 170, (6, 60, 80, 3), dtype=np.uint8)
    with pytest.raises(ConfigurationError, match='--diameter-px'):
        guessed_diameter(list(noise))


def test_the_size_is_found_with_the_scale_of_the_file_and_said(discs, tmp_path):
    path = trays_file(tmp_path, 'colour: red, diameter_mm: auto')
    recorded = with_found_diameters(PipelineSettings(trays_file=str(path)), {'trays_file'}, discs)
    (species,) = load_trays(recorded.settings.trays_file)[1].species
    assert species.diameter == pytest.approx(20.0 / SCALE, rel=0.06)
    (notice,) = recorded.notices
    assert f'diameter_mm: {1e3 * species.diameter:.4g} keeps it' in notice


def test_sizes_of_species_in_one_film_are_found(tmp_path):
    scene = DrawnScene(sizes=(7.0, 10.5), count=20, frames=16)
    bag = bag_of(tmp_path, draw(scene)[0])
    path = trays_file(tmp_path, 'look: auto, material: small', 'look: auto, material: large')
    recorded = with_found_diameters(PipelineSettings(trays_file=str(path)), {'trays_file'}, bag)
    small, large = load_trays(recorded.settings.trays_file)[1].species
    assert small.diameter == pytest.approx(14.0 / SCALE, rel=0.02)
    assert large.diameter == pytest.approx(21.0 / SCALE, rel=0.02)
    for material, notice in zip(('small', 'large'), recorded.notices, strict=True):
        assert f'the diameter of {material} in tray 1 is found in the film' in notice


def test_a_told_scale_counts_where_the_file_has_none(discs, tmp_path):
    path = trays_file(tmp_path, 'look: auto')
    path.write_text(path.read_text().split('\n', 1)[1])
    settings = PipelineSettings(
        trays_file=str(path),
        trays=(1,),
        preprocess=PreprocessSettings(pixels_per_metre=2.0 * SCALE, regions_px=(0, 0, *SIZE)),
    )
    told = {'trays_file', 'trays', 'preprocess.pixels_per_metre', 'preprocess.regions_px'}
    recorded = with_found_diameters(settings, told, discs)
    (species,) = load_trays(recorded.settings.trays_file)[1].species
    assert species.diameter == pytest.approx(10.0 / SCALE, rel=0.06)


def test_of_a_file_that_tells_all_sizes_nothing_changes(discs, tmp_path):
    settings = PipelineSettings(trays_file=str(trays_file(tmp_path, 'diameter_mm: 1, look: auto')))
    assert with_found_diameters(settings, {'trays_file'}, discs) == (settings, ())


@pytest.mark.parametrize(
    ('species', 'problem'),
    [
        (('look: auto', 'look: auto'), r'2 of one look .* of \d\d\.\d px; measure a bead'),
        (('look: auto', 'colour: red'), r'colour of some species is given'),
        (('look: auto, diameter_mm: 5', 'look: auto'), r'2 of one look'),
        (('look: bright',), r'nanorocks tray FILM --browse'),
    ],
)
def test_what_cannot_be_found_is_refused_with_a_remedy(discs, tmp_path, species, problem):
    path = trays_file(tmp_path, *species)
    settings = PipelineSettings(trays_file=str(path))
    with pytest.raises(ConfigurationError, match=problem) as caught:
        with_found_diameters(settings, {'trays_file'}, discs)
    assert '\n' not in str(caught.value)


def test_beads_of_the_flight_are_not_searched(discs, tmp_path):
    path = trays_file(tmp_path, 'material: acrylic, count: 3')
    path.write_text(path.read_text().replace('[45, 30]', '[45, 30, 3]'))
    settings = PipelineSettings(trays_file=str(path))
    with pytest.raises(ConfigurationError, match='lacks diameter_mm; add it, or "look: auto"'):
        with_found_diameters(settings, {'trays_file'}, discs)


def test_track_says_what_it_found(discs, tmp_path, capsys):
    path = trays_file(tmp_path, 'look: auto')
    assert main(['track', str(discs), '--trays-file', str(path)]) == 0
    assert 'is found in the film: 2.' in capsys.readouterr().err
    assert main(['track', str(discs), '--diameter-px', 'auto']) == 0
    assert 'the diameter is guessed: 2' in capsys.readouterr().err
