"""Theory of hard spheres; lengths in diameters d, masses in m, energies in kT = m v^2.

v is the thermal speed, the root mean square of one component of the velocity. A density is a
number density times d^3.

References
----------
[CS] Carnahan, Starling 1969, J. Chem. Phys. 51, 635, doi:10.1063/1.1672048.
[EW] Erpenbeck, Wood 1991, Phys. Rev. A 43, 4254, doi:10.1103/PhysRevA.43.4254.
[KLM] Kolafa, Labik, Malijevsky 2004, Phys. Chem. Chem. Phys. 6, 2335, doi:10.1039/B402792B.
[L] Lue 2005, J. Chem. Phys. 122, 044513, doi:10.1063/1.1834498.
[NE] van Noije, Ernst 1998, Granular Matter 1, 57, doi:10.1007/s100350050009.
[S] Speedy 1987, Mol. Phys. 62, 509, doi:10.1080/00268978700102371.
[SH] Sigurgeirsson, Heyes 2003, Mol. Phys. 101, 469, doi:10.1080/0026897021000037717.
[YH] Yeh, Hummer 2004, J. Phys. Chem. B 108, 15873, doi:10.1021/jp0477147.

The DOIs of [EW], [KLM], [NE] and [SH] are from memory; the numbers of [KLM] and the constant of
[YH] are as other programs use them, a2 of [NE] and others marked so below are from memory too.
"""

from __future__ import annotations

import math

import numpy as np

# Mean free time at a density of 0.5, from molecular dynamics, good to 1 % [L].
LUE_MEAN_FREE_TIME = 0.13031

# Sum over the images of a periodic cube, in units of its side [YH].
_CUBE = 2.837297
# Factor of all Sonine polynomials on the self-diffusion of hard spheres; from memory,
# Chapman, Cowling 1970.
_ALL_SONINE = 1.01896
# Powers of phi / (1 - phi) in the compressibility factor, [KLM].
_KLM = {
    0: 1.0,
    1: 4.0,
    2: 6.0,
    3: 2.3647684,
    4: -0.8698551,
    5: 1.1062803,
    6: -1.1014221,
    7: 0.66605866,
    8: -0.03633431,
    10: -0.20965164,
    14: 0.10555569,
    22: -0.00872380,
}
_STEP = 1e-4


def filling(density):
    """Filling factor."""
    return math.pi / 6.0 * density


def contact_value(density):
    """Pair distribution at contact, [CS]."""
    phi = filling(density)
    return (1.0 - 0.5 * phi) / (1.0 - phi) ** 3


def exact_contact_value(density):
    """Pair distribution at contact, [KLM]: molecular dynamics, good to about 1e-4."""
    phi = filling(density)
    x = phi / (1.0 - phi)
    return (sum(factor * x**power for power, factor in _KLM.items()) - 1.0) / (4.0 * phi)


def pressure(density):
    """Pressure in kT / d^3, [CS]."""
    return density * (1.0 + 4.0 * filling(density) * contact_value(density))


def collision_rate(density):
    """Collisions of one bead in a time d / v, after Enskog with the contact value of [CS]."""
    return 4.0 * math.sqrt(math.pi) * density * contact_value(density)


def few_beads_ratio(density, n):
    """Collision rate of n beads in a periodic box over that of infinitely many; to order 1/n.

    Speeds: with one energy and no momentum the mean relative speed is larger by 1/12n than
    Maxwell's. Places: the free energy of n beads is larger by kT/2 ln S than their part of
    infinitely many, S = kT d(density)/d(pressure), and the pressure follows from it.
    """
    step = _STEP
    slope = math.log(_fluctuation(density + step) / _fluctuation(density - step)) / (2.0 * step)
    crowding = 0.5 * density * slope / (pressure(density) / density - 1.0)
    return 1.0 + (1.0 / 12.0 + crowding) / n


def _fluctuation(density):
    return 2.0 * _STEP / (pressure(density + _STEP) - pressure(density - _STEP))


def enskog_diffusion(density):
    """Self-diffusion in d v after Enskog, all Sonine polynomials."""
    return _ALL_SONINE * 0.375 / math.sqrt(math.pi) / (density * contact_value(density))


def enskog_viscosity(density):
    """Shear viscosity in m v / d^2 after Enskog, first Sonine polynomial."""
    volume = 2.0 * math.pi / 3.0 * density
    g = contact_value(density)
    return 0.3125 / math.sqrt(math.pi) * (1.0 / g + 0.8 * volume + 0.7614 * volume**2 * g)


def missing_diffusion(density, diffusion, n, lags):
    """Finite-size deficit of the self-diffusion of n beads in a periodic cube between two lags.

    The velocities of a bead stay correlated through the slow shear of the gas about it, which
    decays at the rate (viscosity / density + diffusion) k^2. A cube has only some of its waves:
    [YH], where diffusion is neglected, which in a gas is no small part. And at finite lags the
    correlations have not decayed in a large cube: the sum over its longest waves.
    """
    side = (n / density) ** (1.0 / 3.0)
    spread = enskog_viscosity(density) / density + diffusion
    images = _CUBE / (6.0 * math.pi * side * spread * density)
    numbers = np.indices((9, 9, 9)).reshape(3, -1) - 4
    squares = np.sum(numbers[:, np.any(numbers != 0, axis=0)] ** 2, axis=0)
    rates = spread * (2.0 * math.pi / side) ** 2 * squares
    decays = np.exp(-rates * lags[0]) - np.exp(-rates * lags[1])
    later = 2.0 / (3.0 * n) * np.sum(decays / (rates**2 * (lags[1] - lags[0])))
    return images + float(later)


def speedy_diffusion(density):
    """Self-diffusion of about 500 beads in a periodic cube, in d v, [S].

    Its dilute limit and the zero at 1.09 are in its abstract; that it fits some 500 beads, in
    that of [SH]. The polynomial is from memory.
    """
    dilute = 0.375 / math.sqrt(math.pi) / density
    return dilute * (1.0 - density / 1.09) * (1.0 + density**2 * (0.4 - 0.83 * density**2))


def erpenbeck_wood_ratio(density):
    """Self-diffusion of infinitely many beads over Enskog's, fitted by [EW]; from memory."""
    x = density / math.sqrt(2.0)
    return 1.0 + 0.05403172 * x + 6.3656111 * x**2 - 10.942486 * x**3


def second_sonine(restitution):
    """Second Sonine coefficient a2 of a gas that cools homogeneously, [NE]."""
    e = restitution
    return 16.0 * (1.0 - e) * (1.0 - 2.0 * e * e) / (81.0 - 17.0 * e + 30.0 * e * e * (1.0 - e))


def haff_coefficient(restitution):
    """C of Haff's law, 1 / (v0 tau) = C (1 - e^2) pi d^2 n g with v0 the mean speed.

    sqrt(2)/6 = 0.2357 with Maxwell's speeds. Those of a cooling gas differ: it cools faster by
    1 + 3/16 a2, and its mean speed at one temperature is 1 - a2/8 of Maxwell's, [NE].
    """
    return math.sqrt(2.0) / 6.0 * (1.0 + 0.3125 * second_sonine(restitution))
