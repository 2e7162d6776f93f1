"""Refuses tray images of a changed size, until the new size has come to stay."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import FrameError

if TYPE_CHECKING:
    from nanorocks_ros.records import TrayImage

# So many images of a new size in a row, and it is the size from then on.
_STAYS_AFTER = 10


class ImageSizeCheck:
    """Checks that all images of a tray have one size: stages compare them pixel by pixel.

    A new size that stays is accepted: the publisher was given other parameters.

    Parameters
    ----------
    where : str
        The topic, for errors.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._shape: tuple[int, ...] | None = None
        self._new_shape: tuple[int, ...] | None = None
        self._new_count = 0

    def has_changed(self, image: TrayImage) -> bool:
        """Whether the image is the first of a new size that has come to stay.

        Raises
        ------
        FrameError
            When the size differs from that of the images before, or in colour from that in gray.
        """
        shape = image.gray.shape
        if image.color is not None and image.color.shape[:2] != shape:
            raise FrameError(
                self._where,
                f'{_size(shape)} in gray, {_size(image.color.shape)} in colour',
                'publish both in one size',
            )
        if self._shape is None:
            self._shape = shape
        if shape == self._shape:
            self._new_count = 0
            return False
        self._new_count = self._new_count + 1 if shape == self._new_shape else 1
        self._new_shape = shape
        if self._new_count < _STAYS_AFTER:
            raise FrameError(
                self._where,
                f'the size changed from {_size(self._shape)} to {_size(shape)}',
                'publish all images in one size',
            )
        self._shape = shape
        return True


def _size(shape: tuple[int, ...]) -> str:
    return f'{shape[1]}x{shape[0]} px'
