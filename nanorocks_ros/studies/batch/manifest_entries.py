"""The entries of the manifest of a batch: what is known of a recording and its results.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nanorocks_ros.studies.batch.batch_task import (
    BagOutcome,
)

# The folder of a batch that holds those of its recordings.
BAGS = 'bags'


@dataclass(slots=True, kw_only=True)
class Entry:
    """A recording in the manifest.

    Parameters
    ----------
    path : Path
        Absolute.
    folder : str
        Name of the folder of its results.
    outcome : BagOutcome
    """

    path: Path
    folder: str
    outcome: BagOutcome


def entry_as_json(entry: Entry) -> dict[str, Any]:
    """An entry as it stands in the manifest."""
    outcome = entry.outcome
    return {
        'bag': str(entry.path),
        'folder': f'{BAGS}/{entry.folder}',
        'state': outcome.state,
        'reason': outcome.reason,
        'content': outcome.content,
        'files': [list(file) for file in outcome.files],
    }


def entry_from_json(content: dict[str, Any]) -> Entry:
    """An entry of a manifest, which may hold anything.

    Raises
    ------
    ValueError, OverflowError, LookupError, TypeError, AttributeError
        For content that is no entry.
    """
    name = Path(content['folder']).name
    # Hidden ones are leftovers of killed workers.
    if not name or name.startswith('.') or '\0' in name + content['bag']:
        raise ValueError
    return Entry(
        path=Path(content['bag']),
        folder=name,
        outcome=BagOutcome(
            state=str(content['state']),
            reason=str(content['reason']),
            content=str(content['content']),
            files=tuple(
                (str(a), int(b), int(c), int(d), int(e)) for a, b, c, d, e in content['files']
            ),
        ),
    )
