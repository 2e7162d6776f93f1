"""Settings of the simulated gas and of its films.

Tested by ``test/settings/test_setting_fields.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.settings.setting_fields import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationSettings:
    """A simulated tray and the camera over it."""

    tray: int = setting(1, 'tray to simulate', everyday=True, placeholder='K', low=1, high=8)
    seed: int = setting(1, 'random seed', everyday=True, low=0, high=2**31 - 1)
    restitution: float = setting(
        0.89, 'coefficient of restitution between beads', everyday=True, low=0.0, high=1.0
    )
    restitution_width: float = setting(
        0.0,
        'full width of the uniform distribution of the restitution of single collisions',
        low=0.0,
        high=1.0,
    )
    wall_restitution: float = setting(
        0.99, 'coefficient of restitution at the walls', everyday=True, low=0.0, high=1.0
    )
    restitution_law: str = setting(
        'constant',
        'restitution between beads: constant, drawn from a uniform distribution of '
        '`restitution_width` (also with constant and a width), falling with the impact speed '
        'along the normal as of viscoelastic spheres, 1 - restitution as a power of that speed, '
        'or that of each pair of species by `restitution_pairs`',
        choices=('constant', 'uniform', 'viscoelastic', 'power', 'pairs'),
    )
    restitution_pairs: tuple[float, ...] = setting(
        (0.89,),
        'with the law pairs: restitutions of pairs of species in the order of the tray; of '
        'acrylic and glass: acrylic-acrylic, acrylic-glass, glass-glass; a single one is that of '
        'all pairs',
        low=0.0,
        high=1.0,
    )
    wall_restitution_law: str = setting(
        'constant',
        'how the restitution at the walls depends on the impact speed',
        choices=('constant', 'viscoelastic', 'power'),
    )
    restitution_speed: float = setting(
        0.005,
        'impact speed at which restitutions with a law that is not constant are as set',
        'm/s',
        low=1e-6,
        high=10.0,
    )
    restitution_exponent: float = setting(
        0.2,
        'exponent of the impact speed in 1 - restitution, with the law power',
        low=0.0,
        high=5.0,
    )
    floor_lid_difference: float = setting(
        0.0,
        'restitution of floor and lid minus that of the side walls; both stay within 0 and 1',
        low=-1.0,
        high=1.0,
    )
    sticking_speed: float = setting(
        0.0, 'relative speed below which beads stick together', 'm/s', low=0.0, high=1.0
    )
    wall_sticking_speed: float = setting(
        0.0, 'speed below which beads stick to a wall', 'm/s', low=0.0, high=1.0
    )
    sticking_measure: str = setting(
        'normal',
        'speed compared with the sticking speed: along the normal of the contact, or the total',
        choices=('normal', 'total'),
    )
    sticking_speed_width: float = setting(
        0.0,
        'full width over which the probability to stick falls from 1 to 0, around sticking_speed; '
        'at most twice that speed',
        'm/s',
        low=0.0,
        high=2.0,
    )
    aggregate_motion: str = setting(
        'rotating',
        'motion of beads that stick together: as rigid bodies that turn, or translating only, '
        'without angular momentum',
        choices=('rotating', 'translating'),
    )
    break_up_speed: float = setting(
        0.0,
        'normal speed of a contact above which the bead that is hit leaves its body; 0: never',
        'm/s',
        low=0.0,
        high=10.0,
    )
    tangential_restitution: float = setting(
        -1.0,
        'tangential restitution between beads; -1: smooth, 1: perfectly rough',
        low=-1.0,
        high=1.0,
    )
    wall_tangential_restitution: float = setting(
        -1.0, 'tangential restitution at the walls; -1: smooth', low=-1.0, high=1.0
    )
    friction: float = setting(
        1e6,
        'coefficient of friction of rough beads, at which contacts slide; large: no sliding',
        low=0.0,
        high=1e6,
    )
    wall_friction: float = setting(
        1e6, 'coefficient of friction of rough beads at the walls', low=0.0, high=1e6
    )
    drag: float = setting(
        0.0,
        'rate at which a gas slows a bead of mean size of the first species of a tray; Stokes: '
        'others by 1 / (density diameter²), spins 10/3 times as fast; 0: vacuum',
        '1/s',
        low=0.0,
        high=100.0,
    )
    speeds: str = setting(
        'uniform',
        'speed distribution after a shaking event: uniform in [0, 2 mean], Maxwellian, or from a '
        'simulation of shaken walls, scaled to the mean',
        choices=('uniform', 'maxwellian', 'shaken'),
    )
    vertical_speed_factor: float = setting(
        1.0,
        'factor on the vertical velocities, towards the camera, of `speeds` after a shaking event',
        low=0.0,
        high=100.0,
    )
    shake_frequency: float = setting(
        5.0, 'speeds=shaken: frequency of the walls', '1/s', low=0.1, high=1000.0
    )
    shake_periods: int = setting(
        20, 'speeds=shaken: number of periods of the walls', low=1, high=10000
    )
    mean_speed: float = setting(
        0.007, 'mean 3-D speed after a shaking event', 'm/s', low=0.0, high=1.0
    )
    first_shake: float = setting(
        1.0,
        'time of the first shaking event; the beads are at rest before it',
        's',
        low=0.0,
        high=3600.0,
    )
    shake_period: float = setting(60.0, 'time between shaking events', 's', low=0.1, high=3600.0)
    frame_rate: float = setting(30.0, 'frames per second', '1/s', low=0.1, high=1000.0)
    width_px: int = setting(1920, 'width of the image', 'px', low=16, high=8192)
    height_px: int = setting(1080, 'height of the image', 'px', low=16, high=8192)
    pixels_per_metre: float = setting(13500.0, 'image scale', 'px/m', low=100.0, high=1e6)
    noise: float = setting(
        2.0, 'standard deviation of the sensor noise', 'gray levels', low=0.0, high=64.0
    )


LAW_SETTINGS = (
    'restitution_law',
    'wall_restitution_law',
    'restitution_width',
    'restitution_speed',
    'restitution_exponent',
    'restitution_pairs',
)
"""Settings that say how restitutions depend on speed, chance or species."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmSettings:
    """Content of the simulated film."""

    whole_scene: bool = setting(
        False, 'film the whole plate with the trays of `scene.trays`, not one tray alone'
    )
    effects: str = setting(
        'all',
        'effects of the scene: all with their strengths, or none',
        choices=('all', 'none'),
    )
