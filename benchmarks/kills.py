"""Kills at random instants: what was written is readable, and the same command finishes the job.

``python -m benchmarks kills --count 200 --journal kills.jsonl`` runs the kills that the journal
lacks and prints the table of all of them, so it may be interrupted and called again.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import journal
from benchmarks.fuzzing.mutations import generator_of
from benchmarks.killed_jobs import JOBS, ORDER, Job

if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str]) -> int:
    """Run and print; 1 if anything was lost."""
    parser = argparse.ArgumentParser(prog='benchmarks kills', description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=20, help='kills of all jobs together')
    parser.add_argument('--journal', help='file of outcomes, to which this call adds')
    parser.add_argument('--keep', help='folder for outputs that are not as they should be')
    options = parser.parse_args(arguments)
    done = journal.read(options.journal)
    jobs: dict[str, Job] = {}
    try:
        with tempfile.TemporaryDirectory() as folder:
            for number in range(options.count):
                if number in done:
                    continue
                name = ORDER[number % len(ORDER)]
                if name not in jobs:
                    jobs[name] = JOBS[name](Path(folder) / name)
                done[number] = [name, *jobs[name].kill(generator_of('kills', number))]
                if options.keep and not done[number][1]:
                    (Path(options.keep) / str(number)).mkdir(parents=True)
                    jobs[name].keep(Path(options.keep) / str(number))
                journal.note(options.journal, number, done[number])
    except KeyboardInterrupt:
        print('interrupted; the same command continues', file=sys.stderr)
    print(table(list(done.values())))
    return int(not all(good for _, good, _ in done.values()))


def table(outcomes: list[list]) -> str:
    """Kills of each job, how many left everything in order, and the largest loss."""
    lines = [
        '| job | kills | resumed bit-identical, or lost at most 2 s | others | largest loss [s] |',
        '| --- | --- | --- | --- | --- |',
    ]
    for name in JOBS:
        own = [(good, loss) for job, good, loss in outcomes if job == name]
        if own:
            good = sum(each for each, _ in own)
            losses = [loss for _, loss in own if loss is not None]
            loss = f'{max(losses):.2f}' if losses else ''
            lines.append(f'| {name} | {len(own)} | {good} | {len(own) - good} | {loss} |')
    return '\n'.join(lines)
