"""One process that takes numbers of mutations and answers with their outcomes, line by line.

A process of its own, since a mutation may hang, fill the memory or end the process.
"""

from __future__ import annotations

import json
import sys
import tempfile
import traceback
from pathlib import Path

from benchmarks.fuzzing.outcomes import MEMORY, TRACEBACK, Outcome
from benchmarks.fuzzing.targets import target_of

MOST_MEMORY = 1 << 30
"""Largest memory of the process, [bytes]."""


def outcome_of(target: object, number: int) -> Outcome:
    """Run one mutation; anything that is not one clear line counts as a traceback."""
    try:
        outcome: Outcome = target.run(number)  # type: ignore[attr-defined]
    except MemoryError as error:
        return Outcome(MEMORY, '', '', repr(error))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return Outcome(TRACEBACK, '', '', f'{error!r} at {last.filename}:{last.lineno}'[:300])
    return outcome._replace(name=MEMORY) if _peak() > MOST_MEMORY else outcome


def _peak() -> int:
    """Largest memory of this program so far, [bytes]; that of resource counts its parent's too."""
    status = Path('/proc/self/status').read_text('ascii')
    (line,) = (line for line in status.splitlines() if line.startswith('VmHWM:'))
    return 1024 * int(line.split()[1])


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        target = target_of(sys.argv[1], Path(folder))
        print(json.dumps('ready'), flush=True)
        for line in sys.stdin:
            print(json.dumps(outcome_of(target, int(line))), flush=True)


if __name__ == '__main__':
    main()
