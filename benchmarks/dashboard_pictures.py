"""Take the pictures of the live page: ``python -m benchmarks.dashboard_pictures BAG [FOLDER]``.

Plays a film of the plate as fast as the pipeline follows, and writes
dashboard.png, dashboard_phone.png and dashboard_compare.png for the documentation into
docs/pictures or the given folder.
BAG is made by
``nanorocks simulate --scene --duration 32 --first-shake 0.5 --shake-period 20 --bag BAG``.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image

from benchmarks.live import start_node

_TRAY = 3
_AFTER_S = 18
_RATE = 0.0
_PATIENCE_S = 900.0
_DOMAIN = '60'
_WIDE = {'viewport': {'width': 1440, 'height': 900}, 'color_scheme': 'light'}
_PHONE = {'viewport': {'width': 390, 'height': 844}, 'color_scheme': 'dark'}
_PICTURES = (
    ('dashboard.png', f'#tray-{_TRAY}', _WIDE),
    ('dashboard_phone.png', f'#tray-{_TRAY}', _PHONE),
    ('dashboard_compare.png', '#compare', _WIDE),
)


def main() -> None:
    """Start the graph, wait until the gas has cooled, and take the pictures."""
    folder = Path(sys.argv[2] if len(sys.argv) > 2 else 'docs/pictures')
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = _DOMAIN
    pipeline = start_node(
        'pipeline', '--ros-args', '-p', 'source:=bag', '-p', f'bag:={sys.argv[1]}',
        '-p', f'rate:={_RATE}', '-p', f'trays:={list(range(1, 9))}',
        '-p', 'preprocess.layout:=plate', '-p', 'preprocess.pixels_per_metre:=12500.0',
        '-p', 'dashboard:=true', '-p', 'dashboard_port:=0',
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    url = re.findall(r'http://\S+', pipeline.stdout.readline())[0]
    try:
        _take(url, folder)
    finally:
        pipeline.send_signal(2)
        pipeline.wait(10)


def _take(url: str, folder: Path) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which('chromium'), args=['--no-sandbox', '--disable-gpu']
        )
        pages = []
        for name, view, options in _PICTURES:
            pages.append((name, browser.new_page(**options)))
            pages[-1][1].goto(f'{url}{view}')
        deadline = time.monotonic() + _PATIENCE_S
        while not _cooled(pages[0][1]) and time.monotonic() < deadline:
            time.sleep(0.5)
        for name, page in pages:
            page.screenshot(path=folder / name)
            # Reduces the size of the file in the repository.
            Image.open(folder / name).quantize(256).save(folder / name, optimize=True)
        browser.close()


def _cooled(page) -> bool:
    match = re.search(r'cooling for (\d+) s', page.locator('#state').text_content())
    return match is not None and int(match[1]) >= _AFTER_S


if __name__ == '__main__':
    main()
