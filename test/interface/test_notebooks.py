"""The notebooks of the documentation, run as a reader would, without an error or a warning."""

from __future__ import annotations

from pathlib import Path

import pytest

nbclient = pytest.importorskip('nbclient', reason='nbclient is in the test extra')
nbformat = pytest.importorskip('nbformat', reason='nbformat is in the test extra')
pytest.importorskip('ipykernel', reason='ipykernel is in the test extra')

FOLDER = Path(__file__).resolve().parents[2] / 'docs/notebooks'
NOTEBOOKS = sorted(FOLDER.glob('*.ipynb'))
# Far above what each takes.
TIMEOUT_S = 600
MOST_BYTES = 100_000


def outputs_of(notebook, kind):
    return [
        output
        for cell in notebook.cells
        if cell.cell_type == 'code'
        for output in cell.outputs
        if output.output_type == kind
    ]


@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_tables_and_figures(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=TIMEOUT_S, resources={'metadata': {'path': str(tmp_path)}}
    ).execute()
    shown = outputs_of(notebook, 'execute_result') + outputs_of(notebook, 'display_data')
    assert any('image/png' in output.data for output in shown)
    assert sum('text/html' in output.data for output in shown) >= 1
    said = ''.join(output.text for output in outputs_of(notebook, 'stream'))
    assert 'Warning' not in said
    (tmp_path / path.name).write_text(nbformat.writes(notebook))


@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_small_and_without_outputs(path):
    assert path.stat().st_size < MOST_BYTES
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == 'code']
    assert all(not cell.outputs and cell.execution_count is None for cell in cells)


def test_five_lines_take_a_film_to_its_contacts_and_the_restitution():
    notebook = nbformat.read(FOLDER / 'own_film.ipynb', as_version=4)
    (start,) = (k for k, cell in enumerate(notebook.cells) if '## Five lines' in cell.source)
    lines = [
        line
        for cell in notebook.cells[start + 1 : start + 5]
        for line in cell.source.splitlines()
        # A name alone shows the summary of the film.
        if line and line != 'film'
    ]
    assert len(lines) == 5
    assert lines[2:4] == ['film.contacts', 'film.cor']
