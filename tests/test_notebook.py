"""The notebook of the documentation: its cells run as they stand, on fewer elements, and its page is made of them."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import pytest
from test_docs import made

NOTEBOOK = Path(__file__).resolve().parents[1] / "docs" / "mesh_to_figure.ipynb"
COARSE = {"around, across = 96, 44": "around, across = 48, 22", "length_scale=0.12": "length_scale=0.24"}


def cells(kind: str) -> list[dict[str, Any]]:
    """Cells of a kind."""
    return [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == kind]


@pytest.mark.slow
def test_the_notebook_runs_from_mesh_to_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pictures: None) -> None:
    """Fails if a cell does not run any more, prints other lines than it shows, or no figure comes out."""
    monkeypatch.chdir(tmp_path)
    source = "\n".join("".join(cell["source"]) for cell in cells("code"))
    for old, new in COARSE.items():
        assert old in source
        source = source.replace(old, new)
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(source, NOTEBOOK.name, "exec"), {"__name__": "__main__"})
    assert (tmp_path / "strip.png").stat().st_size > 20_000
    shown = ["".join(output["text"]) for cell in cells("code") for output in cell["outputs"] if "text" in output]
    assert [line.split()[0] for line in said.getvalue().splitlines()[1:]] == [
        line.split()[0] for line in "".join(shown).splitlines()[1:]]
    assert "1.003 MPa" in "".join(shown) and "1.003 MPa" in said.getvalue()  # strengths do not depend on the mesh


def test_the_page_shows_every_cell_and_its_figure() -> None:
    """Fails if the page of the site leaves out a cell, an output or the figure of the notebook."""
    pytest.importorskip("mkdocs")
    pytest.importorskip("latex2mathml")
    text, pictures = made("hooks").notebook(NOTEBOOK)
    for cell in (*cells("code"), *cells("markdown")):
        assert "".join(cell["source"]) in text
    assert len(pictures) == 1 and "![](mesh_to_figure_0.png)" in text
    assert all(data.startswith(b"\x89PNG") for data in pictures.values())
