"""The pictures of a film that go into a bag are those of the film, in true proportions."""

from __future__ import annotations

from fractions import Fraction

import cv2
import pytest
from videos import HEIGHT, START_NS, WIDTH, imported, picture, write_images

from nanorocks_ros.study.films import ImportSettings

TIMED = ImportSettings(start_ns=START_NS, rate=Fraction(25))


# --- folders of images ----------------------------------------------------------------------


@pytest.mark.parametrize('ending', ['jpg', 'png', 'bmp'])
@pytest.mark.parametrize('size', [(WIDTH // 2, HEIGHT // 2), (HEIGHT, WIDTH), (WIDTH, 2 * HEIGHT)])
def test_images_of_another_size_are_left_out_and_counted(tmp_path, ending, size):
    folder = write_images(tmp_path / 'images', [f'{k}.{ending}' for k in range(6)])
    cv2.imwrite(str(folder / f'2.{ending}'), cv2.resize(picture(2), size))
    found, numbers, times = imported(folder, tmp_path / 'bag', TIMED)
    assert numbers == [0, 1, 3, 4, 5]
    assert times == [0, 40, 120, 160, 200]
    assert found.broken == 1
    assert any('1 frames are damaged or of another size' in one for one in found.notices)
