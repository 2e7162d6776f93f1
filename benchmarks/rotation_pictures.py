"""The picture of docs/method/rotation.md, by ``python -m benchmarks.rotation_pictures FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks import rough_gas as gas
from benchmarks import rough_sharing as energy
from benchmarks.rotation import NOISE, RUNS, SEEDS, STEP, TIMES, TOGETHER, curves
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import (
    BLUE,
    GREEN,
    ORANGE,
    TWO_COLUMNS,
    VERMILION,
    plain_numbers,
)
from nanorocks_ros.physics.paper_formulas import RELATIVE_TO_MEAN_SPEED
from nanorocks_ros.physics.rough_spheres import temperature_ratio_course

COLOURS = (BLUE, VERMILION, ORANGE, GREEN)
CASES = (gas.SMOOTH, gas.SMOOTH_WALLS, gas.BEADS, gas.RUBBING)
SHARING_TIMES = np.linspace(0.0, 20.0, 41)
CYCLES = 6
FRICTIONS = (0.0, 0.03, 0.1, 0.25)
EDGES = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 14.0]) * 1e-3


def main(folder):
    """Write rotation.png."""
    with figure_file(Path(folder) / 'rotation.png', TWO_COLUMNS, 150.0) as figure:
        axes = figure.subplots(2, 2)
        _bulk(axes[0, 0])
        _tray(axes[0, 1])
        _widths(axes[1, 0])
        _readings(axes[1, 1])
        for panel in axes.flat:
            panel.grid(alpha=0.25)


def _bulk(axes):
    for tangential, colour in zip((0.5, 0.0, -0.5), COLOURS, strict=False):
        collisions, ratio = energy.bulk_course(gas.PAIRS, tangential, SEEDS)
        collision_counts = np.linspace(0.0, 40.0, 200)
        axes.plot(
            collision_counts,
            temperature_ratio_course(collision_counts, gas.PAIRS, tangential),
            color=colour,
            label=f'β = {tangential:g}'.replace('-', '−'),
        )
        axes.plot(collisions, ratio, '.', ms=5, color=colour)
    axes.set_xlim(0.0, 40.0)
    axes.set_ylim(0.0)
    axes.set_xlabel('collisions of each bead')
    axes.set_ylabel('rotation over translation')
    axes.set_title('500 beads without walls; lines: theory')
    axes.legend()


def _tray(axes):
    for rough, colour in zip(CASES[1:], COLOURS[1:], strict=False):
        ratio = energy.sharing(1, rough, SHARING_TIMES, 120).ratio[0]
        axes.plot(SHARING_TIMES, ratio, color=colour, label=rough.name)
    axes.axhline(1.0, color='black', lw=0.7)
    axes.set_xlabel('time since shaking [s]')
    axes.set_ylabel('rotation over translation')
    axes.set_ylim(0.0)
    axes.set_title('tray 1, started without rotation')
    axes.legend()


def _widths(axes):
    tray = load_trays()[1]
    middle = np.sqrt(EDGES[:-1] * EDGES[1:]) * 1e3
    for rough, colour in zip(CASES, COLOURS, strict=True):
        speeds = gas.speeds_of(1, rough, TIMES, RUNS)
        for noise, style, name in ((0.0, '-', rough.name), (NOISE, '--', None)):
            means = curves(speeds, TOGETHER, 0.0, noise)
            values, speed = gas.paper_values(means, STEP, tray)
            axes.plot(middle, gas.spread(values, speed, EDGES)[1], style, color=colour, label=name)
    axes.axvline(5.0, color='black', lw=0.7, ls=':')
    axes.set_xscale('log')
    axes.set_yscale('log')
    plain_numbers(axes.xaxis)
    axes.set_xlabel(f'collision speed, {RELATIVE_TO_MEAN_SPEED:g} v [mm/s]')
    axes.set_ylabel("half width (68 %) of the paper's COR")
    axes.set_title(f'tray 1, {TOGETHER} cycles; dashed: 0.1 mm/s of noise')
    # Room for the legend below.
    axes.set_ylim(3e-4)
    opaque = {'frameon': True, 'framealpha': 1.0, 'edgecolor': 'none'}
    axes.legend(loc='lower left', ncols=2, columnspacing=0.8, **opaque)


def _readings(axes):
    for number, marker in ((1, 'o'), (3, 's')):
        readings = [
            gas.read_cycles(
                number, gas.Roughness(tangential=0.4 if mu else -1.0, friction=mu), CYCLES
            )
            for mu in FRICTIONS
        ]
        for colour, text, values in (
            (COLOURS[1], 'decay', [reading[0]['walls known'].mean[0] for reading in readings]),
            (COLOURS[0], 'both', [reading[0]['all'].mean[0] for reading in readings]),
            (COLOURS[3], 'contacts', [reading[1][4] for reading in readings]),
        ):
            label = f'tray {number}: {text}'
            axes.plot(FRICTIONS, values, f'{marker}-', color=colour, label=label)
    axes.axhline(gas.PAIRS, color='black', lw=0.7)
    # Room for the legend above.
    axes.set_ylim(0.0, 1.35)
    axes.set_xlabel('friction μ of beads and walls, β = 0.4')
    axes.set_ylabel('restitution of the beads as read')
    axes.set_yticks([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    axes.set_title('rough beads taken for smooth; line: truth')
    axes.legend(ncols=2)


if __name__ == '__main__':
    main(sys.argv[1] if len(sys.argv) > 1 else 'docs/pictures')
