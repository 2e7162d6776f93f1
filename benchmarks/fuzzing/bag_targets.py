"""Damaged bags: read them, and salvage them beside the `mcap` library."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from benchmarks.fuzzing.bag_layouts import LAYOUTS, SQLITE, write_bag
from benchmarks.fuzzing.mutations import damaged, generator_of
from benchmarks.fuzzing.outcomes import CLEAN_ERROR, NO_CHECKSUM, SAME, SILENT, TOLD, Outcome
from benchmarks.fuzzing.recoverable import found_by_library, found_record_by_record
from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.salvage import salvage

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.fuzzing.bag_layouts import Layout


class Bags:
    """Bags of all layouts, one after the other; a third has damage in ``metadata.yaml``, too."""

    kind = 'bags'
    layouts = (*LAYOUTS, SQLITE)

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files = {
            layout: write_bag(folder / _slug(layout), layout) for layout in self.layouts
        }
        self._contents = {layout: file.read_bytes() for layout, file in self._files.items()}
        self._intact = {layout: _read(file) for layout, file in self._files.items()}

    def run(self, number: int) -> Outcome:
        layout = self.layouts[number % len(self.layouts)]
        random = generator_of(self.kind, number)
        content, damage = damaged(self._contents[layout], random)
        file = self._files[layout]
        file.write_bytes(content)
        group = f'{"with" if layout.checksums else "without"} checksums'
        try:
            bag = open_bag(file)
            messages = [(m.topic, m.type, m.log_time_ns, m.cdr) for m in bag.messages()]
            for message in bag.messages():
                bag.deserialize(message)
                break
            told = not bag.complete or bool(bag.notices)
        except NanorocksError as error:
            return Outcome(CLEAN_ERROR, group, damage, str(error))
        if told:
            return Outcome(TOLD, group, damage)
        difference = SILENT if layout.checksums else NO_CHECKSUM
        same = messages == self._intact[layout]
        return Outcome(SAME if same else difference, group, f'{layout.name}: {damage}')


class Salvage:
    """MCAP files of seven layouts: what a salvage recovers of what can be recovered."""

    kind = 'salvage'

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._contents = {}
        self._intact = {}
        for layout in LAYOUTS:
            file = write_bag(folder / _slug(layout), layout)
            self._contents[layout] = file.read_bytes()
            self._intact[layout] = {(stamp, cdr) for _, _, stamp, cdr in _read(file)}

    def run(self, number: int) -> Outcome:
        layout = LAYOUTS[number % len(LAYOUTS)]
        content, damage = damaged(self._contents[layout], generator_of(self.kind, number))
        source, target = self._folder / 'source.mcap', self._folder / 'salvaged'
        source.write_bytes(content)
        shutil.rmtree(target, ignore_errors=True)
        intact = self._intact[layout]
        error, notices = '', ()
        recovered: list[tuple[int, bytes]] = []
        try:
            notices = salvage(source, target, lambda *_: None).notices
            recovered = [(m.log_time_ns, m.cdr) for m in open_bag(target).messages()]
        except NanorocksError as refusal:
            error = str(refusal)
        by_library = found_by_library(content, intact)
        by_records = found_record_by_record(content, intact)
        recoverable = by_library | by_records
        ours = set(recovered) & intact
        outcome = Outcome(
            CLEAN_ERROR if error else TOLD if notices else SAME,
            layout.name,
            damage,
            error,
            numbers={
                'recovered': len(ours),
                'of_recoverable': len(ours & recoverable),
                'recoverable': len(recoverable),
                'library': len(by_library),
            },
        )
        wrong = set(recovered) != intact or len(recovered) != len(intact)
        if outcome.name == SAME and wrong:
            return outcome._replace(name=SILENT if layout.checksums else NO_CHECKSUM)
        return outcome


def _slug(layout: Layout) -> str:
    return layout.name.replace(' ', '_').lower()


def _read(file: Path) -> list[tuple[str, str, int, bytes]]:
    bag = open_bag(file)
    messages = [(m.topic, m.type, m.log_time_ns, m.cdr) for m in bag.messages()]
    assert bag.complete, bag.notices
    return messages
