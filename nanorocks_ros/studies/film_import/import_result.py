"""Result of an import of films: counts, time range, notices and provenance.

Tested by ``test/studies/film_import/test_import_each.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.recordings.film.duplicate_frames import DuplicateFilter
    from nanorocks_ros.recordings.film.film_source import Film
    from nanorocks_ros.recordings.film.timestamp_repair import RepairCounts


@dataclass(slots=True, kw_only=True)
class ImportResult:
    """Result of an import of films into one bag.

    Parameters
    ----------
    bag : Path
    frames : int
        Number of frames in the bag.
    duplicates_dropped : int
        Number of duplicate frames that were removed.
    damaged : int
        Number of frames that could not be used.
    start_ns, end_ns : int, [ns]
        Stamps of the first and the last frame.
    notices : list of str
        Notices for the user.
    provenance : dict of str to str
        Metadata of the bag.
    """

    bag: Path
    frames: int = 0
    duplicates_dropped: int = 0
    damaged: int = 0
    start_ns: int = 0
    end_ns: int = 0
    notices: list[str] = field(default_factory=list)
    provenance: dict[str, str] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Time between the first and the last frame, [s]."""
        return (self.end_ns - self.start_ns) / NS

    def outcome(self) -> dict[str, str]:
        """Metadata that is added to the bag at the end of the import."""
        return {
            'import': 'complete',
            'duplicates_dropped': str(self.duplicates_dropped),
            'damaged_frames': str(self.damaged),
            'notices': '\n'.join(self.notices),
        }

    def add_repairs(self, film: Film, repairs: RepairCounts, duplicates: DuplicateFilter) -> None:
        """Add the repaired time stamps and removed duplicates of a film, with notices."""
        self.duplicates_dropped += duplicates.dropped
        counted = (
            (duplicates.dropped, 'duplicate frames were dropped'),
            (repairs.missing, 'frames without a time stamp got one between their neighbours'),
            (repairs.reordered, 'frames were out of order and were sorted by time'),
            (repairs.replaced, 'frames with impossible time stamps got one between neighbours'),
            (
                repairs.set_back,
                'times the clock was set back; time continues from before the step',
            ),
        )
        where = film.info.path
        self.notices += [f'{where}: {count} {text}' for count, text in counted if count]
        if duplicates.still_ns > NS:
            duration = duplicates.still_ns / NS
            self.notices.append(
                f'{where}: the picture stood still for {duration:.1f} s; one frame per second '
                'was kept'
            )

    def add_damaged(self, film: Film) -> None:
        """Add the damaged and missing frames of a film, with notices."""
        self.damaged += film.damaged
        self.notices += [f'{film.info.path}: {loss}' for loss in film.losses]
        if film.damaged:
            self.notices.append(
                f'{film.info.path}: {film.damaged} frames that are damaged or of another size '
                'were skipped'
            )
