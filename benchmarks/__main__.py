"""``python -m benchmarks [NAME ...]``: run the benchmarks, all or those named.

``python -m benchmarks golden [OPTION ...]`` is a check, not a measurement; see its ``--help``.
``python -m benchmarks fuzz [OPTION ...]`` damages every kind of input; see its ``--help``.
``python -m benchmarks kills [OPTION ...]`` kills jobs at random instants and resumes them.
``python -m benchmarks signals [OPTION ...]`` interrupts recordings at random instants.
``python -m benchmarks structure [COMMIT]`` counts modules and lines.
``python -m benchmarks documented OUTPUT ... [--renew]`` compares the documentation with what
benchmarks printed.
"""

from __future__ import annotations

import sys
from importlib import import_module

from benchmarks import documented, fuzz, golden, kills, signals, structure

ALL = (
    'cold_start',
    'offline',
    'offline_profile',
    'compiled_calls',
    'batch',
    'live',
    'live_plate',
    'dashboard',
    'recordings',
    'preprocess',
    'scale',
    'moving_camera',
    'scene',
    'drawn_cameras',
    'tracking',
    'recognition',
    'plate_cost',
    'recorder',
    'foreign_world',
    'collision_truth',
    'altered_films',
    'ranks',
    'contacts_alone',
    'short_films',
    'lab_films',
    'lit_beads',
    'own_tray',
    'oblique',
    'python_interface',
    'radii',
    'found_sizes',
    'speed_trays',
    'speed_grains',
    'speed_accuracy',
    'area_calibration',
    'autocorrelation',
    'deflections',
    'cor_recovery',
    'valley',
    'swinging_trays',
    'species_decays',
    'closed_forms',
    'contacts',
    'sticking',
    'sticking_films',
    'drawn_sticking',
    'turning_bodies',
    'rotating_aggregates',
    'stuck_restitution',
    'packing',
    'rotation',
    'decay_libraries',
    'friction_films',
    'drawn_friction',
    'speed_dependence',
    'speed_headlines',
    'drawn_exponents',
    'combined_physics',
    'sensitivity',
    'gas_statistics',
    'engine',
    'engine_physics',
    'reproduction_kills',
    'validation',
)


def main() -> int:
    """Run each benchmark and print its report, or one of the six checks."""
    if sys.argv[1:2] == ['documented']:
        return documented.main(sys.argv[2:])
    if sys.argv[1:2] == ['golden']:
        return golden.main(sys.argv[2:])
    if sys.argv[1:2] == ['fuzz']:
        return fuzz.main(sys.argv[2:])
    if sys.argv[1:2] == ['kills']:
        return kills.main(sys.argv[2:])
    if sys.argv[1:2] == ['signals']:
        return signals.main(sys.argv[2:])
    if sys.argv[1:2] == ['structure']:
        structure.report(*sys.argv[2:3])
        return 0
    names = sys.argv[1:] or ALL
    unknown = [name for name in names if name not in ALL]
    if unknown:
        print(
            f'benchmarks: unknown {", ".join(unknown)}; choose from {", ".join(ALL)}',
            file=sys.stderr,
        )
        return 2
    for name in names:
        module = import_module(f'benchmarks.{name}')
        print(f'\n## {name}: {module.__doc__.splitlines()[0]}\n', flush=True)
        module.report()
    return 0


if __name__ == '__main__':
    sys.exit(main())
