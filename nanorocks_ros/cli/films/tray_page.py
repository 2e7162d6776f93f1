"""``nanorocks tray FILM --browse``: what the page says becomes the options of the command.

Tested by ``test/cli/films/test_tray_page.py``.
"""

from __future__ import annotations

import argparse
import copy
import json
import math
from collections import Counter
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.jobs.interruption import interruption_says

if TYPE_CHECKING:
    from collections.abc import Mapping

    from nanorocks_ros.cli.films.recognised_tray import RecognisedTray
    from nanorocks_ros.studies.measure.film_samples import FilmSamples
    from nanorocks_ros.studies.measure.seen_beads import SeenBeads

# What the page tells instead.
_TOLD_BY_PAGE = (
    'bead', 'diameter_px', 'diameter_mm', 'count', 'look', 'colour', 'material',
    'density_g_cm3', 'corners', 'sides_mm', 'height_mm',
)  # fmt: skip
# Each field of a species on the page, and the option that it is.
_OF_SPECIES = {
    'diameter_mm': 'diameter_mm',
    'count': 'count',
    'density_g_cm3': 'density_g_cm3',
    'material': 'material',
}
_MOST_SPECIES = 6
_LONGEST_NAME = 60


def check_browsing(options: argparse.Namespace) -> None:
    """Refuse options that the page would tell, and a command without its server.

    Raises
    ------
    ConfigurationError
        With the first of them.
    DashboardError
        Without aiohttp.
    """
    # Says itself what is missing.
    from nanorocks_ros.dashboard import film_server  # noqa: F401

    for name in _TOLD_BY_PAGE:
        if getattr(options, name):
            raise ConfigurationError(
                f'--{name.replace("_", "-")}',
                'is given in the browser',
                'leave it out, or leave out --browse',
            )


def described_in_browser(options: argparse.Namespace, samples: FilmSamples) -> RecognisedTray:
    """Serve the page until something is saved.

    Raises
    ------
    DashboardError
        When the page cannot be served.
    """
    from nanorocks_ros.cli.films.recognised_tray import recognised_tray, save
    from nanorocks_ros.dashboard.film_server import FilmServer

    saved: list[RecognisedTray] = []
    # What is saved is what was shown last.
    shown: dict[str, RecognisedTray] = {}

    def recognise(form: Mapping[str, Any]) -> dict[str, Any]:
        told = options_of(form, options)
        tray = recognised_tray(told, samples)
        shown.clear()
        shown[json.dumps(form)] = tray
        return _answer(told, tray)

    def write(form: Mapping[str, Any]) -> str:
        tray = shown.get(json.dumps(form)) or recognised_tray(options_of(form, options), samples)
        save(options, tray)
        saved.append(tray)
        return str(options.output)

    with interruption_says('nothing was written'):
        FilmServer(samples.frames, options.named[0], recognise, write).run()
    return saved[-1]


def options_of(form: Mapping[str, Any], options: argparse.Namespace) -> argparse.Namespace:
    """The options that say what the page says.

    Parameters
    ----------
    form : mapping
        `corners` (list of numbers, [px]), `sides_mm`, `height_mm`, and `species`: a list of
        mappings with `bead` (column, row, diameter, [px]), `diameter_mm`, `count`, `material`
        and `density_g_cm3`. None, or an empty text: not told.
    options : Namespace
        Of the command.

    Raises
    ------
    ConfigurationError
        For a form that is no such thing.
    """
    told = copy.copy(options)
    told.corners = _numbers(form, 'corners') or None
    told.sides_mm = _numbers(form, 'sides_mm') or None
    if told.sides_mm and len(told.sides_mm) != 2:
        raise ConfigurationError('--sides-mm', 'only one of two is given', 'give both, or none')
    height = _numbers({'height_mm': [form.get('height_mm')]}, 'height_mm')
    told.height_mm = height[0] if height else None
    species = form.get('species')
    if not isinstance(species, list) or len(species) > _MOST_SPECIES:
        raise ConfigurationError('species', 'no list of a few', 'reload the page')
    if not all(isinstance(kind, dict) for kind in species):
        raise ConfigurationError('species', 'no descriptions', 'reload the page')
    told.bead = [_bead(kind) for kind in species] or None
    for field, option in _OF_SPECIES.items():
        setattr(told, option, _of_species(species, field) or None)
    return told


