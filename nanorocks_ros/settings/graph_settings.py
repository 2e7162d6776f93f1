"""Settings of the node graph: sources, playback, recording, live page."""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.settings.setting_fields import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSettings:
    """Which camera topic a node listens to."""

    transport: str = setting(
        'raw',
        'raw: camera/image_raw, compressed: camera/image_raw/compressed',
        choices=('raw', 'compressed'),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PacingSettings:
    """How fast and how long frames are given out."""

    rate: float = setting(
        1.0,
        'seconds of recording per second; 0: as fast as the nodes of the graph keep up',
        low=0.0,
        high=1000.0,
    )
    duration: float = setting(
        0.0, 'give out so much of the recording; 0: all that there is', 's', low=0.0, high=1e6
    )
    listeners: int = setting(
        0,
        'nodes that take the camera, or the tray images made of it, to wait for before the first '
        'frame',
        low=0,
        high=100,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BagSettings:
    """Which bag is played, and which part of it."""

    bag: str = setting('', 'path of the bag to play')
    start: float = setting(
        0.0, 'begin so long after the first message of the bag', 's', low=0.0, high=1e7
    )
    loop: bool = setting(False, 'start again at the end of the part that is played')


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayerSettings:
    """What is played of a bag, and where in it the player is."""

    results: bool = setting(
        True,
        'play what an earlier analysis found, too; false where a graph works it out again',
    )
    paused: bool = setting(False, 'wait at the start until told to go on')
    position: float = setting(
        0.0,
        'begin, or when set later jump to, so long after the first message',
        's',
        low=0.0,
        high=1e7,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings:
    """Where the frames of the composed pipeline come from."""

    source: str = setting(
        'simulator',
        'where the frames come from',
        choices=('simulator', 'bag', 'topic'),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkSettings:
    """How the work of the composed pipeline is shared out."""

    workers: int = setting(
        -1,
        'processes that follow the trays; 0: none, a thread does; -1: for several trays as many '
        'as there are cores besides one, up to four',
        low=-1,
        high=64,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSettings:
    """What the composed pipeline records while it works."""

    record: str = setting(
        '', 'path of a new bag for the camera and all results; empty: nothing is recorded'
    )
    record_quality: int = setting(
        95, 'JPEG quality of frames that do not come compressed', low=1, high=100
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardSettings:
    """Where and how the live page is served."""

    host: str = setting(
        '127.0.0.1',
        'address to listen on; one that other machines can reach is served with a token only',
    )
    port: int = setting(8321, 'port to listen on; 0: any that is free', low=0, high=65535)
    token: str = setting(
        '',
        'what a browser must know, 12 characters or more; empty: that of the environment variable '
        'NANOROCKS_DASHBOARD_TOKEN, else none on a loopback address, and elsewhere one that is '
        'made up and printed',
    )
    picture_rate: float = setting(
        8.0, 'pictures of a tray a browser gets at most', '1/s', low=0.1, high=30.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardGraphSettings:
    """What the live page has to know of the graph that it shows."""

    trays_file: str = setting('', 'YAML file of trays; empty: the trays that were flown')
    parent: int = setting(
        0,
        'number of the process that started it, and that it ends with; 0: none',
        low=0,
        high=2**31 - 1,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LivePageSettings:
    """Whether the pipeline serves the live page."""

    dashboard: bool = setting(False, 'serve the live page, from a process of its own')
