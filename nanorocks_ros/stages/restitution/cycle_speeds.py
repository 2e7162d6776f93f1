"""Which speeds of a cycle its restitution follows from, and which of their flags warn of it."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING

from nanorocks_ros.physics.crowded_grains import layers_of
from nanorocks_ros.records import Quality, SpeedEstimate, SpeedMethod

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray

# Flags of speeds that tracks do not tell well: they are left out up to this share. A decay of some
# 200 speeds does not need them; where they are more, they are a whole part of it.
_DOUBTFUL = Quality.UNCERTAIN | Quality.FEW_BEADS
_MAX_LEFT_OUT = 0.05
# Layers of beads up to which the library of decays and the structure function are those of a gas
# whose pictures show most beads.
_MAX_LAYERS = 1.0


def certain_speeds(speeds: Sequence[SpeedEstimate]) -> list[SpeedEstimate]:
    """The speeds without those from tracks that are uncertain or of few beads, if these are rare.

    Parameters
    ----------
    speeds : sequence of SpeedEstimate
        Of one cycle.
    """
    certain = [speed for speed in speeds if not _is_doubtful(speed)]
    if len(speeds) - len(certain) > _MAX_LEFT_OUT * len(speeds):
        return list(speeds)
    return certain


def warnings_of(speeds: Sequence[SpeedEstimate], tray: Tray) -> Quality:
    """Flags of the speeds that warn of a restitution from them.

    `FEW_BEADS` says that tracks are not reliable. The structure function needs none. Among grains
    its scale and bias have errors of their own in the interval of the restitution
    (`prior.grain_scale_error`, `prior.grain_speed_bias`), so the flag adds nothing; where grains
    lie in layers these errors were too small in some films, and it stays.
    """
    grains = any(species.properties.shape == 'grain' for species in tray.species)
    carried = Quality(0)
    if grains and layers_of(tray) < _MAX_LAYERS:
        carried = Quality.FEW_BEADS
    flags = (
        speed.quality & ~carried
        if speed.method is SpeedMethod.STRUCTURE_FUNCTION
        else speed.quality
        for speed in speeds
    )
    return reduce(or_, flags, Quality(0))


def _is_doubtful(speed: SpeedEstimate) -> bool:
    return speed.method is SpeedMethod.TRACKING and bool(speed.quality & _DOUBTFUL)
