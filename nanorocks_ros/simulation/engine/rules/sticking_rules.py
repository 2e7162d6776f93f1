"""Rules by which beads stick, and bodies of them move and break up.

Tested by ``test/simulation/engine/rules/test_sticking_rules.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.rules.rule_checks import checked_non_negative

STICKING_MEASURES = 'normal', 'total'
ROTATING, TRANSLATING = 'rotating', 'translating'
AGGREGATE_MOTIONS = ROTATING, TRANSLATING
# At 0, nothing sticks or breaks.
_SPEEDS = 'sticking_speed', 'sticking_speed_width', 'wall_sticking_speed', 'break_up_speed'


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingRules:
    """Which contacts stick, and how bodies of several beads move and break up.

    Parameters
    ----------
    sticking_speed : float, [m/s], >= 0
        Bodies that meet more slowly merge into a rigid body.
    sticking_speed_width : float, [m/s], 0 to twice `sticking_speed`
        The threshold of each contact is uniform in sticking_speed ± width / 2: the probability
        to stick falls linearly from 1 to 0 over this width.
    wall_sticking_speed : float, [m/s], >= 0
        Bodies that meet a wall more slowly stay there.
    sticking_measure : 'normal' or 'total'
        Speed to compare: normal component, or magnitude of the relative velocity of the beads.
    aggregate_motion : 'rotating' or 'translating'
        Whether bodies of several beads turn, with their tensor of inertia; or never do, so that
        a contact takes away the angular momentum that would turn them. Those that turn have
        smooth beads, walls on all sides and no drag.
    break_up_speed : float, [m/s], 0 or above all that sticks
        A bead of a body that turns leaves it, just before the impact, in a contact of a larger
        normal speed. 0: bodies never break up.
    """

    sticking_speed: float = 0.0
    sticking_speed_width: float = 0.0
    wall_sticking_speed: float = 0.0
    sticking_measure: str = 'normal'
    aggregate_motion: str = ROTATING
    break_up_speed: float = 0.0

    @property
    def forms_turning_bodies(self) -> bool:
        """Whether beads can form bodies that turn."""
        return self.sticking_speed > 0.0 and self.aggregate_motion == ROTATING

    def check_sticking(self, *, moving: bool, rough: bool, periodic: bool) -> None:
        """Check these rules, and that they can be combined with others.

        Parameters
        ----------
        moving, rough, periodic : bool
            Whether walls move, beads are rough, and any sides are periodic.

        Raises
        ------
        SimulationError
            For an invalid value, or rules that cannot be combined.
        """
        for name in _SPEEDS:
            checked_non_negative(name, getattr(self, name), 'm/s')
        _check_choice('sticking_measure', self.sticking_measure, STICKING_MEASURES)
        _check_choice('aggregate_motion', self.aggregate_motion, AGGREGATE_MOTIONS)
        if self.wall_sticking_speed > 0.0 and moving:
            raise SimulationError(
                'wall_sticking_speed',
                'bodies cannot stick to walls that move',
                'let the tray be at rest, or set it to 0',
            )
        if self.sticking_speed_width > 2.0 * self.sticking_speed:
            raise SimulationError(
                'sticking_speed_width',
                f'{self.sticking_speed_width:g} m/s around {self.sticking_speed:g} m/s',
                f'give at most twice the sticking_speed, {2.0 * self.sticking_speed:g}',
            )
        self._check_break_up()
        if self.forms_turning_bodies:
            _check_combined(rough=rough, periodic=periodic)

    def _check_break_up(self) -> None:
        if self.break_up_speed == 0.0:
            return
        if not self.forms_turning_bodies:
            raise SimulationError(
                'break_up_speed',
                'only bodies that turn break up',
                f'set sticking_speed, with aggregate_motion {ROTATING}, or break_up_speed to 0',
            )
        fastest = self.sticking_speed + 0.5 * self.sticking_speed_width
        if self.break_up_speed <= fastest:
            raise SimulationError(
                'break_up_speed',
                f'{self.break_up_speed:g} m/s, but contacts of up to {fastest:g} m/s stick',
                'give more than that',
            )


def _check_choice(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise SimulationError(name, f'{value!r} is none of {", ".join(known)}', 'give one of them')


def _check_combined(*, rough: bool, periodic: bool) -> None:
    remedy = f'set aggregate_motion to {TRANSLATING}'
    if rough:
        raise SimulationError(
            'tangential_restitution',
            'beads of bodies that turn are smooth',
            f'{remedy}, or leave it',
        )
    if periodic:
        raise SimulationError(
            'periodic', 'bodies cannot turn across periodic sides', f'{remedy}, or give walls'
        )
