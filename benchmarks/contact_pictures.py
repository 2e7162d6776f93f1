"""Draw a detected rebound and a collision: ``python -m benchmarks.contact_pictures [FOLDER]``.

Writes rebounds.png for the documentation into docs/pictures or the given folder.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from benchmarks.contacts import METRE_PX, contacts_of, film
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import BLACK, BLUE, TWO_COLUMNS, scale_bar
from nanorocks_ros.records import PairCollision, Rebound, Tracks, TrayImage

_PAIRS, _WALLS = 0.89, 0.97
_SECONDS = 25.0
# Frames shown before and after a contact, and the half width of the picture, [px].
_SHOWN = 10
_AROUND = 46
# Largest distance of positions from the lines, [px].
_STRAIGHT = 0.5
_COLOURS = BLUE, BLACK

Film = list[tuple[TrayImage, Tracks]]


def _shown(frames: Film, stamp_ns: int) -> Film:
    middle = sum(image.stamp_ns < stamp_ns for image, _ in frames)
    return frames[middle - _SHOWN : middle + _SHOWN]


def _flights(
    frames: Film, track: int, stamp_ns: int
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Times since the contact, positions [px] in the frame of the tray, and fitted lines."""
    middle = min(frames, key=lambda frame: abs(frame[0].stamp_ns - stamp_ns))[1]
    rows = [
        (tracks.stamp_ns, *(tracks.positions[tracks.ids == track][0] + tracks.displacement))
        for _, tracks in frames
        if (tracks.ids == track).any()
    ]
    table = np.array(rows)
    table[:, 1:] = (table[:, 1:] - middle.displacement) * METRE_PX - 0.5
    parts = []
    for part in (table[:, 0] < stamp_ns, table[:, 0] >= stamp_ns):
        times, places = (table[part, 0] - stamp_ns) / 1e9, table[part, 1:]
        parts.append((times, places, np.polyfit(times, places, 1)))
    return parts


def _deviation(frames: Film, tracks: Sequence[int], stamp_ns: int) -> float:
    """Largest distance of the positions from straight lines, [px]."""
    frames_shown = _shown(frames, stamp_ns)
    return max(
        float(np.abs(places - np.outer(times, line[0]) - line[1]).max())
        for track in tracks
        for times, places, line in _flights(frames_shown, track, stamp_ns)
    )


def _draw_path(axes: Axes, frames: Film, track: int, stamp_ns: int, colour: str) -> None:
    flights = _flights(frames, track, stamp_ns)
    for (times, places, line), filled in zip(flights, (True, False), strict=True):
        ends = np.array([times.min(), times.max()])
        ends[np.argmin(np.abs(ends))] = 0.0
        axes.plot(*(np.outer(ends, line[0]) + line[1]).T, '-', color=colour, lw=1.2)
        axes.plot(*places.T, 'o', ms=3.5, mfc=colour if filled else 'white', mec=colour, mew=0.9)


def _draw(axes: Axes, frames: Film, contact: Rebound | PairCollision, centre: np.ndarray) -> None:
    frames_shown = _shown(frames, contact.stamp_ns)
    # The minimum over the images shows all positions of the beads.
    strobe = np.min([image.color for image, _ in frames_shown[::3]], axis=0)[:, :, ::-1]
    axes.imshow(strobe, alpha=0.75)
    for track, colour in zip(_tracks(contact), _COLOURS, strict=False):
        _draw_path(axes, frames_shown, track, contact.stamp_ns, colour)
    x, y = centre * METRE_PX
    rows, columns = strobe.shape[:2]
    # The image ends half a pixel beyond the centres of its outer pixels.
    axes.set_xlim(max(x - _AROUND, -0.5), min(x + _AROUND, columns - 0.5))
    axes.set_ylim(min(y + _AROUND, rows - 0.5), max(y - _AROUND, -0.5))
    scale_bar(axes, 1e-3 * METRE_PX)
    axes.set_xticks([])
    axes.set_yticks([])


def _tracks(contact: Rebound | PairCollision) -> list[int]:
    return contact.tracks.tolist() if isinstance(contact, PairCollision) else [contact.track]


def _best(contacts: list, frames: Film) -> tuple[Rebound, PairCollision]:
    """The fastest rebound and collision with straight paths."""
    first, last = frames[_SHOWN][0].stamp_ns, frames[-_SHOWN][0].stamp_ns
    straight = [
        contact
        for contact in contacts
        if first < contact.stamp_ns < last
        and _deviation(frames, _tracks(contact), contact.stamp_ns) < _STRAIGHT
    ]
    rebounds = [
        contact for contact in straight if isinstance(contact, Rebound) and contact.wall == 0
    ]
    pairs = [contact for contact in straight if isinstance(contact, PairCollision)]
    return (
        max(
            rebounds,
            key=lambda contact: contact.incoming.value + abs(contact.tangential_incoming),
        ),
        max(pairs, key=lambda contact: float(np.hypot(*(contact.before[1] - contact.before[0])))),
    )


def write(folder: Path) -> None:
    """Write the picture."""
    frames = list(film((1,), _PAIRS, _WALLS, _SECONDS, 1))
    rebound, pair = _best(
        list(contacts_of(load_trays()[1], (tracks for _, tracks in frames))), frames
    )
    with figure_file(folder / 'rebounds.png', TWO_COLUMNS, 95.0) as figure:
        left, right = figure.subplots(1, 2)
        _draw(left, frames, rebound, rebound.place)
        ratio = rebound.outgoing.value / rebound.incoming.value
        error = np.hypot(rebound.outgoing.error, rebound.incoming.error) / rebound.incoming.value
        left.set_title(
            f'A rebound: {1e3 * rebound.incoming.value:.2f} to the wall, '
            f'{1e3 * rebound.outgoing.value:.2f} mm/s from it\n'
            f'ratio {ratio:.3f} ± {error:.3f} (true: {_WALLS}); filled: before',
        )
        _draw(right, frames, pair, pair.place + 0.5 * pair.separation)
        first_centre, second_centre = pair.place, pair.place + pair.separation
        right.plot(
            *(np.array([first_centre, second_centre]) * METRE_PX - 0.5).T,
            '-',
            color='black',
            lw=1.5,
        )
        normal = pair.separation / np.hypot(*pair.separation)
        approach, parting = (
            1e3 * abs(float((velocity[1] - velocity[0]) @ normal))
            for velocity in (pair.before, pair.after)
        )
        apart = np.hypot(*pair.separation) / pair.radii.sum()
        right.set_title(
            f'A collision: {approach:.2f} and {parting:.2f} mm/s along the line\n'
            f'of centres, {apart:.3f} diameters apart; filled: before',
        )


if __name__ == '__main__':
    write(Path(sys.argv[1] if len(sys.argv) > 1 else 'docs/pictures'))
