"""Logarithm of a sum of exponentials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def log_sum(
    logs: NDArray[np.float64], weights: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Logarithm of the sum over the first axis of weights times exp(logs), without overflow.

    Parameters
    ----------
    logs : ndarray (m, n)
    weights : ndarray (m,), optional
        Positive; default 1.
    """
    most = logs.max(axis=0)
    # All terms 0: nothing to subtract.
    most[np.isneginf(most)] = 0.0
    terms = np.exp(logs - most)
    total = terms.sum(axis=0) if weights is None else weights @ terms
    with np.errstate(divide='ignore'):
        return np.asarray(most + np.log(total))
