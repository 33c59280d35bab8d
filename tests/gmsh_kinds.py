"""Strips and blocks that gmsh meshes and saves in every kind of file it has; what they are is known by construction.

`python tests/gmsh_kinds.py` writes the files in tests/data/gmsh, with which the tests run where gmsh is not installed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from skfsink.meshing.sample import Sample

FOLDER = Path(__file__).parent / "data" / "gmsh"
FORMS = {"41": {"Mesh.MshFileVersion": 4.1}, "41b": {"Mesh.MshFileVersion": 4.1, "Mesh.Binary": 1},
         "22": {"Mesh.MshFileVersion": 2.2}, "22b": {"Mesh.MshFileVersion": 2.2, "Mesh.Binary": 1},
         "40": {"Mesh.MshFileVersion": 4.0}}
#: what the sets of a file are called: by physical groups with names, without, or by elementary entities
NAMED, NUMBERED, ELEMENTARY = "named", "numbered", "elementary"
KINDS: dict[str, dict[str, Any]] = {
    "plain": {}, "numbered": {"sets": NUMBERED}, "elementary": {"sets": ELEMENTARY},
    "save-all": {"options": {"Mesh.SaveAll": 1}}, "parametric": {"options": {"Mesh.SaveParametric": 1}},
    "topology": {"options": {"Mesh.SaveTopology": 1}}, "reversed": {"sign": -1}, "gaps": {"gaps": True},
    "parts": {"parts": 2}, "ghosts": {"parts": 2, "options": {"Mesh.PartitionCreateGhostCells": 1}},
    "parts-all": {"parts": 2, "options": {"Mesh.SaveAll": 1}},
    "parts-elementary": {"parts": 2, "sets": ELEMENTARY},
    "parts-flat": {"parts": 2, "options": {"Mesh.PartitionCreateTopology": 0}},
    "periodic": {"periodic": True},
}


@contextmanager
def model(options: dict[str, float]) -> Iterator[Any]:
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for name, value in {"General.Terminal": 0, **options}.items():
            gmsh.option.setNumber(name, value)
        yield gmsh
    finally:
        gmsh.finalize()


def make(path: Path, dim: int, form: str = "41", *, options: dict[str, float] | None = None, sets: str = NAMED,
         sign: int = 1, gaps: bool = False, parts: int = 0, periodic: bool = False, order: int = 1,
         incomplete: bool = False, height: float = 0.0) -> None:
    """A strip 4 mm long of two squares of 2 x 2 elements, or the block that it makes when it is 1 mm thick.

    Groups: `soft` and `lid` are the two halves, `whole` both; `the bottom` (y = 0) and `lid` (y = 2) sides; `seam`
    between the halves; `corner` at the origin; in space also the curve `edge` through the origin along z.
    """
    with model({**FORMS[form], **(options or {})}) as gmsh:
        occ, mesh = gmsh.model.occ, gmsh.model.mesh
        halves = [(2, occ.addRectangle(x, 0, height, 2, 2)) for x in (0, 2)]
        occ.fragment(halves[:1], halves[1:])
        if dim == 3:
            occ.extrude(occ.getEntities(2), 0, 0, 1, [1], recombine=True)
        occ.synchronize()

        def found(d: int, where: Callable[..., bool]) -> list[int]:
            return [tag for _, tag in gmsh.model.getEntities(d) if where(*gmsh.model.getBoundingBox(d, tag))]

        for tag in found(1, lambda a, b, c, d, e, f: f - c < 0.5):
            mesh.setTransfiniteCurve(tag, 3)
        for _, tag in gmsh.model.getEntities(2):
            mesh.setTransfiniteSurface(tag)
            mesh.setRecombine(2, tag)
        if periodic:
            ends = [found(dim - 1, lambda a, b, c, d, e, f, x=x: abs(a + d - 2 * x) < 1e-3 and d - a < 1)
                    for x in (0, 4)]
            mesh.setPeriodic(dim - 1, ends[1], ends[0], [1, 0, 0, 4, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
        if sets != ELEMENTARY:
            low = found(dim - 1, lambda a, b, c, d, e, f: e < 1e-3)
            high = found(dim - 1, lambda a, b, c, d, e, f: b > 2 - 1e-3)
            seam = found(dim - 1, lambda a, b, c, d, e, f: abs(a - 2) < 1e-3 and abs(d - 2) < 1e-3)
            body = [found(dim, lambda a, b, c, d, e, f, x=x: abs((a + d) / 2 - x) < 0.1)[0] for x in (1, 3)]
            corner = found(0, lambda a, b, c, d, e, f: max(d, e, abs(f - height)) < 1e-3)
            for d, tags, number, name in ((dim - 1, low, 1, "the bottom"), (dim - 1, high, 2, "lid"),
                                          (dim - 1, seam, 7, "seam"), (0, corner, 1, "corner"),
                                          (dim, [sign * body[0]], 1, "soft"), (dim, [sign * body[1]], 2, "lid"),
                                          (dim, [sign * tag for tag in body], 3, "whole")):
                gmsh.model.addPhysicalGroup(d, tags, number, name if sets == NAMED else "")
            if dim == 3:
                edge = found(1, lambda a, b, c, d, e, f: max(d, e) < 1e-3)
                gmsh.model.addPhysicalGroup(1, edge, 1, "edge" if sets == NAMED else "")
        mesh.generate(dim)
        if order > 1:
            gmsh.option.setNumber("Mesh.SecondOrderIncomplete", int(incomplete))
            mesh.setOrder(order)
        if gaps:
            tags = mesh.getNodes()[0]
            mesh.renumberNodes(tags, 7 * tags[::-1] + 1000)
        if parts:
            mesh.partition(parts)
        gmsh.write(str(path))


def check(sample: Sample, sets: str = NAMED, height: float = 0.0) -> None:
    """See that a sample is the strip or the block, with its groups and nothing else."""
    space = sample.space
    X, dim = space.X, space.dim
    planes = [np.arange(5.0), np.arange(3.0), np.arange(2.0)][:dim]
    assert points_of(X) == set(itertools.product(*planes))
    middle = X[space.conn].mean(axis=1)
    assert points_of(middle) == set(itertools.product(*[(plane[1:] + plane[:-1]) / 2 for plane in planes]))
    assert np.allclose(space.V, 1) and len(middle) == 8
    elements, nodes = {"soft": middle[:, 0] < 2, "lid": middle[:, 0] > 2, "whole": middle[:, 0] > 0}, {
        "the bottom": X[:, 1] == 0, "lid": np.isclose(X[:, 1], 2), "seam": np.isclose(X[:, 0], 2),
        "corner": np.isclose(np.abs(X).sum(axis=1), 0)}
    if dim == 3:
        nodes["edge"] = np.isclose(X[:, :2].sum(axis=1), 0)
    if sets == NUMBERED:
        word, facet = ("surface", "curve") if dim == 2 else ("volume", "surface")
        renamed = {"soft": f"{word}:1", "lid": f"{word}:2", "whole": f"{word}:3"}
        elements = {renamed[name]: mask for name, mask in elements.items()}
        renamed = {"the bottom": f"{facet}:1", "lid": f"{facet}:2", "seam": f"{facet}:7", "corner": "point:1",
                   "edge": "curve:1"}
        nodes = {renamed[name]: mask for name, mask in nodes.items()}
    sides = {"left", "right", "bottom", "top", "back", "front"}
    if sets == ELEMENTARY:  # whose numbers are gmsh's; each half, side, seam, edge and corner has one
        there = [set(index.tolist()) for index in sample.cells.values()]
        assert sorted(map(len, there)) == [4, 4] and all(set(np.flatnonzero(elements[name]).tolist()) in there
                                                         for name in ("soft", "lid"))
        found = [set(index.tolist()) for name, index in sample.boundaries.items() if name not in sides]
        assert len(found) == {2: 7 + 6, 3: 11 + 20 + 12}[dim]
        assert all(set(np.flatnonzero(mask).tolist()) in found for name, mask in nodes.items()
                   if name not in ("the bottom", "lid"))
        return
    assert {name: set(index.tolist()) for name, index in sample.cells.items()} == {
        name: set(np.flatnonzero(mask).tolist()) for name, mask in elements.items()}
    assert {name: set(index.tolist()) for name, index in sample.boundaries.items() if name not in sides} == {
        name: set(np.flatnonzero(mask).tolist()) for name, mask in nodes.items()}


def points_of(X: np.ndarray) -> set[tuple[float, ...]]:
    """Rows of coordinates (n, dim), as a set."""
    return set(map(tuple, (np.round(X, 9) + 0.0).tolist()))


def sets_of(kind: str, form: str) -> str:
    """How the sets of a kind of file are called: version 2 has no groups where all is saved."""
    sets: str = KINDS[kind].get("sets", NAMED)
    return ELEMENTARY if form.startswith("22") and kind in ("save-all", "parts-all") else sets


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for kind_, form_, dim_ in itertools.product(KINDS, FORMS, (2, 3)):
        if ((dim_ == 2 or kind_ in ("plain", "elementary", "save-all")) and form_ != "40") or kind_ == "parts":
            make(FOLDER / f"{kind_}-{dim_}d-{form_}.msh", dim_, form_, **KINDS[kind_])
