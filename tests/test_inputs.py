"""Decks and mesh files that are easily misread: the result of each, beside the right value in `docs/inputs.md`.

Runs that take longer are marked slow; the reading of their meshes is tested in any case.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from plates import invoke_program

from skfsink.errors import MeshError
from skfsink.meshing.sample import Sample, file_sample

INPUTS = Path(__file__).parent / "data" / "inputs"
PAGE = Path(__file__).parents[1] / "docs" / "inputs.md"


class Row(NamedTuple):
    """What comes of a deck: exit status, a line of it, and a figure of its summary with the right value."""

    status: int
    line: str
    figure: Callable[[dict[str, Any]], float] | None = None
    right: float = 0.0
    within: float = 1e-3  # relative
    slow: bool = False


def greatest_load(summary: dict[str, Any]) -> float:
    """Greatest load [N/mm]."""
    load: float = summary["loading"]["greatest_load"]
    return load


def failing_x(summary: dict[str, Any]) -> float:
    """Where it begins to fail [mm]."""
    x: float = summary["onset"]["place_mm"][0]
    return x


PLATE = Row(0, "least gamma", greatest_load, 1.0397516624931373, 1e-9)  # seven files of one and the same body
ROWS = {
    # 100 mm of the nominal strength of the material, 1.1310 MPa in plane stress with k/mu = 400
    "01_uniform_strip_never_fails": Row(0, "its result is the greatest load", greatest_load, 113.10, slow=True),
    "04_region_from_wrong_block": Row(0, "least gamma", greatest_load, 1.1354815, 1e-6, slow=True),
    "05_same_elset_in_two_blocks": Row(0, "least gamma", greatest_load, 15.784737, 1e-6, slow=True),
    "06_nset_given_twice": PLATE._replace(slow=True),
    "07_comment_in_nset": PLATE._replace(slow=True),
    "09_two_instances": Row(2, r'is in 2 pieces .*; 21 pairs of nodes coincide .*: give merge_nodes = "1e-6 mm"'),
    "10_reference_point_in_assembly": PLATE._replace(slow=True),
    "11_CPE4": PLATE,
    "12_two_separate_pieces": Row(2, r"is in 2 pieces that share no node .* and no nodes of theirs coincide"),
    "13_slit_pressed_shut": Row(0, "pass through each other by", slow=True),
    "14_load_unload_reload": Row(0, "nothing failed: the greatest W/Phi was 0.457", greatest_load, 0.40377, 1e-4,
                                 slow=True),
    "15_one_element_uniaxial": Row(0, "failed everywhere at once", greatest_load, 1.1310, slow=True),
    "17_metres": Row(2, "the body is 0.002 mm across, .* multiply those of a mesh in m by 1000"),
    "18_density_in_tonne_per_mm3": Row(2, r"density 1.433e-09 kg/m\^3 .* if it is in t/mm\^3, give 1433 kg/m\^3"),
    "19_uniform_strip_onset_past_peak": Row(0, "its result is the greatest load", greatest_load, 1.1310, slow=True),
    "20_orphan_node": PLATE._replace(line="1 node.* belong to no element and were dropped", slow=True),
    "21_surfaces_only": PLATE._replace(slow=True),
    "24_gmsh41_quads": Row(0, "least gamma", failing_x, 1.0, 1e-6),  # held and moved as a whole: it fails in its middle
    "25_circle_centre": Row(0, "belong to no element and were dropped", failing_x, 1.6, 1e-6, slow=True),
}


@pytest.mark.parametrize("deck", [pytest.param(deck, marks=[pytest.mark.slow] if row.slow else [])
                                  for deck, row in ROWS.items()])
def test_deck(deck: str, tmp_path: Path) -> None:
    """Fails if a deck that is refused is computed, or the other way round, or its figure is not the right one."""
    row = ROWS[deck]
    status, said, _ = invoke_program("run", INPUTS / "decks" / f"{deck}.toml", "--out", tmp_path / "out")
    assert status == row.status
    assert re.search(row.line, said), said
    if status:
        assert said.count("\n") == 1 and not (tmp_path / "out").exists()
    if row.figure is not None:
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert row.figure(summary) == pytest.approx(row.right, rel=row.within)


def plate() -> Sample:
    """The body of most of the files."""
    return file_sample(INPUTS / "plate_CPE4.inp")


@pytest.mark.parametrize("name", [
    "plate_CAX4H.inp", "plate_CPE4H.inp", "plate_CPE4I.inp", "plate_CPE4R.inp", "plate_CPS4.inp", "plate_bom.inp",
    "plate_clockwise.inp", "plate_comment_in_nset.inp", "plate_crlf.inp", "plate_generate_two_numbers.inp",
    "plate_nset_in_two_parts.inp", "plate_orphan.inp", "plate_part_instance.inp", "plate_reference_point.inp",
    "plate_region_second_block.inp", "plate_same_elset_two_blocks.inp", "plate_surfaces.inp"])
def test_files_of_one_body_are_the_same_body(name: str) -> None:
    """Fails if a way of writing a body makes another one of it, or gives its grips other nodes."""
    one, other = plate(), file_sample(INPUTS / name)
    middle, found = (np.sort(sample.space.X[sample.space.conn].mean(axis=1), axis=0) for sample in (one, other))
    np.testing.assert_allclose(found, middle, atol=1e-12)
    for grip, y in (("gripBot", 0.0), ("gripTop", 2.0)):
        x = np.sort(other.space.X[other.nodes(grip)], axis=0)
        np.testing.assert_allclose(x, np.sort(one.space.X[one.nodes(grip)], axis=0), atol=1e-12)
        assert len(x) == 21 and (x[:, 1] == y).all()


def test_regions_are_where_their_elements_are() -> None:
    """Fails if numbers of elements of a second block are taken as those of the first, or one of two blocks is lost."""
    sample = file_sample(INPUTS / "plate_region_second_block.inp")
    middle = sample.space.X[sample.space.conn[sample.elements("stiff")]].mean(axis=1)
    assert len(middle) == 65 and middle[:, 1].min() > 1.6
    sample = file_sample(INPUTS / "plate_same_elset_two_blocks.inp")
    assert len(sample.elements("body")) == sample.space.n_elements == 395


def test_two_instances_become_one_body() -> None:
    """Fails if the second instance is lost, is not where it was placed, or does not grow together with the first."""
    body = file_sample(INPUTS / "plate_two_instances.inp", merge_nodes=1e-6)
    assert body.space.n_elements == 2 * 395 and body.space.n_nodes == 2 * 441 - 21
    np.testing.assert_allclose(np.ptp(body.space.X, axis=0), [4.0, 2.0], atol=1e-9)
    assert any("21" in note for note in body.notes)


@pytest.mark.parametrize(("name", "line"), [
    ("plate_mixed_triangle.inp", "394 quadrilaterals and 2 triangles, .*: convert it with skfsink mesh ")])
def test_files_that_are_refused(name: str, line: str) -> None:
    """Fails if a body that is not computed here is taken for another one, or the line does not say what to do."""
    with pytest.raises(MeshError, match=line):
        file_sample(INPUTS / name)


def test_the_page_has_every_deck() -> None:
    """Fails if a deck is missing in the table, or stands there with another exit status."""
    page = PAGE.read_text(encoding="utf-8")
    for deck, row in ROWS.items():
        found = re.search(rf"^\| `{deck}` \| (\d) \|", page, re.MULTILINE)
        assert found and int(found[1]) == row.status, deck
