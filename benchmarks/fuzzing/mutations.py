"""Seeded damage of bytes, as disks, cables, editors and attackers do it."""

from __future__ import annotations

import numpy as np

_INTERESTING = (0, 1, 0x7F, 0x80, 0xFF)


def generator_of(kind: str, number: int) -> np.random.Generator:
    """The random numbers of one mutation: the same on every machine."""
    return np.random.default_rng([*kind.encode(), number])


def damaged(content: bytes, random: np.random.Generator) -> tuple[bytes, str]:
    """Damage in one to three places, and its description.

    Parameters
    ----------
    content : bytes
        Not empty.
    random : numpy.random.Generator
    """
    names = []
    for _ in range(int(random.choice([1, 1, 1, 2, 3]))):
        damage = _DAMAGES[int(random.integers(len(_DAMAGES)))]
        content = damage(content, random)
        names.append(damage.__name__.strip('_'))
        if not content:
            break
    return content, '+'.join(names)


def _place(content: bytes, random: np.random.Generator) -> int:
    return int(random.integers(len(content)))


def _part(content: bytes, random: np.random.Generator) -> tuple[int, int]:
    start = _place(content, random)
    length = int(2 ** random.uniform(0, np.log2(max(2, len(content) / 3))))
    return start, min(len(content), start + length)


def _flip_bit(content: bytes, random: np.random.Generator) -> bytes:
    place = _place(content, random)
    return (
        content[:place]
        + bytes([content[place] ^ 1 << int(random.integers(8))])
        + content[place + 1 :]
    )


def _set_byte(content: bytes, random: np.random.Generator) -> bytes:
    place = _place(content, random)
    value = int(random.choice([*_INTERESTING, int(random.integers(256))]))
    return content[:place] + bytes([value]) + content[place + 1 :]


def _set_number(content: bytes, random: np.random.Generator) -> bytes:
    """Overwrite 4 or 8 bytes, as a length, by a small or a huge number."""
    place, size = _place(content, random), int(random.choice([4, 8]))
    number = int(2 ** random.uniform(0, 8 * size - 0.001))
    raw = number.to_bytes(size, 'little')[: len(content) - place]
    return content[:place] + raw + content[place + len(raw) :]


def _zero(content: bytes, random: np.random.Generator) -> bytes:
    start, end = _part(content, random)
    return content[:start] + bytes(end - start) + content[end:]


def _noise(content: bytes, random: np.random.Generator) -> bytes:
    start, end = _part(content, random)
    return content[:start] + random.bytes(end - start) + content[end:]


def _delete(content: bytes, random: np.random.Generator) -> bytes:
    start, end = _part(content, random)
    return content[:start] + content[end:]


def _insert(content: bytes, random: np.random.Generator) -> bytes:
    start, end = _part(content, random)
    return content[:start] + random.bytes(end - start) + content[start:]


def _repeat(content: bytes, random: np.random.Generator) -> bytes:
    start, end = _part(content, random)
    return content[:end] + content[start:]


def _swap(content: bytes, random: np.random.Generator) -> bytes:
    (a, b), c = _part(content, random), _place(content, random)
    if c < b:
        return content
    d = min(len(content), c + b - a)
    return content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def _cut(content: bytes, random: np.random.Generator) -> bytes:
    return content[: _place(content, random)]


def _append(content: bytes, random: np.random.Generator) -> bytes:
    start, end = _part(content, random)
    return content + (bytes(end - start) if random.integers(2) else random.bytes(end - start))


_DAMAGES = (
    _flip_bit,
    _flip_bit,
    _set_byte,
    _set_number,
    _set_number,
    _zero,
    _noise,
    _delete,
    _insert,
    _repeat,
    _swap,
    _cut,
    _append,
)
