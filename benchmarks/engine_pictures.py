"""Draw a cooling gas and a gas that sticks: ``python -m benchmarks.engine_pictures [FOLDER]``.

Writes cooling_gas.png and clusters.png for the documentation, into docs/pictures or FOLDER.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LogNorm
from scipy.optimize import curve_fit

from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import BLACK, FITTED, MAP, SERIES, SKY, TWO_COLUMNS
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

_MM = 1e3
_RADIUS = 0.001
_MASS = 4.94e-6
_MEAN_SPEED = 0.007
# Tray 1 and its restitutions.
_TRAY = (0.015, 0.015, 0.003)
_BEADS = 15
_RULES = {'restitution': 0.89, 'wall_restitution': 0.99}
_RUNS = 60
_PICTURES = Path(__file__).parents[1] / 'docs/pictures'
_MOMENTS = (0.5, 5.0, 30.0)
_TRAIL = 0.4
# The gas is in Haff's decay from here on, [s].
_FIT_FROM = 1.75

_WIDE_TRAY = (0.05, 0.05, 0.003)
_STICKY_BEADS = 200
_STICKING_SPEED = 0.002
_STICKY_MOMENTS = (0.5, 6.0, 20.0)


def main() -> None:
    """Draw both."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else _PICTURES
    with figure_file(folder / 'cooling_gas.png', TWO_COLUMNS, 75.0) as figure:
        cooling_gas(figure)
    with figure_file(folder / 'clusters.png', TWO_COLUMNS, 70.0) as figure:
        clusters(figure)


def shaken(box, count, seed, **rules):
    """Beads at random places in a box, speeds even from 0 to twice the mean, all directions."""
    rng = np.random.default_rng(seed)
    places = np.empty((0, 3))
    free = np.array(box) - 2.0 * _RADIUS
    while len(places) < count:
        place = _RADIUS + free * rng.random(3)
        if not len(places) or np.linalg.norm(places - place, axis=1).min() > 2.0 * _RADIUS:
            places = np.vstack((places, place))
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, np.newaxis]
    beads = Beads(
        radii=np.full(count, _RADIUS),
        masses=np.full(count, _MASS),
        positions=places,
        velocities=2.0 * _MEAN_SPEED * rng.random((count, 1)) * directions,
    )
    return HardSphereGas(beads, CollisionRules(box=box, **rules))


def cooling_gas(figure):
    """Tray 1 at three moments; the mean speed of many runs, their mean, and Haff's law."""
    left, right = figure.subfigures(1, 2, width_ratios=(1.6, 1.0))
    _draw_moments(left)
    _draw_decay(right.subplots())


def _draw_moments(figure):
    panels = figure.subplots(1, len(_MOMENTS), sharey=True)
    gas = shaken(_TRAY, _BEADS, 3, **_RULES)
    times = np.arange(0.0, _MOMENTS[-1] + 0.01, 0.02)
    course = gas.follow(times[-1], times)
    norm = LogNorm(0.5, 15.0)
    for panel, moment in zip(panels, _MOMENTS, strict=True):
        k = int(np.searchsorted(times, moment - 1e-9))
        speeds = np.linalg.norm(course.velocities[k], axis=1) * _MM
        first = max(k - round(_TRAIL / 0.02), 0)
        trails = np.moveaxis(course.positions[first : k + 1, :, :2] * _MM, 0, 1)
        colours = mpl.colormaps[MAP](norm(speeds))
        panel.add_collection(LineCollection(trails, colors=colours, linewidths=1.6, alpha=0.6))
        _discs(panel, course.positions[k], colours)
        _frame(panel, _TRAY, f't = {moment:g} s: {speeds.mean():.1f} mm/s')
    panels[0].set_ylabel('y [mm]')
    colours = mpl.cm.ScalarMappable(norm, MAP)
    bar = figure.colorbar(colours, ax=panels, location='bottom', shrink=0.5, aspect=35)
    bar.set_label('speed of a bead [mm/s]')
    bar.set_ticks([0.5, 1, 2, 5, 10], labels=['0.5', '1', '2', '5', '10'])
    bar.minorticks_off()


