"""What is generated from the code is what the code generates."""

from __future__ import annotations

import pytest

from nanorocks_ros.tools.docs_pages.wire_pages import FILES, write


@pytest.mark.parametrize('name', sorted(FILES))
def test_a_generated_file_is_not_stale(name, root):
    assert (root / name).read_text(encoding='utf-8') == FILES[name](), 'run `make docs`'


def test_everything_is_written_into_an_empty_tree(tmp_path):
    write(tmp_path)
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob('*') if path.is_file()}
    assert written == set(FILES)
