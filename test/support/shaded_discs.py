"""Pictures of shaded spheres with known outlines, drawn by supersampling, blurred and coded."""

from __future__ import annotations

import io
from dataclasses import dataclass

import cv2
import numpy as np

SAMPLES = 8
"""Samples per pixel and axis."""
COLORS = {0: (42.0, 42.0, 182.0), 1: (165.0, 88.0, 52.0)}
FLOOR = (142.0, 147.0, 149.0)


@dataclass(frozen=True)
class Optics:
    """Light and camera of a picture.

    Parameters
    ----------
    ambient : float
        Brightness of the limb of a sphere in the shade over that of its lit middle.
    light : float, [rad]
        Direction to the lamp in the picture.
    shadow : float
        Darkening of the floor in the middle of a shadow.
    blur : float, [px]
        Standard deviation of the blur of the lens.
    streak : float, [px]
        Length of the motion during exposure, along columns.
    bayer : bool
        Whether the picture is mosaiced and demosaiced.
    highlight : float, [gray levels]
    codec : str
        `none`, `jpeg` or `h264`.
    """

    ambient: float = 0.4
    light: float = 0.8
    shadow: float = 0.3
    blur: float = 0.8
    streak: float = 0.0
    bayer: bool = False
    highlight: float = 60.0
    codec: str = 'jpeg'


def draw(shape, centres, radii, species, optics):
    """Linear picture of spheres, (rows, columns, 3), bgr, before noise and codec."""
    rows, columns = shape
    picture = np.empty((rows * SAMPLES, columns * SAMPLES, 3), dtype=np.float32)
    picture[:] = FLOOR
    y, x = np.mgrid[: rows * SAMPLES, : columns * SAMPLES].astype(np.float32)
    x, y = (x + 0.5) / SAMPLES, (y + 0.5) / SAMPLES
    shade = np.ones(picture.shape[:2], dtype=np.float32)
    toward = np.array([np.cos(optics.light), np.sin(optics.light)])
    for centre, radius in zip(centres, radii, strict=True):
        off = centre - 0.35 * radius * toward
        box = _box(off, 1.8 * radius, shape)
        distance = np.hypot(x[box] - off[0], y[box] - off[1]) / radius
        shade[box] *= 1.0 - optics.shadow * np.clip((1.35 - distance) / 0.5, 0.0, 1.0)
    picture *= shade[:, :, None]
    for centre, radius, kind in zip(centres, radii, species, strict=True):
        box = _box(centre, radius + 1.0, shape)
        dx, dy = (x[box] - centre[0]) / radius, (y[box] - centre[1]) / radius
        inside = dx * dx + dy * dy <= 1.0
        height = np.sqrt(np.clip(1.0 - dx * dx - dy * dy, 0.0, None))
        facing = np.clip(0.5 * (dx * toward[0] + dy * toward[1]) + 0.85 * height, 0.0, None)
        bright = optics.ambient + (1.0 - optics.ambient) * facing
        glint = optics.highlight * np.clip(facing, 0.0, 1.0) ** 40
        color = bright[:, :, None] * np.array(COLORS[kind], np.float32) + glint[:, :, None]
        picture[box] = np.where(inside[:, :, None], color, picture[box])
    return _seen(picture, optics)


def _box(centre, reach, shape):
    first = np.maximum(np.floor((centre - reach) * SAMPLES).astype(int), 0)
    last = np.ceil((centre + reach) * SAMPLES).astype(int)
    return np.s_[
        first[1] : min(last[1], shape[0] * SAMPLES), first[0] : min(last[0], shape[1] * SAMPLES)
    ]


def _seen(picture, optics):
    """Blur by motion, lens and pixels."""
    if optics.streak:
        length = max(round(optics.streak * SAMPLES), 1)
        picture = cv2.blur(picture, (length | 1, 1), borderType=cv2.BORDER_REPLICATE)
    if optics.blur:
        picture = cv2.GaussianBlur(
            picture, (0, 0), optics.blur * SAMPLES, borderType=cv2.BORDER_REPLICATE
        )
    size = picture.shape[1] // SAMPLES, picture.shape[0] // SAMPLES
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def film(pictures, optics, noise=1.5, seed=1):
    """Frames of uint8 of the pictures, with noise, after mosaic and codec."""
    rng = np.random.default_rng(seed)
    frames = [
        np.clip(picture + rng.normal(0.0, noise, picture.shape) + 0.5, 0, 255).astype(np.uint8)
        for picture in pictures
    ]
    if optics.bayer:
        frames = [_demosaiced(frame) for frame in frames]
    if optics.codec == 'jpeg':
        quality = [cv2.IMWRITE_JPEG_QUALITY, 90]
        return [cv2.imdecode(cv2.imencode('.jpg', frame, quality)[1], 1) for frame in frames]
    return _h264(frames) if optics.codec == 'h264' else frames


def _demosaiced(frame):
    mosaic = frame[:, :, 1].copy()
    mosaic[0::2, 0::2] = frame[0::2, 0::2, 2]
    mosaic[1::2, 1::2] = frame[1::2, 1::2, 0]
    return cv2.cvtColor(mosaic, cv2.COLOR_BayerRGGB2BGR)


def _h264(frames):
    import av

    buffer = io.BytesIO()
    with av.open(buffer, 'w', format='mp4') as container:
        stream = container.add_stream('libx264', rate=30, options={'crf': '20'})
        stream.height, stream.width = (side // 2 * 2 for side in frames[0].shape[:2])
        stream.pix_fmt = 'yuv420p'
        for frame in frames:
            cut = np.ascontiguousarray(frame[: stream.height, : stream.width])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(cut, format='bgr24')))
        container.mux(stream.encode())
    buffer.seek(0)
    with av.open(buffer) as container:
        return [frame.to_ndarray(format='bgr24') for frame in container.decode(video=0)]


def tray_of_discs(seed, shape=(136, 432), scale=13.5):
    """Places [px], radii [px] and species of the beads of tray 3, apart from each other."""
    rng = np.random.default_rng(seed)
    radii = np.concatenate([np.full(15, scale), rng.uniform(0.435, 0.59, 40) * scale])
    species = np.concatenate([np.zeros(15, int), np.ones(40, int)])
    centres = np.empty((0, 2))
    kept = []
    for k in range(radii.size):
        for _ in range(400):
            place = rng.uniform(radii[k] + 5, np.array(shape[::-1]) - radii[k] - 5)
            gap = np.hypot(*(centres - place).T) - radii[kept] - radii[k]
            if (gap > 7.0).all():
                centres, kept = np.vstack([centres, place]), [*kept, k]
                break
    return centres, radii[kept], species[kept]
