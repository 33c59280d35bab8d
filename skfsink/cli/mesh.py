"""`mesh`: any mesh made one to compute on, mended and judged."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    import meshio

    from ..meshing.sample import Sample

__all__ = ["mesh"]

FLAG = Parameter(negative="", show_default=False)


def mesh(source: Path, out: Path, /, *, unit: Annotated[str, Parameter(name="--from")] = "mm", merge_nodes: str = "0",
         boundary: Annotated[tuple[str, ...], Parameter(negative="", consume_multiple=False)] = (),
         length_scale: str = "0.1", overwrite: Annotated[bool, FLAG] = False) -> None:
    """Make a mesh of quadrilaterals or hexahedra from one of any elements, mend it, and say how good it is.

    Where there are triangles, tetrahedra or wedges, each triangle becomes three quadrilaterals, each quadrilateral
    four, each tetrahedron four hexahedra, each wedge six, each hexahedron eight. Boundaries and regions go along. Nodes
    of no element are dropped, and elements numbered in the other sense turned.

    Parameters
    ----------
    source
        Mesh file: what a run can read, and triangles, tetrahedra and wedges besides.
    out
        VTU file to write.
    unit
        Unit of the coordinates in the file, such as m or inch.
    merge_nodes
        Distance within which nodes become one, such as 1e-6mm; a plain number is in mm.
    boundary
        NAME=x:1.5 names what lies on the outside in the plane x = 1.5 mm; also y and z, and min or max for the number.
        May be given several times; the same name twice joins the two.
    length_scale
        Length l of the sink, for l/h [mm].
    overwrite
        Replace a file that is there; never the one that is read.
    """
    from ..errors import OutputError, ParameterError, require
    from ..meshing.files.convert import converted
    from ..meshing.mesh_file import one_line
    from ..meshing.sample import mesh_sample
    from ..meshing.vtu import write_mesh
    from ..system.files import replaced
    from ..units import in_unit

    merge = in_unit("merge_nodes", merge_nodes, "mm", plain=True)
    length = in_unit("length_scale", length_scale, "mm", plain=True)
    require("length_scale", length, "mm", low=0, low_open=True)
    if out.suffix.lower() != ".vtu":
        raise ParameterError(f"OUT must be a VTU file, which keeps the sets of a mesh: a name that ends in .vtu; got "
                             f"{str(out)!r}")
    if out.exists():
        if source.exists() and out.samefile(source):
            raise OutputError(f"{out} is the file that is read, which stays as it is: name another one")
        if not overwrite:
            raise OutputError(f"there is a file {out} already: name another one, or allow to overwrite it with "
                              f"--overwrite")
    made = converted(source, unit, merge, boundary)
    sample = mesh_sample(one_line(str(source)), made)
    with replaced(out) as part:
        write_mesh(part, made)
    _report(source, out, made, sample, length)


def _report(source: Path, out: Path, made: meshio.Mesh, sample: Sample, length: float) -> None:
    """Print what was made."""
    import numpy as np
    from rich.console import Console
    from rich.table import Table

    from ..errors import SkfsinkError
    from ..meshing.files.pieces import check_one_piece, hinge_note
    from ..meshing.files.quality import Quality
    from ..meshing.files.split import counted
    from ..meshing.files.unmatched import check_sides, slit_note
    from ..run.checks import check_size

    space, console = sample.space, Console(highlight=False, soft_wrap=True)
    extent = " x ".join(f"{x:.6g}" for x in np.ptp(space.X, axis=0))
    size = "area" if space.dim == 2 else "volume"
    console.print(f"[bold]{out}[/bold]")
    for name, text in (("elements", counted(made)), ("nodes", f"{space.n_nodes}"), ("extent", f"{extent} mm"),
                       (size, f"{space.V.sum():.6g} mm^{space.dim}"),
                       ("boundaries", _sets(sample.boundaries, "nodes")), ("regions", _sets(sample.cells, "elements")),
                       *(("note", note) for note in (*sample.notes, slit_note(space), hinge_note(space)) if note)):
        console.print(f"{name:12}{text}", markup=False)
    quality = Quality.of(space)
    flat = int(np.count_nonzero(quality.jacobian <= 0))
    warnings = [f"{flat} element(s) have a corner of 180 degrees or more"] if flat else []
    for check in (lambda: check_one_piece(sample.name, str(source), space), lambda: check_sides(sample.name, space),
                  lambda: check_size(space, length, of_metres="give --from m", of_micrometres="give --from um")):
        try:
            check()
        except SkfsinkError as error:
            warnings.append(f"a run refuses this: {error}")
    if length / float(quality.h.min()) < 3:
        warnings.append(f"no element is as fine as h = l/3 = {length / 3:.3g} mm, which a crack needs: refine where it "
                        f"may run, or take a longer --length-scale")
    for text in warnings:
        console.print(f"{'warning':12}{text}", markup=False)
    table = Table("", "least", "median", "greatest", box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, *values in quality.rows(length):
        table.add_row(name, *(f"{value:#.3g}" for value in values))
    console.print(table)


def _sets(sets: Mapping[str, Any], what: str) -> str:
    """Names of sets with how many are in each."""
    return ", ".join(f"{name} ({len(members)} {what})" for name, members in sorted(sets.items())) or "none"


if __name__ == "__main__":
    from .program import command

    command(mesh, package="commands")
