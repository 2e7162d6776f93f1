"""Hostile input: seeded damage of bags, films, YAML, results and requests, and what it does.

``python -m benchmarks fuzz --count 5000 --journal fuzz.jsonl`` runs the mutations that the
journal lacks and prints the table of all of them, so it may be interrupted and called again.
``--kind`` and ``--number`` run one mutation again.
"""

from __future__ import annotations

import argparse
import json
import select
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.fuzzing.outcomes import BAD, CLASSES, HANG, TRACEBACK, Outcome
from benchmarks.fuzzing.targets import KINDS, SHARES, target_of
from benchmarks.fuzzing.worker import outcome_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

PATIENCE_S = 20.0
"""A mutation that takes longer counts as a hang."""

_START_S = 120.0
_EXIT_INTERRUPTED = 130


def main(arguments: Sequence[str]) -> int:
    """Run and print; 1 if any mutation ended badly."""
    parser = argparse.ArgumentParser(prog='benchmarks fuzz', description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=250, help='mutations of all kinds together')
    parser.add_argument('--journal', help='file of outcomes, to which this call adds')
    parser.add_argument('--kind', choices=KINDS, help='only this kind')
    parser.add_argument('--number', type=int, help='run this mutation of --kind alone, here')
    options = parser.parse_args(arguments)
    if options.number is not None and options.kind:
        with tempfile.TemporaryDirectory() as folder:
            print(outcome_of(target_of(options.kind, Path(folder)), options.number))
        return 0
    outcomes = _read(options.journal)
    try:
        for kind, number in wanted(options.count, options.kind, outcomes):
            _extend(outcomes, kind, number, options.journal)
    except KeyboardInterrupt:
        print('interrupted; the same command continues', file=sys.stderr)
        return _EXIT_INTERRUPTED
    finally:
        _Worker.stop_all()
        print(table(outcomes))
    return int(any(outcome.name in BAD for outcome in outcomes.values()))


Outcomes = dict[tuple[str, int], Outcome]
"""By kind and number of the mutation."""


def wanted(count: int, kind: str | None, done: Outcomes) -> Iterator[tuple[str, int]]:
    """The mutations that are still to be run: of each kind those from 0 on."""
    total = sum(SHARES.values())
    for name, share in SHARES.items():
        if kind in (None, name):
            number = count if kind else -(-count * share // total)
            yield from ((name, k) for k in range(number) if (name, k) not in done)


def _read(journal: str | None) -> Outcomes:
    outcomes: Outcomes = {}
    if journal and Path(journal).is_file():
        for line in Path(journal).read_text('utf-8').splitlines():
            # The last line may be cut short.
            if line.endswith(']'):
                kind, number, *outcome = json.loads(line)
                outcomes[kind, number] = Outcome(*outcome)
    return outcomes


def _extend(outcomes: Outcomes, kind: str, number: int, journal: str | None) -> None:
    outcome = _Worker.of(kind).ask(number)
    outcomes[kind, number] = outcome
    if journal:
        # The line break comes first: a last line that was cut short stays a line of its own.
        with Path(journal).open('a', encoding='utf-8') as stream:
            stream.write(f'\n{json.dumps([kind, number, *outcome])}')
    if sys.stderr.isatty():
        print(f'\r{kind} {number} ', end='', file=sys.stderr, flush=True)


class _Worker:
    """A process that runs mutations of one kind; a new one follows one that hangs or ends."""

    _all: dict[str, _Worker] = {}  # noqa: RUF012  # one for each kind

    def __init__(self, kind: str) -> None:
        self.kind = kind
        command = [sys.executable, '-m', 'benchmarks.fuzzing.worker', kind]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        if self._answer(_START_S) != 'ready':
            raise RuntimeError(f'no worker for {kind}')

    @classmethod
    def of(cls, kind: str) -> _Worker:
        if kind not in cls._all:
            cls.stop_all()
            cls._all[kind] = cls(kind)
        return cls._all[kind]

    @classmethod
    def stop_all(cls) -> None:
        for worker in cls._all.values():
            worker._process.kill()
            worker._process.communicate()
        cls._all.clear()

    def ask(self, number: int) -> Outcome:
        assert self._process.stdin is not None
        self._process.stdin.write(f'{number}\n'.encode())
        self._process.stdin.flush()
        answer = self._answer(PATIENCE_S)
        if not isinstance(answer, str):
            outcome = Outcome(*answer)
            if outcome.name in BAD:
                _Worker.stop_all()
            return outcome
        _Worker.stop_all()
        return Outcome(HANG if answer == 'hang' else TRACEBACK, '', '', answer)

    def _answer(self, patience_s: float) -> list[str] | str:
        stream = self._process.stdout
        assert stream is not None
        if not select.select([stream], [], [], patience_s)[0]:
            return 'hang'
        line = stream.readline()
        return json.loads(line) if line else 'the process ended'


def table(outcomes: Outcomes) -> str:
    """The classes of each kind, and what salvage recovers beside the `mcap` library."""
    counts: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for (kind, _), outcome in sorted(outcomes.items(), key=lambda item: item[0]):
        group = outcome.group if kind == 'bags' else ''
        counts[kind, group][outcome.name] += 1
    lines = [f'| input | mutations | {" | ".join(CLASSES)} |', f'|{" --- |" * (len(CLASSES) + 2)}']
    for (kind, group), counter in counts.items():
        name = f'{kind}, {group}' if group else kind
        values = ' | '.join(str(counter[each]) for each in CLASSES)
        lines.append(f'| {name} | {counter.total()} | {values} |')
    total = sum((counter for counter in counts.values()), Counter())
    values = ' | '.join(str(total[each]) for each in CLASSES)
    lines.append(f'| all | {total.total()} | {values} |')
    return '\n'.join([*lines, '', *_salvage_lines(outcomes)])


def _salvage_lines(outcomes: Outcomes) -> list[str]:
    sums: dict[str, Counter[str]] = defaultdict(Counter)
    for (kind, _), outcome in outcomes.items():
        if kind == 'salvage' and outcome.numbers:
            sums[outcome.group].update(outcome.numbers)
            sums[outcome.group]['files'] += 1
            short = outcome.numbers['of_recoverable'] < outcome.numbers['recoverable']
            sums[outcome.group]['short'] += short
    lines = [
        '| layout | files | recoverable messages | by the `mcap` library | by salvage | '
        'files with fewer | intact messages in all |',
        '| --- | --- | --- | --- | --- | --- | --- |',
    ]
    for group, numbers in sums.items():
        lines.append(
            f'| {group} | {numbers["files"]} | {numbers["recoverable"]} | {numbers["library"]} | '
            f'{numbers["of_recoverable"]} | {numbers["short"]} | {numbers["recovered"]} |'
        )
    return lines if sums else []
