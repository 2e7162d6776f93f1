"""``nanorocks analyse BAG... -o RESULTS``: many recordings, combined in one report.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.batch_progress import BatchProgress
from nanorocks_ros.cli.notices import tell
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.safe_text import counted, printable
from nanorocks_ros.settings import PipelineSettings, PriorSettings, priors_in_words

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.studies.batch.batch_analysis import Batch
    from nanorocks_ros.studies.batch.campaign_means import Combined, TrayMeans


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options for many recordings."""
    group = parser.add_argument_group('many recordings')
    group.add_argument('--workers', type=int, help='processes; default: one for each core')
    group.add_argument(
        '--scheduler', metavar='tcp://HOST:PORT', help='scheduler of a Dask cluster'
    )
    group.add_argument(
        '--statistics',
        action='store_true',
        help='velocity distribution, energies, collisions, g(r) and S(k) as well, of each '
        'recording and in the report',
    )


def is_batch(options: argparse.Namespace) -> bool:
    """Whether the arguments name many recordings."""
    from nanorocks_ros.recordings.bag.find_bags import is_collection, is_pattern

    batch_options = options.workers, options.scheduler, options.statistics or None
    if len(options.bags) > 1 or any(option is not None for option in batch_options):
        return True
    return is_pattern(options.bags[0]) or is_collection(Path(options.bags[0]))


def _check_diameters(settings: PipelineSettings) -> None:
    """Refuse trays whose diameters are not told: each film would have its own."""
    from nanorocks_ros.experiment.trays import load_trays
    from nanorocks_ros.experiment.unknown_diameters import unknown_diameters

    if unknown_diameters(settings.trays_file):
        load_trays(settings.trays_file)


def run_many(options: argparse.Namespace) -> int:
    """Analyse all recordings, combine and report them, and return the exit code."""
    from nanorocks_ros.cli.flags import settings_from, told_settings
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.recordings.bag.find_bags import find_bags
    from nanorocks_ros.studies.batch.batch_analysis import BatchPlan, run_batch
    from nanorocks_ros.studies.batch.batch_files import write_batch
    from nanorocks_ros.studies.batch.campaign_means import combined

    settings = settings_from(options, PipelineSettings(), options.parameters)
    if options.no_output or not options.output:
        raise ConfigurationError('--output', 'is required for many recordings', 'pass -o RESULTS')
    _check_diameters(settings)
    workers = Workers(processes=options.workers, scheduler=options.scheduler)
    folder = Path(options.output)
    search = find_bags(options.bags)
    for text in search.left_out:
        tell(f'{printable(text)}; left out')
    for error in search.missing.values():
        tell(printable(str(error)))
    if not search.bags:
        raise (
            ConfigurationError(
                ', '.join(printable(bag) for bag in options.bags),
                'name no recording',
                'correct the paths',
            )
            if not search.missing
            else next(iter(search.missing.values()))
        )
    plan = BatchPlan(
        bags=search,
        folder=folder,
        settings=settings,
        image_topic=options.image_topic,
        told=told_settings(options, options.parameters),
        statistics=options.statistics,
    )
    with BatchProgress() as progress:
        batch = run_batch(plan, workers, progress)
    combined_results = combined(batch.counted, settings)
    for text in combined_results.notices:
        tell(text)
    report = write_batch(folder, batch, combined_results, settings, options.format)
    if options.json:
        values = {
            **_as_json(batch, combined_results, settings.prior),
            'results': printable(folder),
            'report': printable(report),
        }
        print(json.dumps(values, allow_nan=False))
    else:
        _print(batch, combined_results, settings.prior)
    tell(f'results in {printable(folder)}, report in {printable(report)}')
    unusable = _report_unusable(batch)
    return _report_failures(batch) or unusable


def _report_unusable(batch: Batch) -> int:
    """Name the species that were not recognised; the exit code."""
    from nanorocks_ros.studies.analysis.recognition_verdicts import EXIT_NOT_USABLE

    texts = [
        f'{result.name}: {verdict["text"]}: NOT USABLE ({verdict["flags"][0]["name"]})'
        for result in batch.counted
        for tray in result.summary['trays'].values()
        for verdict in tray.get('recognition', [])
        if not verdict['usable']
    ]
    for text in texts:
        tell(text)
    return EXIT_NOT_USABLE if texts else 0


def _report_failures(batch: Batch) -> int:
    if not batch.failed:
        return 0
    for failure in batch.failed:
        part = ' (the part that could be analysed is in the results)' if failure.analysed else ''
        tell(f'failed: {failure.reason}{part}')
    total = len(batch.results) + sum(not failure.analysed for failure in batch.failed)
    tell(
        f'{len(batch.failed)} of {total} recordings failed, as listed; repair or remove them, '
        'and run the same command again: finished recordings are kept'
    )
    return 1


