"""Files of gmsh: every kind that it writes of a strip and a block, against what these are by construction."""

from __future__ import annotations

from pathlib import Path

import pytest
from gmsh_kinds import FOLDER, FORMS, KINDS, check, make, sets_of

from skfsink.sample import file_sample

STORED = sorted(FOLDER.glob("*.msh"))


@pytest.mark.parametrize("path", STORED, ids=[path.stem for path in STORED])
def test_stored_files(path: Path) -> None:
    """Fails if an element, a node or a member of a group is lost, made up or moved, in a file that gmsh wrote."""
    kind, form = path.stem.rsplit("-", 2)[0], path.stem.rsplit("-", 1)[1]
    check(file_sample(path), sets_of(kind, form))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", KINDS)
def test_files_that_gmsh_writes_now(kind: str, form: str, dim: int, tmp_path: Path) -> None:
    """Fails as `test_stored_files` does, for the version of gmsh that is installed."""
    pytest.importorskip("gmsh")
    make(tmp_path / "mesh.msh", dim, form, **KINDS[kind])
    check(file_sample(tmp_path / "mesh.msh"), sets_of(kind, form))
