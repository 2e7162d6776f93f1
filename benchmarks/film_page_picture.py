"""Take the picture of the page of a film: ``python -m benchmarks.film_page_picture [FOLDER]``.

Runs `nanorocks tray --browse` on the film in bags/tray_1_sample, fills in what flew, and writes
film_page.png for the documentation into docs/pictures or the given folder.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

_COMMAND = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'
_BAG = 'bags/tray_1_sample'
# Corners of the inside in the picture, [px], and what flew in tray 1, by the fields of the page.
_FIELDS = {
    '#left': '3',
    '#top': '3',
    '#right': '205',
    '#bottom': '205',
    '#length': '15',
    '#width': '15',
    '#height': '3',
    '[data-field=material]': 'acrylic',
    '[data-field=diameter_mm]': '2',
    '[data-field=count]': '15',
}
_SIZE = {'width': 1160, 'height': 860}


def main() -> None:
    """Start the command, fill in the page, and take the picture."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else 'docs/pictures')
    with tempfile.TemporaryDirectory() as place:
        arguments = ['tray', _BAG, '--browse', '-o', f'{place}/mine.yaml']
        with subprocess.Popen(
            [sys.executable, '-c', _COMMAND, *arguments], stdout=subprocess.PIPE, text=True
        ) as command:
            address = re.search(r'http://[^;\s]+', command.stdout.readline())
            _take(address[0], folder / 'film_page.png')
            command.send_signal(2)


def _take(url: str, path: Path) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which('chromium'), args=['--no-sandbox', '--disable-gpu']
        )
        page = browser.new_page(viewport=_SIZE, color_scheme='light')
        page.goto(url)
        _wait(page)
        for field, text in _FIELDS.items():
            page.locator(field).fill(text)
        page.locator('#length').focus()
        page.wait_for_timeout(1000)
        _wait(page)
        page.screenshot(path=path)
        Image.open(path).quantize(128).save(path, optimize=True)
        browser.close()


def _wait(page) -> None:
    page.wait_for_function("() => link.innerText === 'recognised'", timeout=120_000)


if __name__ == '__main__':
    main()
