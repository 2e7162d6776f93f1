"""A number with its standard error, and propagation of errors to first order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Callable

# Step of the central differences, as a fraction of the error.
_STEP = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A number and its standard error.

    Parameters
    ----------
    value : float
    error : float, >= 0
        0: known exactly.

    Raises
    ------
    ConfigurationError
        When the value is not finite, or the error is negative or not finite.
    """

    value: float
    error: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and math.isfinite(self.error) and self.error >= 0.0):
            raise ConfigurationError(
                'estimate', f'{self.value!r} ± {self.error!r}', 'give finite numbers, error >= 0'
            )


def propagated(relation: Callable[..., float], **inputs: Estimate | float) -> Estimate:
    """The value of a relation at some inputs, with their errors to first order.

    Derivatives are central differences over a twentieth of each error; the inputs are
    independent.

    Parameters
    ----------
    relation : callable
        Takes the inputs by name.
    **inputs : Estimate or float
        A plain number has no error.

    Raises
    ------
    NanorocksError
        Whatever the relation raises, at the inputs or next to them.
    """
    values = {k: item.value if isinstance(item, Estimate) else item for k, item in inputs.items()}
    variance = 0.0
    for name, item in inputs.items():
        if not isinstance(item, Estimate) or item.error == 0.0:
            continue
        step = _STEP * item.error
        up = relation(**{**values, name: item.value + step})
        down = relation(**{**values, name: item.value - step})
        variance += ((up - down) / (2.0 * _STEP)) ** 2
    return Estimate(value=relation(**values), error=math.sqrt(variance))