def _discs(panel, positions, colours):
    """Beads seen from above, the upper ones over the lower ones."""
    order = np.argsort(positions[:, 2])
    size = 2.0 * _RADIUS * _MM
    panel.add_collection(
        EllipseCollection(
            size,
            size,
            0.0,
            units='xy',
            offsets=positions[order, :2] * _MM,
            offset_transform=panel.transData,
            facecolors=colours[order],
            edgecolors='black',
            linewidths=0.5,
        )
    )


def _frame(panel, box, title):
    panel.set(xlim=(0, box[0] * _MM), ylim=(0, box[1] * _MM), aspect='equal', xlabel='x [mm]')
    panel.set_title(title, fontsize=7.5)
    ticks = np.linspace(0.0, box[0] * _MM, 4 if box[0] < 0.02 else 6)
    panel.set(xticks=ticks, yticks=ticks)
    panel.spines[:].set_visible(True)
    panel.tick_params(length=2)


def _haff(time, speed, tau):
    return np.log(speed / (1.0 + time / tau))


def _draw_decay(panel):
    times = np.geomspace(0.05, 100.0, 120)
    gases = (shaken(_TRAY, _BEADS, seed, **_RULES) for seed in range(_RUNS))
    speeds = np.array([gas.follow(times[-1], (), times).observations.mean_speed for gas in gases])
    mean = speeds.mean(axis=0)
    used = times >= _FIT_FROM
    (speed, tau), _ = curve_fit(_haff, times[used], np.log(mean[used]), (_MEAN_SPEED, 5.0))
    panel.loglog(times, speeds.T * _MM, color=SKY, linewidth=0.7, zorder=1)
    panel.loglog([], [], color=SKY, linewidth=0.7, label=f'{_RUNS} runs of {_BEADS} beads')
    panel.loglog(times, mean * _MM, color=BLACK, linewidth=2.0, label='their mean')
    panel.loglog(
        times,
        np.exp(_haff(times, speed, tau)) * _MM,
        color=FITTED,
        linestyle='--',
        label=f'Haff: {speed * _MM:.2f} mm/s, {tau:.2f} s',
    )
    panel.set(xlabel='time since shaking [s]', ylabel='mean speed [mm/s]', xlim=times[[0, -1]])
    panel.xaxis.set_major_formatter('{x:g}')
    panel.yaxis.set_major_formatter('{x:g}')
    panel.legend(loc='lower left')
    panel.set_title('tray 1, restitution 0.89, walls 0.99')


def clusters(figure):
    """A gas that sticks, at three moments, each body of two beads or more in a colour."""
    panels = figure.subplots(1, len(_STICKY_MOMENTS), sharey=True)
    gas = shaken(_WIDE_TRAY, _STICKY_BEADS, 5, sticking_speed=_STICKING_SPEED, **_RULES)
    course = gas.follow(_STICKY_MOMENTS[-1], _STICKY_MOMENTS)
    for k, (panel, moment) in enumerate(zip(panels, _STICKY_MOMENTS, strict=True)):
        sizes = np.bincount(course.bodies[k], minlength=_STICKY_BEADS)
        _discs(panel, course.positions[k], _body_colours(course.bodies[k], sizes))
        counted = f'{np.count_nonzero(sizes)} bodies, up to {sizes.max()} beads'
        _frame(panel, _WIDE_TRAY, f't = {moment:g} s: {counted}')
    panels[0].set_ylabel('y [mm]')
    figure.suptitle(
        f'{_STICKY_BEADS} beads that stick below {_STICKING_SPEED * _MM:g} mm/s; '
        'single beads white, each body in its colour',
        x=0.01,
        ha='left',
    )


def _body_colours(bodies, sizes):
    """Colours by the number of the body, by which it keeps its colour; single beads white."""
    palette = np.array([mpl.colors.to_rgb(colour) for colour in SERIES])
    colours = palette[bodies % len(SERIES)]
    colours[sizes[bodies] == 1] = 1.0
    return colours


if __name__ == '__main__':
    main()