def _as_json(batch: Batch, combined_results: Combined, prior: PriorSettings) -> dict[str, Any]:
    from nanorocks_ros.studies.batch.means_json import means_as_json

    return {
        'bags': [
            {
                'bag': result.name,
                'results': printable(result.folder),
                'same_as': result.twin or None,
                'state': result.summary['state'],
                'frames': result.summary['frames'],
                'frames_lost': result.summary['frames_lost'],
                'seconds': result.summary['seconds'],
                'complete': result.summary['complete'],
                'notices': result.summary['notices'],
                'trays': {
                    number: {'cycles': tray['cycles'], 'truth': tray['truth']}
                    for number, tray in result.summary['trays'].items()
                },
            }
            for result in batch.results
        ],
        'trays': {
            str(number): means_as_json(tray) for number, tray in combined_results.trays.items()
        },
        'failed': [
            {'bag': failure.name, 'reason': failure.reason, 'analysed': failure.analysed}
            for failure in batch.failed
        ],
        'priors': asdict(prior),
    }


def _print(batch: Batch, combined_results: Combined, prior: PriorSettings) -> None:
    from nanorocks_ros.studies.batch.batch_analysis import merged_notes

    frames = sum(result.summary['frames'] for result in batch.results)
    seconds = sum(result.summary['seconds'] for result in batch.results)
    print(f'{counted(len(batch.results), "recording")}, {frames} frames, {seconds:.0f} s')
    for text in merged_notes(batch.results):
        print(text)
    if any(tray.restitution is not None for tray in combined_results.trays.values()):
        print(f'priors: {priors_in_words(prior)}')
    for number, tray in sorted(combined_results.trays.items()):
        cycles, recordings = counted(tray.cycles, 'cycle'), counted(tray.recordings, 'recording')
        print(f'tray {number}: {cycles} of {recordings}')
        for text in _tray_lines(tray):
            print(f'  {text}')


def _tray_lines(tray: TrayMeans) -> list[str]:
    from nanorocks_ros.records import headline_in_words
    from nanorocks_ros.studies.batch.means_json import means_as_json

    values = means_as_json(tray)

    def text(name: str, factor: float = 1.0, digits: int = 4) -> str:
        value, low, high = (values[f'{name}{suffix}'] for suffix in ('', '_lower', '_upper'))
        return _interval((value, low, high), factor, digits)

    lines = []
    restitution = tray.restitution
    if restitution is not None and values['restitution_lower'] is not None:
        walls = f', walls {text("wall_restitution")}' if values['wall_restitution'] else ''
        count = values['cycles_read']
        lines.append(f'{counted(count, "cycle")} together: COR {text("restitution")}{walls}')
        source = headline_in_words(
            restitution.headline,
            restitution.tension,
            restitution.wall_friction,
            restitution.quality,
        )
        lines.append(f'from {source}')
        if restitution.speed_dependent:
            lines += [
                f'{kind}: exponent of 1 - restitution '
                f'{text(f"{prefix}restitution_exponent", 1.0, 2)}; '
                f'restitution {text(f"{prefix}impact_restitution", 1.0, 3)} at '
                f'{1e3 * values[f"{prefix}impact_speed"]:.2f} mm/s'
                for kind, prefix in (('beads', ''), ('walls', 'wall_'))
                if values[f'{prefix}restitution_exponent'] is not None
            ]
    if tray.left_out:
        lines.append(
            f'the decays of {counted(tray.left_out, "cycle")} left out of the restitutions, since '
            'contacts contradict them; pass --include-inconsistent to count'
        )
    for name, label, factor, unit in (
        ('cycle_restitution', 'COR of a cycle', 1.0, ''),
        ('paper_restitution', "COR by the paper's closed form", 1.0, ''),
        ('initial_speed', 'v0', 1e3, ' mm/s'),
        ('peak_speed', 'peak speed', 1e3, ' mm/s'),
        ('haff_time', 'tau', 1.0, ' s'),
    ):
        mean = tray.means[name]
        if mean.cycles:
            spread = f', scatter {factor * mean.scatter:.3g}' if mean.cycles > 1 else ''
            lines.append(f'{label}: mean {factor * mean.mean:.4g}{unit}{spread}')
    if values['sticking_status'] is not None:
        status = values['sticking_status'].replace('_', ' ')
        lines.append(f'sticking speed [mm/s]: {text("sticking_speed", 1e3, 2)} ({status})')
    return lines


def _interval(values: tuple[float | None, ...], factor: float, digits: int) -> str:
    middle, low, high = (
        'unknown' if value is None else f'{factor * value:.{digits}f}' for value in values
    )
    return f'{middle} [{low}, {high}]'
