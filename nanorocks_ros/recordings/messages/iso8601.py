"""Conversion between time stamps and ISO 8601 text.

Tested by ``test/studies/film_import/test_import_film.py``.
"""

from __future__ import annotations

import re
from datetime import datetime, timezone

from nanorocks_ros.records import NS


def parse_iso8601(text: str) -> int | None:
    """Parse an ISO 8601 time to nanoseconds since 1970; None if it is invalid.

    Parameters
    ----------
    text : str
        UTC if it has no time zone.
    """
    # Python 3.10 parses neither Z nor zones without a colon.
    text = re.sub(r'(T.*[+-]\d\d)(\d\d)$', r'\1:\2', text.strip().replace('Z', '+00:00'))
    seconds, _, fraction = text.partition('.')
    digits = fraction[: len(fraction) - len(fraction.lstrip('0123456789'))]
    try:
        # Nor does it parse fractions with other than three or six digits.
        time = datetime.fromisoformat(seconds + fraction[len(digits) :])
        time = time if time.tzinfo else time.replace(tzinfo=timezone.utc)
        return int(time.timestamp()) * NS + int(f'{digits:0<9.9}')
    except (ValueError, OverflowError):
        return None


def format_iso8601(stamp_ns: int) -> str:
    """Format a time as ISO 8601, in UTC, with microseconds.

    Parameters
    ----------
    stamp_ns : int, [ns]
    """
    seconds, fraction = divmod(stamp_ns, NS)
    time = datetime.fromtimestamp(seconds, tz=timezone.utc).replace(microsecond=fraction // 1000)
    return time.isoformat().replace('+00:00', 'Z')
