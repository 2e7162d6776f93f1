"""Logarithms of sums of what is known by its logarithm."""

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
        Positive; all 1 where not given.
    """
    most = logs.max(axis=0)
    # Where all are impossible nothing is to be taken off.
    most[np.isneginf(most)] = 0.0
    terms = np.exp(logs - most)
    total = terms.sum(axis=0) if weights is None else weights @ terms
    with np.errstate(divide='ignore'):
        return np.asarray(most + np.log(total))