def _bead(kind: Mapping[str, Any]) -> list[float]:
    bead = _numbers(kind, 'bead')
    if len(bead) != 3:
        raise ConfigurationError('--bead', f'{len(bead)} numbers', 'mark a bead in the picture')
    return bead


def _of_species(species: list[Mapping[str, Any]], field: str) -> list[Any]:
    """What is told of the species; an error of the option follows where only some are told."""
    if field == 'material':
        return [str(kind[field])[:_LONGEST_NAME] for kind in species if kind.get(field)]
    numbers = [
        number for kind in species for number in _numbers({field: [kind.get(field)]}, field)
    ]
    if field != 'count':
        return numbers
    for number in numbers:
        if number != round(number):
            raise ConfigurationError('--count', f'{number:g}', 'give a whole number')
    return [round(number) for number in numbers]


def _numbers(form: Mapping[str, Any], field: str) -> list[float]:
    """The numbers of a field; what is empty is left out."""
    values = form.get(field)
    if values is None:
        return []
    if not isinstance(values, list) or len(values) > 8:
        raise ConfigurationError(field, 'no list of numbers', 'reload the page')
    numbers = []
    for value in values:
        if value is None or value == '':
            continue
        if type(value) not in (int, float) or not math.isfinite(value):
            flag = f'--{field.replace("_", "-")}'
            raise ConfigurationError(flag, f'{str(value)[:40]!r} is no number', 'give a number')
        numbers.append(float(value))
    return numbers


def _answer(told: argparse.Namespace, tray: RecognisedTray) -> dict[str, Any]:
    """What the page shows of a tray."""
    from nanorocks_ros.experiment.film_section import film_section

    section = film_section(tray.text)
    assert section is not None
    return {
        'beads': told.bead or _shown_beads(tray.beads),
        'region': section.region_px,
        'discs': [
            [[[round(value, 2) for value in disc] for disc in kind.tolist()] for kind in frame]
            for frame in tray.beads.discs
        ],
        'verdicts': _verdicts(tray),
        'notices': tray.notices,
        'text': tray.text,
    }


def _shown_beads(beads: SeenBeads) -> list[list[float]]:
    """A bead of the first frame, for the circle of a species that nobody has marked yet."""
    first = next((kind[len(kind) // 2] for kind in beads.discs[0] if len(kind)), None)
    return [] if first is None else [[first[0], first[1], 2.0 * first[2]]]


def _verdicts(tray: RecognisedTray) -> list[dict[str, Any]]:
    """The verdict on each species by its numbers; of their motion these frames tell nothing."""
    from nanorocks_ros.experiment.trays import load_trays
    from nanorocks_ros.stages.tracking.recognition_counts import SpeciesCounts
    from nanorocks_ros.studies.analysis.recognition_verdicts import recognition_verdict

    (known,) = load_trays(tray.text).values()
    verdicts = []
    for k, kind in enumerate(known.species):
        numbers = [len(frame[k]) for frame in tray.beads.discs]
        seen = sum(numbers) / len(numbers)
        counts = SpeciesCounts(
            tray=known.number,
            material=kind.material,
            expected=kind.expected,
            followed=True,
            frames=len(numbers),
            seen=seen,
            tracked=seen,
            complete=sum(number == kind.expected for number in numbers) / len(numbers),
            tracks=0,
            track_length=math.nan,
            at_rest=math.nan,
            overlapping=math.nan,
            near_limit=math.nan,
            max_speed=math.nan,
            wrong_scale=math.nan,
            learnt=True,
        )
        verdict = recognition_verdict(counts)
        numbers_seen = Counter(numbers)
        verdicts.append(
            {
                'usable': verdict.usable and not verdict.flags,
                'lines': verdict.lines(),
                'median': tray.beads.counts[k],
                'numbers': sorted(numbers_seen.items()),
            }
        )
    return verdicts
