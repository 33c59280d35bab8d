"""What the side-by-side benchmark rests on: two statements of one problem agree, and the table says what was measured.

The other libraries are not needed here; see tests/benchmarks/peers/run.py.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plates import plate

PEERS = Path(__file__).parent / "benchmarks" / "peers"
sys.path.insert(0, str(PEERS))

pytest.importorskip("resource")  # the benchmark measures memory with it

import problem as problems  # noqa: E402
import table  # noqa: E402
from measure import measure  # noqa: E402
from peer_skfem import PEERS as SKFEM  # noqa: E402
from peer_skfsink import PEERS as SKFSINK  # noqa: E402


def small(kind: str) -> problems.Problem:
    """A plate of 13 x 13 quads, or the same one 0.3 mm thick, one layer; two load steps."""
    mesh = plate(13)
    X, cells = mesh.points[:, :2], mesh.cells_dict["quad"]
    if kind == "slab":
        X, cells = problems._extruded(X, cells, 0.3, 1)
    return problems.Problem(np.ascontiguousarray(X), cells, np.flatnonzero(X[:, 1] == 4.0),
                            np.flatnonzero(X[:, 1] == 0.0), np.array([0.05, 0.1]), tolerance=1e-10)


@pytest.mark.parametrize("kind", ["plate", pytest.param("slab", marks=pytest.mark.slow)])
def test_reaction_is_that_of_scikit_fem(kind: str) -> None:
    """Fails if the condensed Q1/P0 forms of scikit-fem and the loops of skfsink are not the same element, if a
    tangent is wrong (four iterations a step then do not do), or if skfsink's own Newton method stops elsewhere."""
    body = small(kind)
    full, own, forms = (measure(peer, body) for peer in (SKFSINK["full"], SKFSINK[""], SKFEM[""]))
    np.testing.assert_allclose(forms["reactions"], full["reactions"], rtol=1e-9)
    np.testing.assert_allclose(own["reactions"], full["reactions"], rtol=1e-9)
    assert max(forms["iterations"] + full["iterations"]) <= 5
    assert min(full["reactions"]) > 0 and full["reactions"][1] > 1.8 * full["reactions"][0]
    assert max(max(f["residuals"]) for f in (full, own, forms)) <= body.tolerance


def test_the_plain_element_is_stiffer() -> None:
    """Fails if the row of the plain element is not that of another element, which locks."""
    body = small("plate")
    assert measure(SKFSINK["plain"], body)["reactions"][1] > 1.05 * measure(SKFSINK["full"], body)["reactions"][1]


def test_problem_survives_the_way_to_a_process_of_its_own(tmp_path: Path) -> None:
    """Fails if a constant or an array is lost or changed in the file the measuring processes read."""
    body = small("slab")
    body.save(tmp_path / "slab.npz")
    again = problems.Problem.load(tmp_path / "slab.npz")
    for name in ("X", "cells", "top", "bottom", "elongation", "c1", "c2", "k", "tolerance"):
        np.testing.assert_array_equal(getattr(again, name), getattr(body, name))
    assert isinstance(again.k, float)


@pytest.mark.parametrize("name,elements", [("plate", 19064), ("slab", 2 * 3431)])
def test_problems_are_the_committed_meshes(name: str, elements: int) -> None:
    """Fails if a mesh is another one, if an element is numbered the wrong way round, or if a grip is not an end."""
    body = problems.make(name)
    assert len(body.cells) == elements and body.dim == {"plate": 2, "slab": 3}[name]
    a, b, d = (body.X[body.cells[:, i]] for i in (0, 1, 3))
    along, across = b - a, d - a
    assert (along[:, 0] * across[:, 1] > along[:, 1] * across[:, 0]).all()
    if name == "slab":
        assert (body.X[body.cells[:, 4]][:, 2] > a[:, 2]).all()
    assert np.ptp(body.X[body.top, 1]) == 0 and np.ptp(body.X[body.bottom, 1]) == 0
    assert np.ptp(body.X[body.top, 0]) == 4.0


def figures(**changes: Any) -> dict[str, Any]:
    """Made-up figures of a peer."""
    return {"element": "jbar", "solver": "LU", "assembly_ms": 12.4, "solve_ms": 5.0, "iterations": [4, 5],
            "total_s": 2.0, "setup_s": 0.5, "warm_up_s": 1.0, "base_mb": 100.0, "peak_mb": 150.0,
            "reactions": [1.0, 2.0], **changes}


def test_table_flags_a_reaction_that_is_off() -> None:
    """Fails if a peer that solves something else passes, or one that agrees does not."""
    results = {"skfsink": figures(total_s=1.0), "skfsink:full": figures(), "good": figures(reactions=[1.0, 2.0 + 1e-9]),
               "bad": figures(reactions=[1.0, 2.0 + 1e-5]), "broken": {"error": "no wheel"}}
    lines = table.rows(results, {name: name for name in [*results, "missing"]})
    assert [line[0] for line in lines] == list(results)
    last = {line[0]: line[-1] for line in lines}
    assert last["skfsink:full"] == "reference" and last["good"] == "5e-10" and last["broken"] == "no wheel"
    assert last["bad"].startswith("differs by 5.0e-06")
    assert {line[0]: line[7] for line in lines}["good"] == "2.0"
    assert all(len(line) == len(table.COLUMNS) for line in lines)
    assert math.isnan(table.difference(figures(element="plain"), results))


def test_table_goes_between_its_markers_only(tmp_path: Path) -> None:
    """Fails if text outside the markers changes, if a second writing adds to the first, or if a document without
    markers is written to."""
    page = tmp_path / "page.md"
    tail = "<!-- /a -->\nafter <!-- b --><!-- /b -->\n"
    page.write_text(f"before\n<!-- a -->\nstale\n{tail}")
    for _ in range(2):
        table.put(page, "a", table.markdown([("x",) * len(table.COLUMNS)]))
    text = page.read_text()
    assert text.startswith("before\n<!-- a -->\n| library") and text.endswith(f"\n{tail}")
    assert "stale" not in text and text.count("\n| x |") == 1
    with pytest.raises(ValueError, match="must have <!-- c -->"):
        table.put(page, "c", "text")
    assert page.read_text() == text
