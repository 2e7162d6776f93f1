"""Pictures of beads on a textured floor, as a camera and a codec show them."""

from __future__ import annotations

import io

import av
import cv2
import numpy as np

from nanorocks_ros.records import TrayImage

NS = 1_000_000_000
SIDE = 160


def places(times, speeds, *, count=12, seed=1):
    """Places of beads that fly straight between walls, (frames, beads, 2), [px].

    `speeds`: [px/s] at each of the times.
    """
    rng = np.random.default_rng(seed)
    start = rng.uniform(0, SIDE, (count, 2))
    angles = rng.uniform(0, 2 * np.pi, count)
    pace = rng.uniform(0.6, 1.4, count)
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * pace[:, None]
    path = np.concatenate([[0.0], np.cumsum(np.diff(times) * np.asarray(speeds)[1:])])
    flown = start + path[:, None, None] * direction
    return 8 + (SIDE - 16) * (1 - np.abs(1 - (flown / (SIDE - 16)) % 2))


def pictures(positions, *, radius=7.0, noise=1.5, gains=None, floor=90.0, seed=2):
    """Gray pictures of dark beads with a highlight on a lighter, textured floor."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.normal(0, 12, (SIDE, SIDE)), (0, 0), 2) + floor
    for number, beads in enumerate(positions):
        image = texture.copy()
        for bead_x, bead_y in beads:
            left, top = (max(0, int(place - radius - 2)) for place in (bead_x, bead_y))
            part = image[top : int(bead_y + radius + 3), left : int(bead_x + radius + 3)]
            y, x = np.mgrid[top : top + part.shape[0], left : left + part.shape[1]]
            cover = np.clip(radius + 0.5 - np.hypot(x - bead_x, y - bead_y), 0, 1)
            part += cover * (35.0 - part)
            light = np.hypot(x - bead_x + 0.3 * radius, y - bead_y + 0.3 * radius)
            part += np.clip(0.25 * radius + 0.5 - light, 0, 1) * (180.0 - part)
        image *= 1.0 if gains is None else gains[number]
        image += rng.normal(0, noise, image.shape)
        yield np.clip(image, 0, 255).astype(np.uint8)


def jittered(grays, spread, returns, seed=3):
    """The pictures as a camera that jitters sees them; it comes back at the frames `returns`."""
    rng = np.random.default_rng(seed)
    across = down = 0.0
    for number, gray in enumerate(grays):
        if number not in returns:
            across, down = rng.normal(0.0, spread, 2)
        shift = np.float32([[1, 0, across], [0, 1, down]])
        yield cv2.warpAffine(gray, shift, gray.shape[::-1], borderMode=cv2.BORDER_REFLECT)


def encoded(grays, codec, rate=30, **options):
    """The pictures as a codec gives them back."""
    grays, file = list(grays), io.BytesIO()
    with av.open(file, 'w', format='matroska') as container:
        stream = container.add_stream(codec, rate=rate, options=options)
        stream.height, stream.width = grays[0].shape
        stream.pix_fmt = 'yuvj420p' if codec == 'mjpeg' else 'yuv420p'
        for gray in grays:
            frame = av.VideoFrame.from_ndarray(np.repeat(gray[..., None], 3, 2), format='bgr24')
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    file.seek(0)
    with av.open(file) as container:
        return [
            frame.to_ndarray(format='bgr24')[..., 1].copy() for frame in container.decode(video=0)
        ]


def images(grays, times):
    """The pictures as images of tray 1 whose cycle is not known."""
    return [
        TrayImage(stamp_ns=round(time * NS), tray=1, gray=gray)
        for time, gray in zip(times, grays, strict=True)
    ]
