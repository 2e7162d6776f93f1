"""Diameters of beads that nobody told, from the discs that a film shows."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.experiment.trays import MILLIMETRE, load_trays
from nanorocks_ros.experiment.unknown_diameters import (
    DIAMETER,
    UnknownDiameter,
    unknown_diameters,
    with_diameters,
)
from nanorocks_ros.experiment.yaml_lines import is_content, shown_name
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.recordings.bag.bag_folder import read_metadata
from nanorocks_ros.records import TrayImage
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.scene_detector import SceneDetector
from nanorocks_ros.stages.tracking.scene.scene_model import SceneModel
from nanorocks_ros.studies.analysis.scene_frames import learnt_colours, scene_frames
from nanorocks_ros.studies.measure.species_sizes import (
    FoundDiameter,
    SpeciesLook,
    single_size,
    species_sizes,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.tray_cells import Polygon
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Frame
    from nanorocks_ros.settings import PipelineSettings

# Beads that stand for those of unknown size until they are seen, and the most that are.
_NOMINAL_MM = 1e-3
_ANY_NUMBER = 2000
_REMEDY = (
    f'measure a bead and write {DIAMETER}, or mark it: nanorocks tray FILM --browse -o mine.yaml'
)


class FoundTrays(NamedTuple):
    """Settings whose trays file tells all diameters, and what was found, a line each."""

    settings: PipelineSettings
    notices: tuple[str, ...] = ()


def guessed_diameter(
    frames: Sequence[NDArray[np.uint8]], look: BeadLook | None = None
) -> FoundDiameter:
    """Diameter of the discs that the film shows.

    Parameters
    ----------
    frames : sequence of ndarray of uint8, (rows, columns, 3), bgr
    look : BeadLook, optional
        What is told of them.

    Raises
    ------
    ConfigurationError
        When no discs of one size stand out.
    """
    model = SceneModel(frames, look or BeadLook())
    radii = []
    for frame in frames:
        candidates = model.candidates(np.ascontiguousarray(frame))
        radii.append(candidates.outlines.discs[model.alike(candidates), 2])
    size = single_size(np.concatenate(radii), len(frames))
    if isinstance(size, str):
        raise ConfigurationError('--diameter-px', f'cannot be guessed: {size}', 'measure a bead')
    return size


def with_found_diameters(
    settings: PipelineSettings, told: Collection[str], bag: Path, image_topic: str = ''
) -> FoundTrays:
    """Find the diameters that the trays file of the settings leaves open, in the film.

    Parameters
    ----------
    settings : PipelineSettings
    told : collection of str
        Names of the settings that the user told, as of `recorded_settings`.
    bag : Path
        Of the film.
    image_topic : str, optional
        The camera's topic if it has another name than the graph's.

    Raises
    ------
    ConfigurationError
        When a diameter cannot be found, or the settings not be used.
    RecordingError
        When the bag cannot be read.
    """
    unknown = unknown_diameters(settings.trays_file)
    if not unknown:
        return FoundTrays(settings)
    require_looks(settings)
    nominal = _nominal(settings, told, read_metadata(bag), str(bag))
    return _found_in(settings, nominal, scene_frames(bag, nominal, image_topic=image_topic))


def require_looks(settings: PipelineSettings) -> None:
    """Refuse a file that cannot be used, and open diameters that no film tells: of the flight.

    Raises
    ------
    ConfigurationError
    """
    name = _name(settings.trays_file)
    content = _with_nominal_beads(settings.trays_file)
    try:
        trays = load_trays(content)
    except ConfigurationError as error:
        where = error.where.replace(shown_name(content, 'trays file'), name, 1)
        raise ConfigurationError(where, error.what, error.do) from error
    for key in unknown_diameters(settings.trays_file):
        if trays[key.tray].species[key.species].appearance is None:
            raise ConfigurationError(
                _place(trays, key, name),
                f'lacks {DIAMETER}',
                'add it, or "look: auto" to have it found in the film',
            )


def with_diameters_in_view(
    settings: PipelineSettings, told: Collection[str], camera: str, frames: Sequence[Frame]
) -> FoundTrays:
    """Find the diameters that the trays file of the settings leaves open, in frames of a camera.

    Parameters
    ----------
    settings : PipelineSettings
    told : collection of str
        Names of the settings that the user told, as of `recorded_settings`.
    camera : str
        Its name in errors.
    frames : sequence of Frame
        Spread over some seconds.

    Raises
    ------
    ConfigurationError
        When a diameter cannot be found, or the settings not be used.
    FrameError
        When a frame cannot be used.
    """
    nominal = _nominal(settings, told, {}, camera)
    trays = trays_of(nominal)
    stage = Preprocessor(nominal, trays, camera)
    records = [record for frame in frames for record in stage.push(frame)]
    images = [record for record in (*records, *stage.flush()) if isinstance(record, TrayImage)]
    return _found_in(settings, nominal, learnt_colours(images, nominal, trays))


def _found_in(
    settings: PipelineSettings,
    nominal: PipelineSettings,
    frames: Mapping[int, Sequence[NDArray[np.uint8]]],
) -> FoundTrays:
    """The settings with the diameters that frames by tray show."""
    file, unknown = settings.trays_file, unknown_diameters(settings.trays_file)
    name = _name(file)
    film = _Film(load_trays(nominal.trays_file), nominal.preprocess.pixels_per_metre, frames)
    for key in unknown:
        if key.tray not in frames:
            raise ConfigurationError(
                _place(film.trays, key, name),
                f'lacks {DIAMETER}, and the film does not show this tray',
                'add it',
            )
    sizes = _sizes(film, unknown, name)
    diameters, notices = {}, []
    for key, size in sizes.items():
        diameters[key] = size.diameter / film.scale / MILLIMETRE
        notices.append(
            f'{_place(film.trays, key, name, "the diameter of ")} is found in the film: '
            f'{diameters[key]:.4g} mm at {film.scale:.6g} px/m, from {size}; '
            f'{DIAMETER}: {diameters[key]:.4g} keeps it'
        )
    text = with_diameters(file, diameters)
    return FoundTrays(replace(settings, trays_file=text), tuple(notices))


def _name(trays_file: str) -> str:
    return 'trays file' if is_content(trays_file) else trays_file


class _Film(NamedTuple):
    """Trays whose beads have any size, [px/m], and frames by tray."""

    trays: dict[int, Tray]
    scale: float
    frames: Mapping[int, Sequence[NDArray[np.uint8]]]


def _with_nominal_beads(trays_file: str) -> str:
    """Content of the trays file with some diameter where there is none."""
    return with_diameters(trays_file, dict.fromkeys(unknown_diameters(trays_file), _NOMINAL_MM))


def _nominal(
    settings: PipelineSettings,
    told: Collection[str],
    metadata: Mapping[str, str],
    recording: str,
) -> PipelineSettings:
    """The settings with beads of any size, completed by what a recording says."""
    some = replace(settings, trays_file=_with_nominal_beads(settings.trays_file))
    return calibrated(recorded_settings(some, told, metadata, recording).settings)


def _place(trays: Mapping[int, Tray], key: UnknownDiameter, name: str, before: str = '') -> str:
    """A species, for errors and notices."""
    return f'{name}: {before}{trays[key.tray].species[key.species].material} in tray {key.tray}'


def _sizes(
    film: _Film, unknown: Sequence[UnknownDiameter], name: str
) -> dict[UnknownDiameter, FoundDiameter]:
    """The diameters that are not told, from the discs that look like these beads."""
    sizes: dict[UnknownDiameter, FoundDiameter] = {}
    for number in dict.fromkeys(key.tray for key in unknown):
        keys = [key for key in unknown if key.tray == number]
        tray, frames = film.trays[number], film.frames[number]
        if len(tray.species) == 1:
            found = _of_single_species(tray, film.scale, frames)
        else:
            found = _of_several_species(tray, film.scale, frames, [key.species for key in keys])
        if isinstance(found, str):
            problem = f'its diameter cannot be found: {found}'
            raise ConfigurationError(_place(film.trays, keys[0], name), problem, _REMEDY)
        sizes |= {key: found[key.species] for key in keys}
    return sizes


def _of_single_species(
    tray: Tray, scale: float, frames: Sequence[NDArray[np.uint8]]
) -> tuple[FoundDiameter, ...] | str:
    of_any_size = replace(
        tray.species[0], diameter_low=math.nan, diameter_high=math.nan, count=_ANY_NUMBER
    )
    detector = SceneDetector(replace(tray, species=(of_any_size,)), scale)
    detector.learn(frames)
    radii = [detector.detect(frame)[0].radii for frame in frames]
    size = single_size(np.concatenate(radii), len(frames))
    return size if isinstance(size, str) else (size,)


def _of_several_species(
    tray: Tray, scale: float, frames: Sequence[NDArray[np.uint8]], unknown: Sequence[int]
) -> tuple[FoundDiameter, ...] | str:
    looks = []
    for k, species in enumerate(tray.species):
        look = species.appearance
        looks.append(
            SpeciesLook(
                sign=0 if look is None else look.sign,
                colour=species.properties.color if look is None else look.colour,
                diameter=math.nan if k in unknown else species.diameter * scale,
            )
        )
    return species_sizes(frames, looks, lambda places: _inside(tray, places / scale))


def _inside(tray: Tray, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which places (n, 2), [m], are inside the tray and on no mask."""

    def within(polygon: Polygon) -> NDArray[np.bool_]:
        # In a precision that suits the single floats of these polygons.
        corners = np.array(polygon, dtype=np.float32)
        sides = [cv2.pointPolygonTest(corners, place, False) for place in places.tolist()]
        return np.array(sides) >= 0.0

    inside = np.ones(len(places), dtype=bool) if tray.inside is None else within(tray.inside)
    for mask in tray.masks:
        inside &= ~within(mask)
    return inside
