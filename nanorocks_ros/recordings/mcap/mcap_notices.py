"""Damage of an MCAP file in sentences.

Tested by ``test/recordings/mcap/test_mcap_scan.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nanorocks_ros.recordings.mcap.mcap_index import McapIndex


def damage_notices(index: McapIndex) -> list[str]:
    """What was found to be wrong so far, without the name of the file."""
    notices = [
        *_lost(index),
        *(f'a part was left out: {refusal}' for refusal in sorted(index.refusals)),
    ]
    if index.invalid_times:
        count = sum(index.invalid_times.values())
        notices.append(f'{count} messages with impossible time stamps were skipped')
    if index.unverified:
        count = sum(index.unverified.values())
        notices.append(
            f'{count} messages are from {_blocks(len(index.unverified))} whose checksum or length '
            'is wrong; single messages of them may be wrong'
        )
    if index.repaired:
        notices.append(f'{_blocks(len(index.repaired))} with damaged heads were read all the same')
    if index.disagreements:
        notices.append(f'{_blocks(len(index.disagreements))} differ from their message indexes')
    if index.catalogue.contradictions:
        notices.append(
            'statements of a topic or a type that contradict an earlier one: '
            f'{len(index.catalogue.contradictions)}'
        )
    if index.wrong_checksum:
        notices.append('its data differ from their checksum; single messages may be wrong')
    if index.bytes_behind:
        notices.append(
            f'the last {index.bytes_behind} bytes stand behind its end and were not read; if they '
            f'are another recording, `tail -c {index.bytes_behind}` of the file copies it'
        )
    return [*notices, *_miscount(index)]


def _lost(index: McapIndex) -> list[str]:
    if not index.lost:
        return []
    blocks, lost = len(index.lost), sum(index.lost.values())
    verb = 'was' if blocks == 1 else 'were'
    return [f'{_blocks(blocks)} {verb} skipped, at least {lost} messages are lost']


def _blocks(count: int) -> str:
    return f'{count} damaged {"block" if count == 1 else "blocks"}'


def _miscount(index: McapIndex) -> list[str]:
    if not index.miscount:
        return []
    unknown = ''
    if index.unknown_records:
        unknown = f'; {index.unknown_records} records of unknown kinds were skipped'
    present = (index.stated or 0) - index.known_losses - index.miscount
    return [f'its statistics count {index.stated} messages, {present} are there{unknown}']
