"""`reproduce`, killed again and again at chosen steps on files, against a run without a kill.

Each call of the chain is killed before its first step that fits a pattern, and the next continues
in the same folder. The last one runs to its end. All files are compared, hidden ones too, but for
the date in them.

``python -m benchmarks reproduction_kills`` takes some minutes: films of 3 s, without searches,
which begin where films are longer.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import cv2

from benchmarks.file_steps import difference, digests, run_until, was_killed
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan
from nanorocks_ros.studies.reproduction.reproduce_paper import reproduce

_PLAN = CampaignPlan(cycles=1, seconds=3.0)
_RUNS = 2
_STEPS = (
    r'os\.mkdir .*/campaign$',
    r'os\.rename .*nanorocks_campaign',
    r'os\.mkdir .*bouncing_001\.part$',
    r'os\.mkdir .*bouncing_001\.part/film$',
    r'os\.mkdir .*bouncing_001\.part/.*results',
    r'os\.rename .*bouncing_001\.part$',
    r'os\.mkdir .*sticking_001\.part$',
    r'os\.mkdir .*/pictures$',
    r'os\.rename .*plate\.',
    r'os\.mkdir .*/cor$',
    r'open .*nanorocks_cor_figures',
    r'os\.rename .*report\.',
)


def report() -> None:
    """Run the chain, and print each kill and what differs at the end."""
    # Threads do not survive a fork.
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / 'campaign'

        def job() -> None:
            reproduce(folder, _PLAN, Workers(processes=1), _RUNS, lambda *_: None, lambda _: None)

        code, _ = run_until(job, Path(parent))
        wanted = digests(folder)
        print(f'without a kill: exit code {code}, {len(wanted)} files and folders', flush=True)
        shutil.rmtree(folder)
        kills = 0
        for pattern in _STEPS:
            code, steps = run_until(job, Path(parent), pattern)
            kills += was_killed(code)
            last = steps[-1].replace(parent, '')
            print(
                f'- {"killed before" if was_killed(code) else "not killed at"} {last}', flush=True
            )
        code, _ = run_until(job, Path(parent))
        lines = difference(digests(folder), wanted)
        print(f'\n{kills} kills, then exit code {code}; files that differ: {len(lines)}')
        print('\n'.join(lines))
