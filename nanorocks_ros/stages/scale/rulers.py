"""Rulers of the image scale, and how far two of them disagree.

Tested by ``test/stages/scale/test_scale_check.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from nanorocks_ros.records import Quality

if TYPE_CHECKING:
    from collections.abc import Sequence

TOLERANCE = 0.02
"""Relative difference that two rulers may have beside their errors."""
LARGEST = 0.05
"""Relative difference beyond which no restitution is given."""
AXES = 'columns', 'rows'
"""Names of the axes of a picture."""
# Standard errors of a difference that are left to chance: one-sided, once in 1000 for each pair.
_SIGMAS = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ruler:
    """The image scale by one ruler, over the scale of the settings.

    Parameters
    ----------
    name : str
        In words, as subject of a sentence.
    source : str
        ``told``, ``beads`` or ``walls``: rulers of one source have the same true length.
    ratio : float
        Scale by this ruler over `preprocess.pixels_per_metre`.
    error : float
        One standard error of the ratio.
    """

    name: str
    source: str
    ratio: float
    error: float


def difference(first: Ruler, second: Ruler) -> float:
    """Relative difference of two rulers."""
    return abs(math.log(first.ratio / second.ratio))


def contradict(first: Ruler, second: Ruler) -> bool:
    """Whether two rulers differ by more than their errors and the tolerance explain."""
    errors = _SIGMAS * math.hypot(first.error, second.error)
    return difference(first, second) - errors > TOLERANCE


def agree(rulers: Sequence[Ruler]) -> bool:
    """Whether no two rulers contradict each other."""
    return not any(contradict(*pair) for pair in combinations(rulers, 2))


def mean_ratio(rulers: Sequence[Ruler]) -> float:
    """Mean of the ratios, weighted by the errors."""
    weights = [1.0 / ruler.error**2 for ruler in rulers]
    total = sum(weight * ruler.ratio for weight, ruler in zip(weights, rulers, strict=True))
    return total / sum(weights)


def joined(rulers: Sequence[Ruler]) -> Ruler:
    """Several rulers that agree, as one."""
    error = math.fsum(1.0 / ruler.error**2 for ruler in rulers) ** -0.5
    return Ruler(name='', source='', ratio=mean_ratio(rulers), error=error)


def flag_of(rulers: Sequence[Ruler]) -> Quality:
    """What the largest disagreement means for the results.

    Rulers that were told are compared with each measured one, and with all of them together when
    these agree: together they are more exact.
    """
    pairs = list(combinations(rulers, 2))
    measured = [ruler for ruler in rulers if ruler.source != 'told']
    if measured and agree(measured):
        together = joined(measured)
        pairs += [(ruler, together) for ruler in rulers if ruler.source == 'told']
    differences = [difference(*pair) for pair in pairs if contradict(*pair)]
    if not differences:
        return Quality(0)
    largest = max(differences)
    return Quality.WRONG_SCALE if largest > LARGEST else Quality.DOUBTFUL_SCALE
