"""Settings of the node graph: sources, playback, recording, live page.

Tested by ``test/settings/test_setting_fields.py``.
"""

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
    """Rate and duration of the playback."""

    rate: float = setting(
        1.0,
        'playback rate, in seconds of recording per second; 0: as fast as the nodes keep up',
        low=0.0,
        high=1000.0,
    )
    duration: float = setting(
        0.0, 'length of the part of the recording to play; 0: all of it', 's', low=0.0, high=1e6
    )
    listeners: int = setting(
        0,
        'number of nodes that must receive the camera or its tray images before the first frame '
        'is sent',
        low=0,
        high=100,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BagSettings:
    """The bag to play, and the part of it."""

    bag: str = setting('', 'path of the bag to play')
    start: float = setting(
        0.0, 'start of the playback, from the first message of the bag', 's', low=0.0, high=1e7
    )
    loop: bool = setting(False, 'start again at the end of the played part')


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayerSettings:
    """Content and position of the playback."""

    results: bool = setting(
        True,
        'also play the results of an earlier analysis; false if the graph computes them again',
    )
    paused: bool = setting(False, 'pause at the start')
    position: float = setting(
        0.0,
        'start of the playback, from the first message; set later: jump to it',
        's',
        low=0.0,
        high=1e7,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings:
    """Source of the frames of the composed pipeline."""

    source: str = setting(
        'simulator',
        'source of the frames',
        choices=('simulator', 'bag', 'topic'),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkSettings:
    """Processes of the composed pipeline."""

    workers: int = setting(
        -1,
        'number of processes for the trays; 0: a thread instead; -1: for several trays the number '
        'of cores less one, at most four',
        low=-1,
        high=64,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSettings:
    """Recording by the composed pipeline."""

    record: str = setting(
        '', 'path of a new bag for the camera and all results; empty: nothing is recorded'
    )
    record_quality: int = setting(
        95, 'JPEG quality of frames that arrive uncompressed', low=1, high=100
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardSettings:
    """Address and access of the live page."""

    host: str = setting(
        '127.0.0.1',
        'address to listen on; an address that other machines can reach requires a token',
        everyday=True,
        placeholder='ADDRESS',
    )
    port: int = setting(
        8321, 'port to listen on; 0: any free port', everyday=True, low=0, high=65535
    )
    token: str = setting(
        '',
        'access token for browsers, 12 characters or more; empty: the environment variable '
        'NANOROCKS_DASHBOARD_TOKEN; without it, none on a loopback address, and a random printed '
        'token on others',
        everyday=True,
        placeholder='TOKEN',
    )
    certificate: str = setting(
        '',
        'PEM file of the certificate chain, to serve the page by HTTPS; empty: by HTTP',
        placeholder='PEM',
    )
    private_key: str = setting(
        '',
        'PEM file of the private key of the certificate; empty: it is in the same file',
        placeholder='PEM',
    )
    picture_rate: float = setting(
        8.0, 'largest rate of images of a tray per browser', '1/s', low=0.1, high=30.0
    )
    kept_cycles: int = setting(
        20, 'finished cycles of each tray that can be opened again', low=0, high=200
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardGraphSettings:
    """Properties of the graph on the live page."""

    trays_file: str = setting('', 'YAML file of trays; empty: the trays of the flight')
    parent: int = setting(
        0,
        'process ID of the process that started the page and whose end stops it; 0: none',
        low=0,
        high=2**31 - 1,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LivePageSettings:
    """Whether the pipeline serves the live page."""

    dashboard: bool = setting(False, 'serve the live page, in a separate process')
