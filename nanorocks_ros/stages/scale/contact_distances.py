"""The scale by the distances at which equal beads collide, as the camera sees them from above.

Two spheres of diameter d touch at a projected distance of ``d sqrt(1 - (z / d)^2)``, with z the
difference of their heights. Heights are uniform over ``H = h - d`` in a tray of height h, so
``p(z)`` falls as ``1 - z / H``: in a flat tray distances pile up just below d.

Tested by ``test/stages/scale/test_scale_check.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Distances over the sum of the radii that are used, inside those that count as a contact.
_USED = 0.91, 1.04
# Largest room above a bead, in diameters, at which distances still pile up.
_FLAT = 0.6
_LEAST_CONTACTS = 12
# Share of pairs that did not touch, but were deflected by others at the same time.
_OTHERS = 0.05
# Least error of a distance, as a share of it: unknown bias of places beside another bead.
_LEAST_SPREAD = 0.004
# Of the scale: heights are not quite uniform.
_MODEL_ERROR = 0.004
# Ratios of the scales that are tried.
_RATIOS = np.linspace(0.86, 1.14, 141)
# Quadrature over the height difference, in units of the room.
_HEIGHTS = (np.arange(48) + 0.5) / 48.0


def is_flat(diameter: float, height: float) -> bool:
    """Whether beads of this diameter can hardly be above one another, [m]."""
    return height - diameter < _FLAT * diameter


def contact_scale(
    distances: NDArray[np.float64], errors: NDArray[np.float64], room: float
) -> tuple[float, float] | None:
    """Scale over that of the settings, and its error; None with too few contacts.

    Parameters
    ----------
    distances : ndarray (n,)
        Projected, at the contact, over the sum of the radii that the beads should have.
    errors : ndarray (n,)
        Of the distances.
    room : float
        Height of the tray less the diameter, in diameters.
    """
    used = (distances > _USED[0]) & (distances < _USED[1])
    if used.sum() < _LEAST_CONTACTS:
        return None
    spread = np.hypot(errors[used], _LEAST_SPREAD)[:, np.newaxis]
    distances = distances[used][:, np.newaxis]
    heights = room * _HEIGHTS
    # Velocities are mostly horizontal: beads hit each other in proportion to their distance.
    projected = np.sqrt(1.0 - heights**2)
    weights = (1.0 - _HEIGHTS) * projected
    weights /= weights.sum()
    grid = np.linspace(*_USED, 66)[:, np.newaxis]
    usual = float(np.median(spread))
    width = _USED[1] - _USED[0]
    log_likelihood = np.empty(_RATIOS.size)
    for k, ratio in enumerate(_RATIOS):
        places = ratio * projected
        density = _normal((distances - places) / spread) / spread @ weights
        seen = float((_normal((grid - places) / usual) / usual @ weights).mean()) * width
        # Where hardly a contact of this scale would be used, any distance is chance.
        mixed = (1.0 - _OTHERS) * density / max(seen, 0.05) + _OTHERS / width
        log_likelihood[k] = np.log(mixed).sum()
    probability = np.exp(log_likelihood - log_likelihood.max())
    probability /= probability.sum()
    mean = float(probability @ _RATIOS)
    variance = float(probability @ (_RATIOS - mean) ** 2)
    return mean, float(np.hypot(np.sqrt(variance), _MODEL_ERROR))


def _normal(deviations: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.exp(-0.5 * deviations**2) / np.sqrt(2.0 * np.pi))
