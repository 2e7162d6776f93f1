"""Diameters of several species from the discs of any size that a film shows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.gaussian_mixture import likeliest_mixture
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.stages.tracking.scene.any_size_discs import AnySizeDiscs, any_size_discs
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook, shaded_distances
from nanorocks_ros.stages.tracking.scene.scene_model import scene_model

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


# Fewer discs tell no size.
_LEAST_DISCS = 4
# Discs of one size differ by less than this part, as half of the middle 68 %.
_MAX_SPREAD = 0.2
# Error of a diameter that all discs of a film share: light, blur and shading at the outline, [px].
_SHARED_ERROR_PX = 0.4
# Frames that are searched, and those where they show few discs.
_FRAMES, _MORE_FRAMES, _FEW_DISCS = 8, 24, 64
# Smallest relative scatter of the radii of equal beads.
_LEAST_SPREAD = 0.01
# Radii are searched beyond those that were found, by this factor.
_RADIUS_TOLERANCE = 1.2
# Discs of any size, and those that tracking sees, agree in sizes to this part, and in shares.
_MAX_CHANGE, _MAX_SHARE_CHANGE = 0.1, 0.1
# Sizes of beads that look alike differ by so many standard deviations of a radius.
_APART = 3.0
# Smallest part of the discs that has the sizes of beads.
_LEAST_SHARE = 0.5
# What is no bead shows up in fewer discs than this part of the rarest species.
_STRAY_SHARE = 0.5
# Largest difference of a diameter that is told from that of discs, as a part.
_MAX_TOLD_ERROR = 0.15


class FoundDiameter(NamedTuple):
    """Diameter of the discs that a film shows.

    Parameters
    ----------
    diameter : float, [px]
        In the middle of theirs.
    spread : float
        Their relative scatter: half of the middle 68 %, or a standard deviation.
    discs, frames : int
        So many discs in so many frames.
    """

    diameter: float
    spread: float
    discs: int
    frames: int

    @property
    def error(self) -> float:
        """One standard error of the diameter, [px]."""
        beads = max(1.0, self.discs / self.frames)
        return math.hypot(_SHARED_ERROR_PX, self.diameter * self.spread / math.sqrt(beads))

    def __str__(self) -> str:
        return (
            f'{self.diameter:.1f} +- {self.error:.1f} px, by {counted(self.discs, "disc")} in '
            f'{counted(self.frames, "frame")} that scatter by {100.0 * self.spread:.0f} %'
        )


class SpeciesLook(NamedTuple):
    """What is told of a species.

    Parameters
    ----------
    sign : int
        1: brighter than the floor, -1: darker, 0: not known.
    colour : tuple of 3 floats or None, bgr, [gray levels]
    diameter : float, [px]
        NaN: to be found.
    order : float
        Species that look alike are larger the larger this is; equal ones as they are listed.
    """

    sign: int = 0
    colour: tuple[float, float, float] | None = None
    diameter: float = math.nan
    order: float = 0.0


def single_size(radii: NDArray[np.float64], frames: int) -> FoundDiameter | str:
    """The diameter of beads by the radii (n,) of the discs in so many frames; or why none."""
    if radii.size < _LEAST_DISCS:
        return f'{counted(radii.size, "disc")} in {counted(frames, "frame")}'
    low, middle, high = (2.0 * value for value in np.quantile(radii, [0.16, 0.5, 0.84]).tolist())
    spread = 0.5 * (high - low) / middle
    if spread > _MAX_SPREAD:
        return f'no discs of one size stand out ({low:.0f} to {high:.0f} px)'
    return FoundDiameter(middle, spread, radii.size, frames)


def species_sizes(
    frames: Sequence[NDArray[np.uint8]],
    looks: Sequence[SpeciesLook],
    allowed: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None,
) -> tuple[FoundDiameter, ...] | str:
    """Diameters of all species, in their order; or why there are none, in words.

    Species of different colours, or of which some are brighter and some darker than the floor,
    are told apart by these; others by their sizes, of which the smallest belongs to the first.

    Parameters
    ----------
    frames : sequence of ndarray of uint8, (rows, columns, 3), bgr
        Spread over the film.
    looks : sequence of SpeciesLook
    allowed : callable, optional
        Takes centres (n, 2), [px], the first pixel at 0.5; says which may be those of beads.
    """
    problem = _ambiguous(looks)
    if problem:
        return problem
    sizes: dict[int, FoundDiameter] = {}
    for key in dict.fromkeys((look.sign, look.colour) for look in looks):
        members = {k: look for k, look in enumerate(looks) if (look.sign, look.colour) == key}
        found = _sizes_of_alike(_Film(frames, looks, allowed), list(members.values()))
        if isinstance(found, str):
            return found
        sizes |= dict(zip(members, found, strict=True))
    return tuple(sizes[k] for k in range(len(looks)))


class _Film(NamedTuple):
    """Parameters of `species_sizes`."""

    frames: Sequence[NDArray[np.uint8]]
    looks: Sequence[SpeciesLook]
    allowed: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None

    def some(self, most: int) -> list[NDArray[np.uint8]]:
        """So many frames at most, spread over the film."""
        chosen = np.linspace(0, len(self.frames) - 1, min(most, len(self.frames)))
        return [np.ascontiguousarray(self.frames[round(k)]) for k in chosen]

    def log_radii(self, discs: AnySizeDiscs, look: SpeciesLook) -> NDArray[np.float64]:
        """Logarithms of the radii of the discs that may be beads with a look."""
        discs = discs.chosen(_has_look(discs, self.looks, look))
        if self.allowed is not None:
            discs = discs.chosen(self.allowed(discs.discs[:, :2] + 0.5))
        return np.log(discs.discs[:, 2])


def _sizes_of_alike(film: _Film, looks: Sequence[SpeciesLook]) -> tuple[FoundDiameter, ...] | str:
    """Sizes of species that look alike: of discs of any size, then as tracking sees them."""
    for most in (_FRAMES, _MORE_FRAMES):
        frames = film.some(most)
        radii = film.log_radii(any_size_discs(frames, looks[0].colour), looks[0])
        if len(radii) >= _FEW_DISCS:
            break
    rough = _sizes_of(radii, looks, len(frames))
    if isinstance(rough, str):
        return rough
    radii = 0.5 * np.array([size.diameter for size in rough])
    limits = float(radii.min()) / _RADIUS_TOLERANCE, float(radii.max()) * _RADIUS_TOLERANCE
    look = BeadLook(radii=limits, sign=looks[0].sign, colour=looks[0].colour)
    model = scene_model(film.some(_MORE_FRAMES), look)
    rows = [model.candidates(frame) for frame in frames]
    discs = AnySizeDiscs.joined([row.chosen(model.alike(row)) for row in rows])
    sizes = _sizes_of(film.log_radii(discs, looks[0]), looks, len(frames))
    if isinstance(sizes, str) or not _differ(rough, sizes):
        return sizes
    shown = ' and '.join(f'{size.diameter:.1f}' for size in (*rough, *sizes))
    return f'beads have several outlines, as clear ones do ({shown} px)'


def _differ(rough: Sequence[FoundDiameter], sizes: Sequence[FoundDiameter]) -> bool:
    """Whether two searches see other sizes, or other parts of the discs with these."""
    diameters, discs = np.array(
        [[(size.diameter, size.discs) for size in found] for found in (rough, sizes)]
    ).transpose(2, 0, 1)
    shares = discs / discs.sum(axis=1, keepdims=True)
    other = np.abs(np.log(diameters[1] / diameters[0])) > _MAX_CHANGE
    return bool(other.any() or (np.abs(shares[1] - shares[0]) > _MAX_SHARE_CHANGE).any())


def _ambiguous(looks: Sequence[SpeciesLook]) -> str:
    """Why it is not known which discs may be of which species; empty if it is."""
    coloured = sum(look.colour is not None for look in looks)
    if 0 < coloured < len(looks):
        return 'the colour of some species is given, and that of others is not'
    signs = {look.sign for look in looks}
    if not coloured and 0 in signs and len(signs) > 1:
        return 'the look of some species is given, and that of others is not'
    return ''


def _has_look(
    discs: AnySizeDiscs, looks: Sequence[SpeciesLook], look: SpeciesLook
) -> NDArray[np.bool_]:
    """Which discs have the brightness, and the colour, of a species."""
    brighter = (discs.colours - discs.around).sum(axis=1)
    alike = look.sign * brighter >= 0.0
    if look.colour is None:
        return np.asarray(alike)
    told = list(dict.fromkeys(other.colour for other in looks if other.colour is not None))
    distances = np.stack([shaded_distances(discs.colours, colour) for colour in told])
    alike &= np.argmin(distances, axis=0) == told.index(look.colour)
    around = shaded_distances(discs.around, look.colour)
    return np.asarray(alike & (distances[told.index(look.colour)] <= around))


def _sizes_of(
    log_radii: NDArray[np.float64], looks: Sequence[SpeciesLook], frames: int
) -> tuple[FoundDiameter, ...] | str:
    """Sizes of species that look alike by their radii in all frames; or why there are none."""
    count, species = len(log_radii), len(looks)
    if species == 1:
        size = single_size(np.exp(log_radii), frames)
        return size if isinstance(size, str) else _in_order([size], looks)
    if count < _LEAST_DISCS * species:
        return f'{counted(count, "disc")} in {counted(frames, "frame")}'
    mixture = likeliest_mixture(log_radii, species + 2, _LEAST_SPREAD, count / frames)
    seen = ' and '.join(f'{2.0 * size:.1f}' for size in np.exp(mixture.means).tolist())
    often = np.argsort(-mixture.shares, kind='stable')
    beads, others = np.sort(often[:species]), often[species:]
    rarest = mixture.shares[beads].min()
    if mixture.shares.sum() < _LEAST_SHARE:
        return f'{counted(count, "disc")} in {counted(frames, "frame")} have no sizes in common'
    if len(beads) < species or (mixture.shares[others] > _STRAY_SHARE * rarest).any():
        return f'{species} of one look are given, and discs show with diameters of {seen} px'
    squares = mixture.deviations[beads] ** 2
    scatter = np.sqrt(0.5 * (squares[1:] + squares[:-1]))
    if (np.diff(mixture.means[beads]) < _APART * scatter).any():
        return f'those of one look have {seen} px, and scatter too much to tell them apart'
    return _in_order(
        [
            FoundDiameter(2.0 * math.exp(mean), spread, round(share * count), frames)
            for mean, spread, share in zip(
                mixture.means[beads].tolist(),
                mixture.deviations[beads].tolist(),
                mixture.shares[beads].tolist(),
                strict=True,
            )
        ],
        looks,
    )


def _in_order(
    sizes: list[FoundDiameter], looks: Sequence[SpeciesLook]
) -> tuple[FoundDiameter, ...] | str:
    """Sizes, smallest first, for the species: the nearest to what is told, others by order."""
    chosen: dict[int, FoundDiameter] = {}
    for k, look in enumerate(looks):
        if math.isfinite(look.diameter):
            nearest = min(sizes, key=lambda size: abs(math.log(size.diameter / look.diameter)))
            if abs(nearest.diameter / look.diameter - 1.0) > _MAX_TOLD_ERROR:
                return f'none of the discs has the {look.diameter:.1f} px that are given'
            sizes.remove(nearest)
            chosen[k] = nearest
    left = [k for k in range(len(looks)) if k not in chosen]
    ordered = sorted(left, key=lambda k: looks[k].order)
    chosen |= dict(zip(ordered, sizes, strict=True))
    return tuple(chosen[k] for k in range(len(looks)))
