"""Instants as text."""

from __future__ import annotations

import re
from datetime import datetime, timezone

NS = 1_000_000_000


def instant(text: str) -> int | None:
    """An ISO 8601 instant since 1970, [ns]; None when it is none. Without a zone it is UTC."""
    # Python 3.10 reads neither Z nor zones without a colon.
    text = re.sub(r'(T.*[+-]\d\d)(\d\d)$', r'\1:\2', text.strip().replace('Z', '+00:00'))
    whole, _, fraction = text.partition('.')
    digits = fraction[: len(fraction) - len(fraction.lstrip('0123456789'))]
    try:
        # Nor does it read fractions, but of three or six digits.
        moment = datetime.fromisoformat(whole + fraction[len(digits) :])
        moment = moment if moment.tzinfo else moment.replace(tzinfo=timezone.utc)
        return int(moment.timestamp()) * NS + int(f'{digits:0<9.9}')
    except (ValueError, OverflowError):
        return None


def instant_text(stamp_ns: int) -> str:
    """An instant as ISO 8601, in UTC, to the microsecond.

    Parameters
    ----------
    stamp_ns : int, [ns]
    """
    seconds, fraction = divmod(stamp_ns, NS)
    moment = datetime.fromtimestamp(seconds, tz=timezone.utc).replace(microsecond=fraction // 1000)
    return moment.isoformat().replace('+00:00', 'Z')
