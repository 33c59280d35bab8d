"""Runs on a mesh file and on the VTU file of the same mesh: the same bytes of history."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from skfsink import Grip, Options, custom
from skfsink.meshing.mesh_file import read_mesh_file
from skfsink.meshing.sample import file_sample
from skfsink.meshing.vtu import write_mesh

DATA = Path(__file__).parent / "data"
REFUSED = {"plate_mixed_triangle", "plate_two_instances", "two_pieces", "plate_metres", "one_element"}
LONG = {"slit", "strip_100x1", "strip_10x1"}
FILES = [*sorted((DATA / "gmsh").glob("*.msh")),
         *(path for path in sorted((DATA / "inputs").glob("*.*")) if path.stem not in REFUSED | LONG)]


def history(mesh: Path, out: Path) -> bytes:
    """Bytes of the history of a run on a mesh, held at its foot and pulled at its head."""
    space = file_sample(mesh).space
    foot, head = ("bottom", "top") if space.dim == 2 else ("back", "front")
    still = [0.0] * (space.dim - 1)
    grips = [Grip(head, (*still, 1e-3)), Grip(foot, (*still, 0.0))]
    length = 2.0 * float(np.ptp(space.X, axis=0).max()) / 8
    custom(mesh=str(mesh), grips=grips, options=Options(length_scale=length, event_time=1e-9, out=out, quiet=True))
    return (out / "history.csv").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=[path.name for path in FILES])
def test_a_file_and_its_twin_in_vtu_give_the_same_bytes(path: Path, tmp_path: Path) -> None:
    """Fails if anything of a mesh but its name depends on the format of its file."""
    twin = tmp_path / f"{path.stem}.vtu"
    write_mesh(twin, read_mesh_file(path))
    one, other = history(path, tmp_path / "one"), history(twin, tmp_path / "other")
    assert one == other and len(one.splitlines()) > 5
