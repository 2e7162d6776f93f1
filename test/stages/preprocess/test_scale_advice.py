"""No scale is advised that the beads contradict."""

from __future__ import annotations

from dataclasses import replace

import pytest
from shared_films import first_picture

from nanorocks_ros.errors import FrameError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Frame
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.preprocess.scale_advice import scale_text
from nanorocks_ros.stages.scale.picture_scale import PictureScale

TOLD = PipelineSettings().preprocess


def test_edges_that_the_beads_contradict_are_not_advised():
    text = scale_text(
        replace(TOLD, pixels_per_metre=12000.0), 14467.0, PictureScale(13500.0, 0.005)
    )
    assert 'beads look as at 13500 px/m, not at 12000' in text
    assert 'pass --preprocess-pixels-per-metre 13500' in text
    assert 'set it to about that' not in text


def test_beads_that_fit_what_was_told_say_that_nothing_is_wrong():
    assert scale_text(TOLD, 14467.0, PictureScale(13550.0, 0.005)) == ''


@pytest.mark.parametrize('beads', [None, PictureScale(14500.0, 0.005)])
def test_edges_that_no_bead_contradicts_are_advised(beads):
    text = scale_text(TOLD, 14467.0, beads)
    assert 'the trays look as at 14467 px/m, not at 13500; set it to about that' in text


def test_a_tray_that_does_not_fit_is_refused_with_the_scale_of_its_beads():
    image = first_picture('b3_720')
    settings = with_values(PipelineSettings(), {'trays': (3,)}, 'test')
    stage = Preprocessor(settings, {3: load_trays()[3]}, 'cam')
    with pytest.raises(FrameError, match=r'pixels-per-metre (8[89]|9[01])\d\d$') as first:
        stage.push(Frame(stamp_ns=0, encoding='bgr8', image=image))
    with pytest.raises(FrameError) as second:
        stage.push(Frame(stamp_ns=1, encoding='bgr8', image=image))
    assert str(second.value) == str(first.value)
