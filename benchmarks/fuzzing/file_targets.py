"""Damaged films, YAML, archives and tables."""

from __future__ import annotations

import hashlib
import json
import shutil
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.fuzzing.mutations import damaged, generator_of
from benchmarks.fuzzing.outcomes import CLEAN_ERROR, NO_CHECKSUM, SAME, SILENT, TOLD, Outcome
from nanorocks_ros import inference
from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.experiment.calibration_file import load_calibration
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.yaml_limits import load_yaml
from nanorocks_ros.inference.cluster_size.cluster_curve import load_curves
from nanorocks_ros.inference.decay.decay_library_file import load_library
from nanorocks_ros.outputs.npz_archive import read_archive, write_archive
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.recordings.film.video import Video
from nanorocks_ros.recordings.offered_qos import recorded_qos
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.studies.batch.bag_summary import read_summary
from nanorocks_ros.studies.sweeps.sweep_parts import COUNTS
from nanorocks_ros.studies.sweeps.sweep_plan import Axis
from nanorocks_ros.studies.sweeps.sweep_result import CURVES, Sweep

if TYPE_CHECKING:
    from collections.abc import Callable

_PACKAGE = Path(inference.__file__).parent
_FRAMES = 40
_CODECS = {'mkv': 'libx264', 'mp4': 'mpeg4', 'avi': 'mjpeg', 'ts': 'libx264'}


class Films:
    """Films of four containers, decoded frame by frame."""

    kind = 'films'

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._films = {name: _write_film(folder / f'film.{name}', name) for name in _CODECS}
        self._contents = {name: path.read_bytes() for name, path in self._films.items()}
        self._frames = {name: _film_frames(path)[0] for name, path in self._films.items()}

    def run(self, number: int) -> Outcome:
        name = tuple(_CODECS)[number % len(_CODECS)]
        content, damage = damaged(self._contents[name], generator_of(self.kind, number))
        path = self._films[name]
        path.write_bytes(content)
        try:
            frames, told = _film_frames(path)
        except NanorocksError as error:
            return Outcome(CLEAN_ERROR, name, damage, str(error))
        if told:
            return Outcome(TOLD, name, damage)
        return Outcome(SAME if frames == self._frames[name] else NO_CHECKSUM, name, damage)


def _write_film(path: Path, name: str) -> Path:
    import av

    random = np.random.default_rng(3)
    with av.open(str(path), 'w') as container:
        stream = container.add_stream(_CODECS[name], rate=30)
        stream.width, stream.height = 96, 64
        stream.pix_fmt = 'yuvj420p' if name == 'avi' else 'yuv420p'
        for number in range(_FRAMES):
            pixels = random.integers(90, 110, (64, 96, 3), dtype=np.uint8)
            pixels[20:30, number : number + 12] = 230
            frame = av.VideoFrame.from_ndarray(pixels, format='bgr24')
            frame.pts, frame.time_base = number, Fraction(1, 30)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def _film_frames(path: Path) -> tuple[list[Any], bool]:
    film = Video(path, threads=1)
    frames = []
    for frame in film.frames():
        picture = frame.picture
        pixels = picture.content if hasattr(picture, 'content') else picture.pixels().tobytes()
        frames.append((frame.time_ns, hashlib.sha256(pixels).hexdigest()))
    return frames, bool(film.damaged or film.losses)


class Texts:
    """YAML of every kind, damaged as text, and the bombs that are known."""

    kind = 'texts'

    def __init__(self, folder: Path) -> None:
        self._path = folder / 'text.yaml'
        trays = 'densities_g_cm3: {acrylic: 1.18}\ntrays:\n  1:\n    dimensions_mm: [15, 15, 3]\n'
        trays += '    species:\n      - {material: acrylic, diameter_mm: 2, count: 15}\n'
        lens = 'camera_info:\n  width: 640\n  height: 480\n  distortion_model: plumb_bob\n'
        lens += '  d: [0, 0, 0, 0, 0]\n  k: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n'
        lens += 'pixels_per_metre: 9000\ntrays:\n  1: [10, 10, 200, 200]\n'
        qos = '- {history: keep_last, depth: 7, reliability: reliable, durability: volatile}\n'
        self._readers: tuple[tuple[str, str, Callable[[Path], object]], ...] = (
            ('trays', trays, load_trays),
            ('calibration', lens, load_calibration),
            ('parameters', '/**:\n  ros__parameters:\n    a: {b: 1.5}\n', _load),
            ('metadata', 'rosbag2_bagfile_information: {version: 9, files: [a.mcap]}\n', _load),
            ('quality of service', qos, lambda path: recorded_qos(path.read_text('utf-8'))),
        )

    def run(self, number: int) -> Outcome:
        name, text, read = self._readers[number % len(self._readers)]
        random = generator_of(self.kind, number)
        if random.integers(4) == 0:
            content, damage = _bomb(text, random)
        else:
            content, damage = damaged(text.encode(), random)
        self._path.write_bytes(content)
        try:
            result = repr(read(self._path))
        except (NanorocksError, UnicodeDecodeError) as error:
            return Outcome(CLEAN_ERROR, name, damage, str(error))
        self._path.write_text(text)
        return Outcome(SAME if result == repr(read(self._path)) else NO_CHECKSUM, name, damage)


