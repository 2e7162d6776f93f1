"""Tracks made by hand, in the formats of the programs people use."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.studies.calibration.manual_tracks import read_manual_tracks

PLAIN = """frame,id,x,y
0,1,10.5,20.5
0,2,30,40
1,1,11.5,21
"""
TRACKMATE = """LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,RADIUS
Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,Radius
Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,R
,,,(quality),(pixel),(pixel),(pixel),(sec),,(pixel)
ID10,10,1,5.0,10.5,20.5,0,0,0,2.5
ID11,11,2,5.0,30,40,0,0,0,2.5
ID12,12,1,5.0,11.5,21,0,0.03,1,2.5
ID13,13,,5.0,99,99,0,0.03,1,2.5
"""
MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<TrackMate version="7.11.1"><Model spatialunits="pixel" timeunits="sec">
<AllSpots nspots="4"><SpotsInFrame frame="0">
<Spot ID="10" FRAME="0" POSITION_X="10.5" POSITION_Y="20.5" />
<Spot ID="11" FRAME="0" POSITION_X="30" POSITION_Y="40" /></SpotsInFrame>
<SpotsInFrame frame="1"><Spot ID="12" FRAME="1" POSITION_X="11.5" POSITION_Y="21" />
<Spot ID="13" FRAME="1" POSITION_X="30" POSITION_Y="40" /></SpotsInFrame></AllSpots>
<AllTracks><Track TRACK_ID="1"><Edge SPOT_SOURCE_ID="10" SPOT_TARGET_ID="12" /></Track>
<Track TRACK_ID="2"><Edge SPOT_SOURCE_ID="11" SPOT_TARGET_ID="13" /></Track></AllTracks>
</Model></TrackMate>
"""
EXPORTED = """<?xml version="1.0" encoding="UTF-8"?>
<Tracks nTracks="2" spaceUnits="pixel" frameInterval="0.03" timeUnits="sec">
<particle nSpots="2"><detection t="0" x="10.5" y="20.5" z="0" />
<detection t="1" x="11.5" y="21" z="0" /></particle>
<particle nSpots="1"><detection t="0" x="30" y="40" z="0" /></particle></Tracks>
"""
SPOTLIGHT = """Spotlight tracking results
Frame   X1      Y1      X2      Y2
0       10.5    20.5    30.0    40.0
1       11.5    21.0    30.0    40.0
"""


def _first_bead(tmp_path, text, name='tracks.txt'):
    path = tmp_path / name
    path.write_text(text, encoding='utf-8')
    tracks = read_manual_tracks(path)
    first = np.unique(tracks.ids)[0]
    of_first = tracks.ids == first
    return tracks, tracks.frames[of_first].tolist(), tracks.places[of_first].tolist()


@pytest.mark.parametrize('text', [PLAIN, TRACKMATE, MODEL, EXPORTED, SPOTLIGHT])
def test_every_format_gives_the_same_bead(tmp_path, text):
    tracks, frames, positions = _first_bead(tmp_path, text)
    assert frames == [0, 1]
    assert positions == [[10.5, 20.5], [11.5, 21.0]]
    assert np.unique(tracks.ids).size == 2


def test_a_table_between_tabs_or_semicolons_or_with_a_byte_order_mark_is_read(tmp_path):
    for mark in '\t;':
        _, frames, _ = _first_bead(tmp_path, '\ufeff' + PLAIN.replace(',', mark))
        assert frames == [0, 1]


def test_a_table_without_a_column_of_beads_is_of_one_bead(tmp_path):
    tracks, _, _ = _first_bead(tmp_path, 'frame x y\n3 1 2\n4 2 3\n')
    assert tracks.ids.tolist() == [0, 0]
    assert tracks.frames.tolist() == [3, 4]


def test_our_own_table_is_no_table_of_pixels_but_numbers_are(tmp_path):
    tracks, _, _ = _first_bead(tmp_path, '# made by hand\n0 1.5 2.5\n1 1.75 2.5\n')
    assert tracks.places.tolist() == [[1.5, 2.5], [1.75, 2.5]]


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', 'holds no track'),
        ('frame,id,x,y\n', 'holds no track'),
        (PLAIN + '1,1,5,5\n', 'bead 1 is twice in frame 1'),
        (PLAIN + '2,1,nan,5\n', ':5: frame 2'),
        (PLAIN + '2.5,1,3,5\n', ':5: frame 2.5'),
        (PLAIN + '2,1,left,5\n', ':5: .*is no row'),
        ('0 1 2 3\n', ':1: 4 numbers'),
        ('<html></html>', '<html> is not of TrackMate'),
        ('<TrackMate>', 'not XML'),
        (MODEL.replace('POSITION_X="30" ', ''), 'lacks or garbles'),
        (MODEL.replace('"pixel"', '"micron"'), 'places are in micron'),
        (EXPORTED.replace('"pixel"', '"mm"'), 'places are in mm'),
        (TRACKMATE.replace('(pixel)', '(mm)'), 'places are in mm'),
    ],
)
def test_what_cannot_be_used_is_named_with_its_line(tmp_path, text, message):
    path = tmp_path / 'bad.txt'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(RecordingError, match=message) as caught:
        read_manual_tracks(path)
    assert '\n' not in str(caught.value)


def test_a_file_that_is_not_there_or_not_text_is_refused(tmp_path):
    with pytest.raises(RecordingError, match='No such file'):
        read_manual_tracks(tmp_path / 'none.csv')
    (tmp_path / 'picture.csv').write_bytes(b'\x89PNG\xff\xfe')
    with pytest.raises(RecordingError, match='not UTF-8'):
        read_manual_tracks(tmp_path / 'picture.csv')
