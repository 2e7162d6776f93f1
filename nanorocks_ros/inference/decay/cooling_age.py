"""How long a gas has cooled when its tray comes to rest.

A tray that swings on its springs after the shaking event drives its gas weakly, along the floor
alone. The gas loses its vertical speeds, shares its energy among the species and gathers in crowds
meanwhile, as at rest; it only stays somewhat faster. So it is an old gas when the tray has come to
rest, not one that has just been shaken: taken for that, it seems to lose too little energy, and
beads of 0.75 read 0.96.

A gas that is as old as one at rest and faster by a factor k behaves as one that began to cool
later, at 1 - 1/k of the time since the shaking event. `python -m benchmarks swinging_trays`
measures these shares.

Tested by ``test/inference/decay/test_cooling_age.py``.
"""

from __future__ import annotations

from nanorocks_ros.records import Measured

# Share of the time until the tray has come to rest by which the gas seems to begin to cool later,
# and its standard deviation over trays, restitutions and swings.
_YOUNGER, _SPREAD = 0.08, 0.08


def cooling_age(rest: float) -> Measured:
    """Time for which the gas has cooled when the tray has come to rest, [s].

    Parameters
    ----------
    rest : float, [s], >= 0
        From the shaking event until the tray has come to rest.

    Returns
    -------
    Measured, [s]
        With its standard deviation; 0 for a tray that did not swing.
    """
    return Measured((1.0 - _YOUNGER) * rest, _SPREAD * rest)