def _load(path: Path) -> object:
    return load_yaml(str(path), path.read_text('utf-8'))


def _bomb(text: str, random: np.random.Generator) -> tuple[bytes, str]:
    """Text that stands for more than it is."""
    levels, width = int(random.integers(5, 40)), int(random.integers(2, 30))
    bombs = {
        'aliases': '\n'.join(
            ['a0: &a0 [x]']
            + [f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * width)}]' for k in range(1, levels)]
        ),
        'nesting': '[' * 10 ** width.bit_length(),
        'digits': f'{text}a: {"9" * 10 ** min(width, 6)}',
        'itself': f'{text}a: &a [1, *a]',
        'merge': 'a: &a {b: 1}\n' + '\n'.join(f'k{k}: {{<<: *a}}' for k in range(10 * levels)),
        'mappings': '{a: ' * 10 ** min(width, 5),
    }
    name = tuple(bombs)[int(random.integers(len(bombs)))]
    return bombs[name].encode(), name


class Results:
    """Archives, tables and JSON that commands write and read back."""

    kind = 'results'

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        shutil.copy(_PACKAGE / 'decay' / 'libraries' / 'tray_1.npz', folder / 'library.npz')
        shutil.copy(_PACKAGE / 'cluster_size' / 'cluster_curves.npz', folder / 'curves.npz')
        _write_sweep(folder / 'sweep.npz')
        names, rows = ('time', 'size'), [(0.1 * k, float(k)) for k in range(80)]
        write_csv(folder / 't.csv', float_columns(names, ('s', 'm')), rows)
        (folder / 'summary.json').write_text(json.dumps({'format': 1, 'trays': {}, 'bag': 'x'}))
        self._readers: tuple[tuple[str, Callable[[Path], object]], ...] = (
            ('sweep.npz', read_archive),
            ('sweep.npz', Sweep.load),
            ('library.npz', lambda path: load_library.__wrapped__(str(path), packaged=False)),
            ('curves.npz', lambda path: load_curves.__wrapped__(str(path), packaged=False)),
            ('t.csv', lambda path: read_columns(path, ('time',))),
            ('summary.json', lambda path: read_summary(path.parent)),
        )
        self._contents = {name: (folder / name).read_bytes() for name, _ in self._readers}

    def run(self, number: int) -> Outcome:
        name, read = self._readers[number % len(self._readers)]
        random = generator_of(self.kind, number)
        path, whole = self._folder / name, self._contents[name]
        checked = name.endswith('.npz')
        if checked and random.integers(2):
            checked = False
            damage = _exchange_array(path, random)
        else:
            content, damage = damaged(whole, random)
            path.write_bytes(content)
        try:
            result = repr(read(path))
        except NanorocksError as error:
            return Outcome(CLEAN_ERROR, name, damage, str(error))
        finally:
            path.write_bytes(whole)
        if result == repr(read(path)):
            return Outcome(SAME, name, damage)
        return Outcome(SILENT if checked else NO_CHECKSUM, name, damage)


def _write_sweep(path: Path) -> None:
    """A sweep of the right form with made-up curves."""
    times, shape = np.linspace(0.0, 1.0, 5), (2, 3)
    axes = {'restitution': [0.8, 0.9], 'wall_restitution': [0.9, 0.95, 0.99]}
    specification = json.dumps({'axes': axes, 'runs': 2, 'settings': {}})
    Sweep(
        axes=tuple(Axis(name=name, values=tuple(values)) for name, values in axes.items()),
        times=times,
        runs=2,
        specification=specification,
        **{name: np.ones((*shape, 5)) for name in CURVES},
        **{name: np.ones(shape, dtype=np.int64) for name in COUNTS},
    ).save(path)


def _exchange_array(path: Path, random: np.random.Generator) -> str:
    """Write an archive whose checksums are right and whose arrays are not those of its kind."""
    arrays = read_archive(path)
    name = tuple(arrays)[int(random.integers(len(arrays)))]
    array = arrays[name]
    others = {
        'missing': None,
        'empty': array[:0] if array.ndim else np.array([]),
        'scalar': np.array(1.5),
        'text': np.array('[' * 5000),
        'NaN': np.full(array.shape, np.nan),
        'transposed': array.T[..., None],
        'complex': np.ones(array.shape, dtype=np.complex128),
        'huge': np.full(array.shape, 1e300),
    }
    kind = tuple(others)[int(random.integers(len(others)))]
    other = others[kind]
    if other is None:
        del arrays[name]
    else:
        arrays[name] = other
    write_archive(path, arrays)
    return f'{kind} {name}'
