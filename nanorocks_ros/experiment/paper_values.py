"""Values that the paper reports, with their place in it; nothing is computed here.

References
----------
[B19] Brisset, Miletich, Metzger, Rascon, Dove, Colwell: Multi-Particle Collisions in
Microgravity: Coefficient of Restitution and Sticking Threshold for Systems of Mm-Sized Particles.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

PAPER_RUNS = 178
"""Recordings, and simulated runs at each point of its search (sections 2 and 4.1)."""

PAPER_TRACKED = {
    1: (77.9574, 7.47332),
    2: (110.743, 12.1393),
    3: (104.618, 10.0224),
    4: (24.1282, 7.983),
    5: (50.4868, 4.20911),
    6: (49.2647, 6.21834),
    7: (77.4346, 6.07785),
}
"""Beads tracked, [%], and mean absolute deviation of the cycles, by tray (Table 2)."""

PAPER_PEAK_SPEED = 0.007
"""Of tray 1 after shaking, [m/s] (section 3.1.1)."""

PAPER_CHI_SQUARE = 7e-3
"""Mean deviation of the simulated from the measured decay (figure 11); not defined there."""

PAPER_CLUSTER_PEAK = 16.5
"""Largest cluster size of its cycle of tray 3, [beads] (figure 8e)."""

PAPER_RESTITUTION = 0.89
"""Of tray 1 (section 3.1.2, figure 7)."""

PAPER_RESTITUTION_RANGE = (0.55, 0.94)
"""Of all trays (abstract)."""

PAPER_NARROW_SPEED = 5e-3
"""Collision speed above which its instantaneous restitutions scatter little, [m/s] (figure 13)."""

PAPER_HIGHEST_RESTITUTION = 2.0
"""Highest of its instantaneous restitutions, of slow beads (section 4.2)."""

PAPER_WALL_RESTITUTION = 0.99
"""Of its search (section 4.1)."""

PAPER_MASS = 4.9e-6
"""Of a bead of tray 1, as printed, [kg] (section 3.1.2)."""

PAPER_ENERGY = 2.70e-10
"""T0 of figure 7, [J]."""

PAPER_HAFF_TIME = 1.64
"""Of figure 7, [s]."""

PAPER_ELLIPSE = (0.95, 2.8)
"""Axes a and b of its wall ellipse, as printed (section 4.1)."""

PAPER_ROTATION = 0.1
"""Rotation of beads that exchange energy with it, [degrees/s] (section 4.2)."""
