"""``python -m nanorocks_ros.tools.docs_pages.site [ROOT [FOLDER]]``: the documentation as HTML.

Run in the source tree; needs the extra ``docs``. Any warning, such as that of a link to nowhere,
is an error. The last line tells the size of the site and how long it took.
"""

from __future__ import annotations

import shutil
import sys
import time
from pathlib import Path


def build(root: Path, folder: Path) -> int:
    """Build the site of a source tree from nothing; the exit code.

    Parameters
    ----------
    root : Path
        The source tree.
    folder : Path
        Where the site goes; what is there is replaced.
    """
    from sphinx.cmd.build import main as sphinx

    shutil.rmtree(folder, ignore_errors=True)
    begin = time.perf_counter(), time.process_time()
    strict = ['-W', '--keep-going', '-n', '-q', '-E']
    state = folder.with_name(f'{folder.name}_state')
    places = ['-c', str(root / 'docs'), '-d', str(state), str(root), str(folder)]
    code = int(sphinx([*strict, *places]))
    wall, cpu = time.perf_counter() - begin[0], time.process_time() - begin[1]
    files = [path for path in folder.rglob('*') if path.is_file()]
    megabytes = sum(path.stat().st_size for path in files) / 1e6
    pages = sum(path.suffix == '.html' for path in files)
    print(
        f'{folder / "index.html"}: {pages} pages, {len(files)} files, {megabytes:.1f} MB; '
        f'{wall:.1f} s, {cpu:.1f} s of CPU'
    )
    return code


if __name__ == '__main__':
    _ROOT = Path(sys.argv[1] if len(sys.argv) > 1 else '.')
    sys.exit(build(_ROOT, Path(sys.argv[2]) if len(sys.argv) > 2 else _ROOT / 'build/site'))
