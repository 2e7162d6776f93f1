"""Outcomes of numbered runs in a file, so that an interrupted benchmark continues."""

from __future__ import annotations

import json
from pathlib import Path


def read(path: str | None) -> dict[int, list]:
    """The outcomes by number; a line that was cut is left out."""
    done: dict[int, list] = {}
    if path and Path(path).is_file():
        for line in Path(path).read_text('utf-8').splitlines():
            if line.endswith(']'):
                number, *outcome = json.loads(line)
                done[number] = outcome
    return done


def note(path: str | None, number: int, outcome: list) -> None:
    """Add an outcome, if there is a journal."""
    if path:
        with Path(path).open('a', encoding='utf-8') as stream:
            stream.write(f'\n{json.dumps([number, *outcome])}')
