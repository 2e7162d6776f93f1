"""Settings of the fits: sticking speed, cooling window, priors of the restitution.

Tested by ``test/settings/test_setting_fields.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.settings.setting_fields import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingSettings:
    """From merges to the sticking speed."""

    measure: str = setting(
        'normal',
        'relative speed of two beads that is compared with the sticking speed: its component '
        'along the line of centres, or the total',
        choices=('normal', 'total'),
    )
    rate_error: float = setting(
        0.25, 'relative standard error of the collision rates of bodies', low=0.0, high=1.0
    )
    probability: float = setting(0.95, 'probability of the interval', low=0.5, high=0.999)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingSettings:
    """From speeds to the coefficient of restitution."""

    relation: str = setting(
        'library',
        'relation between decay and restitution: a library of simulated decays of the tray, or '
        'the closed form of the paper, which is wrong and kept for comparison',
        choices=('library', 'paper'),
    )
    decay_library: str = setting(
        '',
        'file of simulated decays, made by `nanorocks library`; empty: the file in the package '
        'for the tray',
        placeholder='NPZ',
    )
    delay: float = setting(
        1.75, 'time from the shaking event to the first speed used', 's', low=0.0, high=600.0
    )
    duration: float = setting(
        20.0,
        'length of the time window of the fit, from the shaking event or, if later, from the '
        'moment the tray came to rest',
        's',
        low=0.5,
        high=3600.0,
    )
    max_tray_to_bead_speed: float = setting(
        0.05,
        'largest ratio of tray speed to mean bead speed at which the fit starts; after shaking '
        'the tray oscillates on its springs',
        deprecated='calm_share',
        low=0.0,
        high=10.0,
    )
    until_merge: bool = setting(
        True,
        'end the fit at the first merge of the cycle: beads that stick lose more energy than '
        'beads that bounce',
    )
    rebounds: bool = setting(
        True, 'use rebounds from the side walls, found in the tracks, besides the decay'
    )
    collisions: bool = setting(
        True, 'use collisions of two beads, found in the tracks, besides the decay'
    )
    include_inconsistent: bool = setting(
        False,
        'count the decays of cycles whose decay and contacts disagree, too, in the means of all '
        'cycles; their contacts always count',
    )
    update_interval: float = setting(
        0.5, 'time between two live estimates', 's', low=0.0, high=60.0
    )
    min_samples: int = setting(
        8, 'smallest number of speeds for a fit', deprecated='fewest_samples', low=4, high=10000
    )
    probability: float = setting(0.95, 'probability of the interval', low=0.5, high=0.999)


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorSettings:
    """Priors of the restitutions of beads and walls, and systematic errors."""

    min_wall_restitution: float = setting(
        0.5,
        'lower end of the flat prior of the wall restitution',
        deprecated='wall_low',
        low=0.5,
        high=1.0,
    )
    max_wall_restitution: float = setting(
        1.0,
        'upper end of the flat prior of the wall restitution; equal to the lower end if it is '
        'known',
        deprecated='wall_high',
        low=0.5,
        high=1.0,
    )
    floor_lid_spread: float = setting(
        0.4,
        'standard deviation of the logarithm of the ratio of 1 - restitution of floor and lid to '
        'that of the side walls; 0: equal',
        low=0.0,
        high=1.0,
    )
    height_error: float = setting(
        0.1e-3, 'standard error of the inner height of a tray', 'm', low=0.0, high=1e-3
    )
    diameter_error: float = setting(
        0.01, 'relative standard error of the bead diameter', low=0.0, high=0.1
    )
    count_error: float = setting(
        0.3, 'standard error of the number of beads, if counted', low=0.0, high=100.0
    )
    anisotropy_spread: float = setting(
        0.5,
        'standard deviation of the logarithm of the ratio of vertical to horizontal speed after a '
        'shaking event',
        low=0.0,
        high=2.0,
    )
    speed_distribution_spread: float = setting(
        1.0,
        'standard deviation of the shape of the speed distribution after a shaking event; shape '
        '-1: uniform, 0: half way, 1: Maxwellian',
        deprecated='start_spread',
        low=0.0,
        high=2.0,
    )
    initial_speed: float = setting(
        7e-3,
        'median of the mean projected speed after a shaking event, before the decay is seen',
        'm/s',
        low=1e-6,
        high=10.0,
    )
    initial_speed_spread: float = setting(
        0.7,
        'standard deviation of the logarithm of the mean projected speed after a shaking event',
        low=0.01,
        high=5.0,
    )
    friction: float = setting(
        0.0,
        'coefficient of friction of beads on floor, lid and walls, such as measured with spare '
        'beads; 0: unknown, to be found by rebounds, without which beads count as smooth',
        low=0.0,
        high=0.15,
    )
    friction_error: float = setting(
        0.003,
        'half of the probability of the friction is within this of `friction`; the prior has long '
        'tails (Cauchy), so that rebounds can overrule it',
        low=0.0,
        high=1.0,
    )
    bead_friction_spread: float = setting(
        0.5,
        'standard deviation of the logarithm of the friction between beads over that of beads and '
        'walls',
        low=0.0,
        high=1.0,
    )
    scale_error: float = setting(
        0.005, 'relative standard error of the image scale', low=0.0, high=0.1
    )
    speed_bias: float = setting(
        0.01,
        'standard deviation of the relative speed error that grows by this amount per factor e in '
        'speed',
        low=0.0,
        high=0.2,
    )
    grain_scale_error: float = setting(
        0.1,
        'relative standard error of speeds in trays with grains, which hide each other, cast '
        'shadows and rotate',
        low=0.0,
        high=1.0,
    )
    grain_speed_bias: float = setting(
        0.1,
        '`speed_bias` of speeds in trays with grains',
        low=0.0,
        high=0.5,
    )
    drag: float = setting(
        0.0,
        'rate at which the gas slows a bead of the first species; the flights of each cycle '
        'measure it',
        '1/s',
        low=0.0,
        high=100.0,
    )
    drag_error: float = setting(
        0.2,
        'standard deviation of `drag` before the flights are seen; 0: it is known, as in a vacuum',
        '1/s',
        low=0.0,
        high=100.0,
    )
    collision_bias: float = setting(
        0.004,
        'standard deviation of the common systematic error of the bead restitutions measured from '
        'collisions',
        low=0.0,
        high=0.2,
    )
    rebound_bias: float = setting(
        0.001,
        'standard deviation of the common systematic error of the wall restitutions measured from '
        'rebounds',
        low=0.0,
        high=0.2,
    )
    readout: float = setting(
        0.02,
        'standard deviation of the time in which the camera reads a side of a tray, row by row '
        '(rolling shutter), before rebounds from opposite walls tell it; 0: all rows at once',
        's',
        low=0.0,
        high=0.2,
    )
