"""What passes between the stages: frozen values, SI units, one integer time stamp each.

Estimates carry ``_error``, one standard error. NaN means "not known yet", never 0.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum, IntFlag
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

UNKNOWN = float('nan')


class SpeedMethod(IntEnum):
    """How a mean projected speed was measured (the constants of ``SpeedEstimate.msg``)."""

    STRUCTURE_FUNCTION = 1
    BINARISED_AREA = 2
    TRACKING = 3


class CorStatus(IntEnum):
    """Where the fit of a cycle stands (the constants of ``CorEstimate.msg``)."""

    COOLING = 1
    FINAL = 2
    NO_DECAY = 3
    UNDETERMINED = 4


class CorRelation(IntEnum):
    """Which relation turned a decay into a restitution (constants of ``CorEstimate.msg``)."""

    PAPER = 1
    LIBRARY = 2


class SizeStatus(IntEnum):
    """What an autocorrelation says of the cluster size (constants of ``ClusterEstimate.msg``)."""

    MEASURED = 1
    BEYOND = 2
    NOTHING = 3
    INSENSITIVE = 4
    UNCALIBRATED = 5


class StickingStatus(IntEnum):
    """What is known of a sticking speed (constants of ``ClusterEstimate.msg``).

    The message gives each its name with ``STICKING_`` before it.
    """

    UNKNOWN = 0
    MEASURED = 1
    NO_MERGE = 2
    STUCK_FROM_THE_START = 3
    NO_UPPER_LIMIT = 4


class Quality(IntFlag):
    """What is wrong with the picture of a tray since the last one, or with a speed from it.

    0 when nothing is; docs/method/speed.md says what each flag means.
    """

    SATURATED = 1
    LOW_CONTRAST = 2
    FEW_BEADS = 4
    GLARE = 8
    STABILISATION_LOST = 16
    GRAY_CAMERA = 32
    FROZEN = 64
    HALF_FRAME = 128
    WRONG_SCALE = 256
    UNCERTAIN = 512
    UNCALIBRATED = 1024
    INCONSISTENT = 2048

    def names(self) -> list[str]:
        """The flags that are set, in small letters."""
        return [flag.name.lower() for flag in type(self) if flag in self and flag.name]


NOTHING_WRONG = Quality(0)


@cache
def _names(kind: Any) -> tuple[str, ...]:
    """Names of the fields of a kind of records."""
    return tuple(field.name for field in fields(kind))


def _freeze_arrays(record: Any) -> None:
    for name in _names(record.__class__):
        value = getattr(record, name)
        if isinstance(value, np.ndarray) and value.flags.writeable:
            view = value.view()
            view.flags.writeable = False
            object.__setattr__(record, name, view)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One picture of the whole scene, as the camera gave it.

    Parameters
    ----------
    stamp_ns : int
        Instant of exposure, [ns].
    encoding : str
        ``bgr8``, ``rgb8`` or ``mono8``.
    image : ndarray of uint8, (height, width, 3) or (height, width)
    """

    stamp_ns: int
    encoding: str
    image: NDArray[np.uint8]

    def __post_init__(self) -> None:
        _freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrayImage:
    """The crop of one tray, in colour where the camera gives it, and its gray mix.

    Parameters
    ----------
    stamp_ns : int
    tray : int
    gray : ndarray of uint8, (rows, columns)
        Rectified, and moved back by the displacement of the tray.
    color : ndarray of uint8, (rows, columns, 3), bgr, or None for a gray camera
    cycle : int or None
        Shaking events so far; None when nobody has counted yet.
    cycle_start_ns : int or None
        The shaking event that opened the cycle; None before the first.
    noise_power : float, [gray levels^2]
        Mean squared difference per pixel of two images of a scene at rest; NaN when unknown.
    displacement : tuple of 2 floats, [m]
        Of the tray in the picture, along columns and rows, from where it was at first; NaN when
        there is nothing to measure it by.
    displacement_error : float, [m]
        One standard error, of each component.
    velocity : tuple of 2 floats, [m/s]
        Of the tray, since the image before.
    velocity_error : float, [m/s]
    quality : Quality
    glare : float, 0 to 1
        Share of the picture that is hidden by reflections; NaN when unknown.
    """

    stamp_ns: int
    tray: int
    gray: NDArray[np.uint8]
    color: NDArray[np.uint8] | None = None
    cycle: int | None = None
    cycle_start_ns: int | None = None
    noise_power: float = UNKNOWN
    displacement: tuple[float, float] = (UNKNOWN, UNKNOWN)
    displacement_error: float = UNKNOWN
    velocity: tuple[float, float] = (UNKNOWN, UNKNOWN)
    velocity_error: float = UNKNOWN
    quality: Quality = NOTHING_WRONG
    glare: float = UNKNOWN

    def __post_init__(self) -> None:
        _freeze_arrays(self)

    def state(self) -> TrayState:
        """What is known of the image besides its pixels."""
        return TrayState(
            stamp_ns=self.stamp_ns,
            tray=self.tray,
            cycle=self.cycle or 0,
            cycle_start_ns=self.cycle_start_ns,
            noise_power=self.noise_power,
            displacement_x=self.displacement[0],
            displacement_y=self.displacement[1],
            displacement_error=self.displacement_error,
            velocity_x=self.velocity[0],
            velocity_y=self.velocity[1],
            velocity_error=self.velocity_error,
            quality=self.quality,
            glare=self.glare,
            color=int(self.color is not None),
        )

    @classmethod
    def of_state(
        cls,
        state: TrayState,
        stamp_ns: int,
        gray: NDArray[np.uint8],
        color: NDArray[np.uint8] | None,
    ) -> TrayImage:
        """The image again, from its state and its pixels; the stamp is that of the pixels."""
        return cls(
            stamp_ns=stamp_ns,
            tray=state.tray,
            gray=gray,
            color=color,
            cycle=state.cycle,
            cycle_start_ns=state.cycle_start_ns,
            noise_power=state.noise_power,
            displacement=(state.displacement_x, state.displacement_y),
            displacement_error=state.displacement_error,
            velocity=(state.velocity_x, state.velocity_y),
            velocity_error=state.velocity_error,
            quality=state.quality,
            glare=state.glare,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrayState:
    """What is known of a tray image besides its pixels; see :class:`TrayImage`.

    Parameters
    ----------
    color : int
        1 when there is a colour image too, 0 for a gray camera.
    """

    stamp_ns: int
    tray: int
    cycle: int
    cycle_start_ns: int | None
    noise_power: float
    displacement_x: float
    displacement_y: float
    displacement_error: float
    velocity_x: float
    velocity_y: float
    velocity_error: float
    quality: Quality
    glare: float
    color: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionMask:
    """Where something moved: 255 in moving pixels, 0 elsewhere ([B19] fig. 4d)."""

    stamp_ns: int
    tray: int
    mask: NDArray[np.uint8]

    def __post_init__(self) -> None:
        _freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedEstimate:
    """Mean projected speed of the beads of one tray over one window.

    Parameters
    ----------
    stamp_ns : int
        Middle of the window.
    tray, cycle : int
        ``cycle`` counts the shaking events seen so far; 0 before the first.
    mean_projected_speed, mean_projected_speed_error : float, [m/s]
    window : float, [s]
        Time between the two pictures compared.
    method : SpeedMethod
    cycle_start_ns : int or None
        The shaking event that opened the cycle; None before the first.
    quality : Quality
        What was wrong with the pictures since the last estimate, and with the estimate itself.
    first_species_speed, first_species_speed_error : float, [m/s]
    second_species_speed, second_species_speed_error : float, [m/s]
        Mean projected speed of the first two of `Tray.species`; unknown when they were not told
        apart.
    tray_speed : float, [m/s]
        Root of the mean square of the speed of the tray on its springs around that time, less what
        its errors may add; unknown where the tray was not followed.
    """

    stamp_ns: int
    tray: int
    cycle: int
    cycle_start_ns: int | None
    mean_projected_speed: float
    mean_projected_speed_error: float
    window: float
    method: SpeedMethod
    quality: Quality = NOTHING_WRONG
    first_species_speed: float = UNKNOWN
    first_species_speed_error: float = UNKNOWN
    second_species_speed: float = UNKNOWN
    second_species_speed_error: float = UNKNOWN
    tray_speed: float = UNKNOWN

    @staticmethod
    def by_species(speeds: Iterable[tuple[float, float]]) -> dict[str, float]:
        """The fields for the speeds of the species and their errors, [m/s]; two at most."""
        found = {}
        for name, (speed, error) in zip(('first', 'second'), speeds, strict=False):
            found[f'{name}_species_speed'] = speed
            found[f'{name}_species_speed_error'] = error
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterEstimate:
    """Width of the autocorrelation of one tray image, and clusters by that and by tracks.

    Parameters
    ----------
    stamp_ns : int
    tray, cycle : int
    level_area : float, [m^2]
        Area around zero lag where the normalised autocorrelation exceeds the chosen level; 0 for a
        uniform image.
    correlation_length : float, [m]
        Radius of the disc of that area.
    axes_ratio : float, >= 1
        Longer over shorter axis of that area.
    direction : float, [rad], -pi/2 to pi/2
        From the columns to its longer axis, positive towards the rows (down in the picture).
    breadth : float, >= 1
        `level_area` over the area at 0.7; less dependent on the camera than either.
    cluster_size, cluster_size_error : float, [beads]
        Number of beads per body, averaged over the beads (weight-averaged): 1 when all are single.
    cluster_size_lower, cluster_size_upper : float, [beads]
        Sizes between which the width is one standard deviation off or less; of a size that is
        beyond the calibration, too.
    size_status : SizeStatus
    bodies, bodies_error : float
        Free bodies by tracks: single beads and clusters; unknown where beads are not tracked.
    mean_size, weighted_size, weighted_size_error : float, [beads]
        By tracks: beads of a body, mean over the bodies and over the beads.
    clustered_share : float, 0 to 1
        Of the beads, in bodies of two and more, by tracks.
    combined_size, combined_size_error : float, [beads]
        Weight-averaged size by the autocorrelation and by tracks together.
    onset : float, [s]
        First merge of the cycle, since the shaking event; unknown before.
    sticking_status : StickingStatus
    sticking_speed, sticking_speed_lower, sticking_speed_upper : float, [m/s]
        Beads that meet more slowly stick: by the merges of this cycle so far, with an interval.
    mean_sticking_speed, mean_sticking_speed_lower, mean_sticking_speed_upper : float, [m/s]
        By all cycles before this one.
    """

    stamp_ns: int
    tray: int
    cycle: int
    level_area: float
    correlation_length: float
    axes_ratio: float = UNKNOWN
    direction: float = UNKNOWN
    breadth: float = UNKNOWN
    cluster_size: float = UNKNOWN
    cluster_size_error: float = UNKNOWN
    cluster_size_lower: float = UNKNOWN
    cluster_size_upper: float = UNKNOWN
    size_status: SizeStatus = SizeStatus.UNCALIBRATED
    bodies: float = UNKNOWN
    bodies_error: float = UNKNOWN
    mean_size: float = UNKNOWN
    weighted_size: float = UNKNOWN
    weighted_size_error: float = UNKNOWN
    clustered_share: float = UNKNOWN
    combined_size: float = UNKNOWN
    combined_size_error: float = UNKNOWN
    onset: float = UNKNOWN
    sticking_status: StickingStatus = StickingStatus.UNKNOWN
    sticking_speed: float = UNKNOWN
    sticking_speed_lower: float = UNKNOWN
    sticking_speed_upper: float = UNKNOWN
    mean_sticking_speed: float = UNKNOWN
    mean_sticking_speed_lower: float = UNKNOWN
    mean_sticking_speed_upper: float = UNKNOWN


@dataclass(frozen=True, slots=True, kw_only=True)
class Autocorrelation:
    """Normalised autocorrelation of a tray image, zero lag in the centre.

    Parameters
    ----------
    values : ndarray of float32, (rows, columns)
        1 at zero lag.
    """

    stamp_ns: int
    tray: int
    values: NDArray[np.float32]

    def __post_init__(self) -> None:
        _freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class CorEstimate:
    """Coefficient of restitution of the collisions in one tray, with its interval.

    Parameters
    ----------
    stamp_ns : int
        Last speed used.
    tray, cycle : int
    status : CorStatus
    relation : CorRelation
        What turned the decay into a restitution.
    restitution, restitution_lower, restitution_upper : float, 0 to 1
        Of two beads: median of what is probable, and interval; statistical only for
        ``CorRelation.PAPER``.
    initial_speed, initial_speed_error : float, [m/s]
        Mean projected speed at `cooling_start`, from the fit.
    haff_time, haff_time_error : float, [s]
    reduced_chi_square : float
        Of the fit. For ``CorRelation.LIBRARY`` with the fluctuations of the gas and the errors of
        the speeds, near 1; for ``PAPER`` with the errors of the speeds alone.
    samples : int
        Speeds in the cooling window.
    mean_restitution, mean_restitution_error : float
        Of all cycles finished so far, and its standard error.
    wall_restitution, wall_restitution_lower, wall_restitution_upper : float, 0 to 1
        Of beads and side walls, as `restitution`.
    correlation : float, -1 to 1
        Of what is known of the two restitutions: near -1 in the valley in which a higher one of
        the beads makes up for a lower one of the walls.
    paper_restitution : float
        What the closed form of the paper makes of the decay, for comparison.
    quality : Quality
        What was wrong with the pictures behind the speeds.
    window_start, window_end : float, [s]
        First and last speed used, since the shaking event.
    cooling_start : float, [s]
        From when on the gas is taken to cool, since the shaking event: 0, or later when the tray
        swung on.
    rebounds, collisions : int
        Single contacts used besides the decay.
    tension : float
        Standard deviations by which decay, rebounds and collisions disagree.
    mean_wall_restitution, mean_wall_restitution_error : float
        As `mean_restitution`.
    first_species_initial_speed, first_species_initial_speed_error : float, [m/s]
        As `initial_speed`, of the first of `Tray.species` by itself; of a mixture whose species
        were told apart, once the cycle is over.
    first_species_haff_time, first_species_haff_time_error : float, [s]
    second_species_initial_speed, second_species_initial_speed_error : float, [m/s]
    second_species_haff_time, second_species_haff_time_error : float, [s]
    """

    stamp_ns: int
    tray: int
    cycle: int
    status: CorStatus
    relation: CorRelation
    restitution: float = UNKNOWN
    restitution_lower: float = UNKNOWN
    restitution_upper: float = UNKNOWN
    initial_speed: float = UNKNOWN
    initial_speed_error: float = UNKNOWN
    haff_time: float = UNKNOWN
    haff_time_error: float = UNKNOWN
    reduced_chi_square: float = UNKNOWN
    samples: int = 0
    mean_restitution: float = UNKNOWN
    mean_restitution_error: float = UNKNOWN
    wall_restitution: float = UNKNOWN
    wall_restitution_lower: float = UNKNOWN
    wall_restitution_upper: float = UNKNOWN
    correlation: float = UNKNOWN
    paper_restitution: float = UNKNOWN
    quality: Quality = NOTHING_WRONG
    window_start: float = UNKNOWN
    window_end: float = UNKNOWN
    cooling_start: float = UNKNOWN
    rebounds: int = 0
    collisions: int = 0
    tension: float = UNKNOWN
    mean_wall_restitution: float = UNKNOWN
    mean_wall_restitution_error: float = UNKNOWN
    first_species_initial_speed: float = UNKNOWN
    first_species_initial_speed_error: float = UNKNOWN
    first_species_haff_time: float = UNKNOWN
    first_species_haff_time_error: float = UNKNOWN
    second_species_initial_speed: float = UNKNOWN
    second_species_initial_speed_error: float = UNKNOWN
    second_species_haff_time: float = UNKNOWN
    second_species_haff_time_error: float = UNKNOWN


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundTruth:
    """What the simulator knows of the frame it drew.

    Parameters
    ----------
    stamp_ns : int
    tray, cycle : int
    mean_projected_speed, mean_speed : float, [m/s]
    bodies : int
        Free bodies: beads and aggregates.
    restitution, wall_restitution : float
    sticking_speed : float, [m/s]
        0 when nothing sticks.
    """

    stamp_ns: int
    tray: int
    cycle: int
    mean_projected_speed: float
    mean_speed: float
    bodies: int
    restitution: float
    wall_restitution: float
    sticking_speed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BeadsTruth:
    """What the simulator knows of every bead of a tray in the frame it drew.

    Relative to the floor of the tray, as somebody who registers the tray in every picture
    finds them; the tray itself swings, while free beads fly straight past it.

    Parameters
    ----------
    stamp_ns : int
    tray, cycle : int
    displacement : ndarray (2,), [m]
        Of the tray from its place at rest, along columns and rows.
    tray_velocity : ndarray (2,), [m/s]
    positions : ndarray (n, 3), [m]
        From the corner of the floor where it is now; z towards the camera.
    velocities : ndarray (n, 3), [m/s]
        Relative to the tray.
    radii : ndarray (n,), [m]
    species : ndarray of int32, (n,)
        Place of the species in `Tray.species`.
    bodies : ndarray of int32, (n,)
        The smallest number of a bead in the body that each bead belongs to. A bead's number,
        its identity, is its row.
    """

    stamp_ns: int
    tray: int
    cycle: int
    displacement: NDArray[np.float64]
    tray_velocity: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    radii: NDArray[np.float64]
    species: NDArray[np.int32]
    bodies: NDArray[np.int32]

    def __post_init__(self) -> None:
        _freeze_arrays(self)

    @property
    def ids(self) -> NDArray[np.int32]:
        """Number of each bead, (n,)."""
        return np.arange(len(self.radii), dtype=np.int32)

    @property
    def free_velocities(self) -> NDArray[np.float64]:
        """Velocities past the camera, (n, 3), [m/s]: constant between collisions."""
        return np.asarray(self.velocities + np.append(self.tray_velocity, 0.0))

    @property
    def projected_speeds(self) -> NDArray[np.float64]:
        """Speeds in the image plane past the camera, (n,), [m/s]."""
        return np.asarray(np.hypot(*self.free_velocities[:, :2].T))


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """Something the user should hear about, which is not an error."""

    stamp_ns: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """The beads of one tray in one picture, each with a number that it keeps.

    Parameters
    ----------
    stamp_ns : int
    tray : int
    ids : ndarray of int32, (n,)
        Numbers of the tracks, rising; a bead lost for too long comes back under a new one.
    species : ndarray of int32, (n,)
        Index into the species of the tray.
    displacement : ndarray (2,), [m]
        Of the tray in the picture, from where it was at first; 0 where nobody measured it.
    positions : ndarray (n, 2), [m]
        Of the centres, from the corner of the floor where it is now; along columns and rows.
    position_errors : ndarray (n,), [m]
        Standard error of a coordinate.
    velocities : ndarray (n, 2), [m/s]
        Past the camera, not the swinging tray, at the instant of the picture; NaN when unknown.
    velocity_errors : ndarray (n,), [m/s]
        Standard error of a component; NaN when unknown.
    radii, radius_errors : ndarray (n,), [m]
    seen : ndarray of bool, (n,)
        False where the bead is hidden and its place is predicted.
    expected : ndarray of int32, (species,)
        Beads of each species that the tray should show.
    quality : Quality
        That of the image, and FEW_BEADS where much of a species is not seen.
    """

    stamp_ns: int
    tray: int
    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    displacement: NDArray[np.float64]
    positions: NDArray[np.float64]
    position_errors: NDArray[np.float64]
    velocities: NDArray[np.float64]
    velocity_errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    seen: NDArray[np.bool_]
    expected: NDArray[np.int32]
    quality: Quality = NOTHING_WRONG

    def __post_init__(self) -> None:
        _freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebound:
    """A bead that came back from a side wall, as its track shows it.

    Speeds are past the wall, which may swing; each has the error of its own straight line.

    Parameters
    ----------
    stamp_ns : int
        Of the contact, between two pictures.
    tray, cycle, track, species : int
    wall : int
        0 to 3: low and high along columns, low and high along rows.
    incoming, outgoing : float, [m/s]
        Speeds along the normal, to the wall before and from it after.
    incoming_error, outgoing_error : float, [m/s]
    tangential_incoming, tangential_outgoing, tangential_error : float, [m/s]
        Along the wall; the error is that of their difference.
    wall_velocity, wall_velocity_error : float, [m/s]
        Of the wall along the normal, to the outside; its error is in both speeds.
    place : ndarray (2,), [m]
        Of the centre of the bead, from the corner of the tray.
    """

    stamp_ns: int
    tray: int
    cycle: int = 0
    track: int
    species: int
    wall: int
    incoming: float
    incoming_error: float
    outgoing: float
    outgoing_error: float
    tangential_incoming: float
    tangential_outgoing: float
    tangential_error: float
    wall_velocity: float
    wall_velocity_error: float
    place: NDArray[np.float64]

    def __post_init__(self) -> None:
        _freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairCollision:
    """Two beads that hit each other, as their tracks show it.

    Parameters
    ----------
    stamp_ns : int
        Of the contact, between two pictures.
    tray, cycle : int
    tracks, species : ndarray of int32, (2,)
    radii, masses : ndarray (2,), [m], [kg]
    radius_errors : ndarray (2,), [m]
        0 where all beads of the species are alike.
    before, after : ndarray (2, 2), [m/s]
        Projected velocity of each bead.
    before_errors, after_errors : ndarray (2,), [m/s]
        Of each component.
    separation : ndarray (2,), [m]
        Projected, from the first centre to the second at the contact.
    separation_error : float, [m]
        Of each component.
    temperatures : ndarray (2,), [m^2/s^2]
        Of the species of each bead at that time: mean square of a horizontal component.
    height : float, [m]
        Of the tray, which limits how far beads can be above each other.
    place : ndarray (2,), [m]
        Of the first centre, from the corner of the tray.
    """

    stamp_ns: int
    tray: int
    cycle: int = 0
    tracks: NDArray[np.int32]
    species: NDArray[np.int32]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    masses: NDArray[np.float64]
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    before_errors: NDArray[np.float64]
    after_errors: NDArray[np.float64]
    separation: NDArray[np.float64]
    separation_error: float
    temperatures: NDArray[np.float64]
    height: float
    place: NDArray[np.float64]

    def __post_init__(self) -> None:
        _freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Merge:
    """Two beads that stick to each other from some instant on.

    Parameters
    ----------
    stamp_ns : int
        Since when they stay beside each other.
    known_ns : int
        The picture that made it improbable enough that they are free.
    tray, cycle : int
    tracks : ndarray of int32, (2,)
    joins : bool
        Whether bodies became fewer by it; False for two beads of one body, or of one that only
        seemed to be two.
    """

    stamp_ns: int
    known_ns: int
    tray: int
    cycle: int
    tracks: NDArray[np.int32]
    joins: bool

    def __post_init__(self) -> None:
        _freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyEstimate:
    """Free bodies of one tray: single beads, and clusters of beads that stick together.

    Errors hold beads that are not seen and pairs of which it is not known yet.

    Parameters
    ----------
    stamp_ns : int
        The instant that is counted, some time before it was published.
    tray, cycle : int
    beads : int
        In the tray.
    followed : int
        Of these, known at that instant; numbers of bodies are scaled to all beads.
    bodies, bodies_error : float
    mean_size, mean_size_error : float
        Beads of a body: mean over the bodies.
    weighted_size, weighted_size_error : float
        Beads of the body of a bead: mean over the beads.
    clustered_share, clustered_share_error : float, 0 to 1
        Of the beads, in bodies of two and more.
    clusters, clusters_error : float
        Bodies of two and more beads.
    sizes : ndarray (5,)
        Bodies of 1, 2, 3, 4 to 6, and 7 or more beads.
    first_merge_ns : int or None
        When the first two beads of the cycle began to stick together; None before.
    """

    stamp_ns: int
    tray: int
    cycle: int
    beads: int
    followed: int
    bodies: float
    bodies_error: float
    mean_size: float
    mean_size_error: float
    weighted_size: float
    weighted_size_error: float
    clustered_share: float
    clustered_share_error: float
    clusters: float
    clusters_error: float
    sizes: NDArray[np.float64]
    first_merge_ns: int | None = None

    def __post_init__(self) -> None:
        _freeze_arrays(self)

    @property
    def merged(self) -> bool:
        """Whether any beads stick together in this cycle."""
        return self.first_merge_ns is not None
