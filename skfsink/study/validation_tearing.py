"""One tearing energy: G at the onset of strips in pure shear, edge-cracked sheets and trousers, over psi_f l.

Rivlin and Thomas (J. Polym. Sci. 10 (1953) 291-318): tearing begins at an energy that does not depend on the shape of
the test piece or of the cut. All pieces are of the law of the paper, and have the same cut: as wide as the length l,
with a round tip and rings of elements around it. In pure shear G = W H, with the energy W ahead of the cut; in all of
them it is the domain integral. A pair of trousers is torn out of its plane (mode III) and is a thick sheet of
hexahedra; its G is 2 F/t less what its legs store as well (Rivlin and Thomas, Eq. 5.6). Why it needs another G than
the others is looked for by a strip sheared out of its plane, mode III without bending, and by legs and sheets of other
sizes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from ..fields.release_rate import energy_release_rate
from ..fields.state import State
from ..loads.grips import Grip
from ..material import AAA, SinkLaw
from ..meshing.outline import Edge, SizeField, mesh_outline
from ..meshing.sample import Sample, load_sample
from ..meshing.sweeping import swept
from ..meshing.vtu import write_mesh
from ..methods.controls import StaticsControls
from ..methods.statics import Statics
from .chart import page
from .part import Planned, Points
from .plate import PULLED, SPEED, Plate
from .validation_table import Row

__all__ = ["Piece", "Trousers", "draw_tearing", "notched_sheet", "plan_tearing", "rows_tearing", "torn"]

WIDTH = SinkLaw.length_scale  # of a cut [mm]
RADIUS = 0.5                  # of the domain of G [mm]
#: elements along a radius of the tip, and in l where the crack would run
LEVELS = ((6, 2), (12, 3))
COARSE, GRADING = 0.15, 0.15
ALLOWED = 0.05                # between pieces
FRONT = np.array([0.0, 0.0, 1.0])
CLAMPED = (Grip("top", (0.0, SPEED, 0.0)), Grip("bottom", (0.0, -SPEED, 0.0)))
#: the ends of a strip apart out of its plane, in which its faces are held: mode III without bending
SHEARED = (Grip("top", (0.0, 0.0, SPEED)), Grip("bottom", (0.0, 0.0, -SPEED)),
           *(Grip(face, (0.0, 0.0, None)) for face in ("back", "front")))
INCREMENT = 0.02              # of the load on trousers, which go a long way


def notched_sheet(length: float, height: float, cut: float, level: int = 0) -> meshio.Mesh:
    """Sheet [0, length] x [0, height] with a cut from the middle of its left edge, round at its tip; needs gmsh."""
    along, fine = LEVELS[level]
    middle, r, h = height / 2, WIDTH / 2, WIDTH / fine
    outline = [Edge("bottom", (length, 0)), Edge("right", (length, height)), Edge("top", (0, height)),
               Edge("upper", (0, middle + r)), Edge("flank", (cut - r, middle + r)),
               Edge("notch", (cut - r, middle - r), via=(cut, middle), h=r / along),
               Edge("flank", (0, middle - r)), Edge("lower", (0, 0))]
    corridor = (cut - 0.2, cut + 1.0, middle - 0.4, middle + 0.4)
    return mesh_outline(outline, SizeField(h, COARSE, (corridor,), grading=GRADING))


def sample_of(mesh: meshio.Mesh) -> Sample:
    """The mesh as a sample."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sheet.vtu"
        write_mesh(path, mesh)
        return load_sample("study", str(path))


def torn(sample: Sample, *, element: str = "planestress", height: float | None = None,
         radius: float = RADIUS, sheared: bool = False) -> dict[str, Any]:
    """G at the onset of a sheet that is pulled at `top` and `bottom`, over psi_f l, with that of W H in pure shear.

    The sheet may be of hexahedra as well; its two faces are free. `height` [mm] is that of a strip in
    pure shear; W is then the mean stored energy from 1.5 heights ahead of the tip to 3.5. If `sheared` it is sheared
    out of its plane instead.
    """
    space = sample.space
    sheet = space.dim == 2
    plate = Plate(sample, PULLED if sheet else SHEARED if sheared else CLAMPED, element=element, onset_tolerance=1e-4)
    state, tip = plate.onset, space.X[sample.nodes("notch")]
    tip = tip[np.argmax(tip[:, 0])]
    plate.body.take(state)
    rate = energy_release_rate(plate.body, state, tip, np.eye(space.dim)[0], radius, front=None if sheet else FRONT)
    band = plate.law.failure_energy * plate.law.length_scale
    found = {"G_N_per_mm": rate.G, "G_over_band": rate.G / band, "opening_mm": plate.onset_figures["opening_mm"],
             "gamma_min": plate.onset_figures["gamma_min"], "elements": space.n_elements,
             "stretch": 1 + plate.onset_figures["opening_mm"] / float(np.ptp(space.X[:, 1]))}
    if height is not None:
        x = space.X[space.conn].mean(axis=1)[:, 0]
        ahead = (x > tip[0] + 1.5 * height) & (x < tip[0] + 3.5 * height)
        weight, W = space.w[ahead], plate.momentum.W[ahead]
        mean = float((weight * W).sum() / weight.sum())
        F = AAA().thin_sheet(np.diag([1.0, found["stretch"]]))
        found |= {"WH_over_band": mean * height / band, "closed_WH_over_band": float(AAA().energy(F)) * height / band}
    return found


@dataclass(frozen=True)
class Piece:
    """A test piece: a strip in pure shear or in mode III, or an edge-cracked sheet [mm], on the mesh of a level."""

    kind: str
    length: float
    height: float
    cut: float
    level: int
    layers: int = 0  # of hexahedra over a thickness of l; 0 for quadrilaterals in plane stress

    def __call__(self) -> dict[str, Any]:
        """What :func:`torn` says of it."""
        mesh = notched_sheet(self.length, self.height, self.cut, self.level)
        sample = sample_of(swept(mesh, WIDTH, self.layers) if self.layers else mesh)
        return {"kind": self.kind, "level": self.level, "cut_mm": self.cut, "height_mm": self.height,
                "length_mm": self.length,
                **torn(sample, element="jbar" if self.layers else "planestress",
                       height=self.height if self.kind == "pure shear" else None, sheared=self.kind == "mode III")}


@dataclass(frozen=True)
class Trousers:
    """A sheet of hexahedra, cut into two legs whose ends are pulled to either side of it, on the mesh of a level.

    The ends of the legs keep their length across, and come nearer to the tip as they want; the far end is held.
    """

    level: int
    length: float = 4.0
    height: float = 2.0
    cut: float = 2.0
    thickness: float = WIDTH
    layers: int = 2

    def __call__(self) -> dict[str, Any]:
        """G at the onset over psi_f l, the force by the thickness twice, and how the legs lie."""
        sample = sample_of(swept(notched_sheet(self.length, self.height, self.cut, self.level), self.thickness,
                                 self.layers))
        grips = (Grip("upper", (None, 0.0, SPEED)), Grip("lower", (None, 0.0, -SPEED)), Grip("right", (0.0,) * 3))
        plate = Plate(sample, grips)
        statics = Statics(plate.body, StaticsControls(increment=INCREMENT, onset_tolerance=2e-3))
        state, space = State.intact(sample.space), sample.space
        for _ in statics.load(state):
            pass
        force = plate.body.take(state)
        tip = np.array([self.cut, self.height / 2, self.thickness / 2])
        rate = energy_release_rate(plate.body, state, tip, np.array([1.0, 0.0, 0.0]), RADIUS, front=FRONT)
        band = plate.law.failure_energy * plate.law.length_scale
        end = sample.nodes("upper")
        return {"kind": "trousers", "level": self.level, "G_N_per_mm": rate.G, "G_over_band": rate.G / band,
                "2F_over_band": 2 * float(force[end, 2].sum()) / self.thickness / band,
                "opening_mm": 2 * SPEED * state.grip, "gamma_min": float(state.gamma.min()),
                "elements": space.n_elements, "why": statics.refused,
                "failing": space.X[np.argmin(state.gamma)].round(3)}


#: kind, length, height, cut [mm], by name; the first is what the others are compared with
PIECES = {"pure shear, 1.5 mm high": ("pure shear", 12.0, 1.5, 3.0),
          "pure shear, 2.5 mm high": ("pure shear", 19.0, 2.5, 4.0),
          "edge crack of 1 mm": ("edge crack", 6.0, 8.0, 1.0),
          "edge crack of 2 mm": ("edge crack", 6.0, 8.0, 2.0)}
SOLID = "pure shear, 1.5 mm high, hexahedra"
TROUSERS = "trousers, hexahedra"
#: what the onset of trousers depends on, one at a time; each on one mesh
CAUSES: dict[str, Callable[[], dict[str, Any]]] = {
    "sheared out of its plane, 1.5 mm high": Piece("mode III", 8.0, 1.5, 3.0, 0, 1),
    "trousers, l/2 thick": Trousers(0, thickness=WIDTH / 2),
    "trousers, 2 l thick": Trousers(0, thickness=2 * WIDTH, layers=4),
    "trousers, legs 1.95 mm wide": Trousers(0, height=4.0),
    "trousers, legs 1.95 mm wide, l/2 thick": Trousers(0, height=4.0, thickness=WIDTH / 2),
    "trousers, legs 4 mm long": Trousers(0, length=6.0, cut=4.0),
}


def plan_tearing(quick: bool) -> list[Planned]:
    """Each piece on two meshes; if quick, the sheets on one."""
    planned = [Planned(f"{name}/{level}", Piece(*piece, level), 8.0 + 8.0 * level)
               for level in ((0,) if quick else (0, 1)) for name, piece in PIECES.items()]
    if not quick:
        for level, layers in enumerate((2, 4)):
            planned.append(Planned(f"{SOLID}/{level}", Piece("pure shear", 8.0, 1.5, 3.0, 0, layers), 60.0))
            planned.append(Planned(f"{TROUSERS}/{level}", Trousers(0, layers=layers), 50.0))
        planned += [Planned(f"{name}/0", piece, 60.0) for name, piece in CAUSES.items()]
    return planned


# --- what comes out ---
def by_piece(points: Points) -> dict[str, list[dict[str, Any]]]:
    """The points of each piece, coarse first, that did not fail."""
    found: dict[str, list[dict[str, Any]]] = {}
    for key, point in points.items():
        if "failed" not in point:
            found.setdefault(key.rpartition("/")[0], []).append(point)
    return found


def rows_tearing(points: Points) -> list[Row]:
    """A row a piece: its G at the onset over psi_f l against that of the first one; and G against W H."""
    pieces = by_piece(points)
    if not pieces:
        return []
    first = next(iter(PIECES))
    known = pieces[first][-1]["G_over_band"]
    rows = []
    for name, group in pieces.items():
        fine, coarse = group[-1]["G_over_band"], group[0]["G_over_band"]
        error = f"{abs(fine / coarse - 1):.1%}" if len(group) > 1 else "one mesh"
        if name == first:
            closed = group[-1]["closed_WH_over_band"]
            rows.append(Row(f"$G$ at the onset, {name}, over $\\psi_fl$",
                            f"{closed:.3f}, $WH$ (Rivlin and Thomas 1953)", f"{fine:.3f}", error,
                            abs(fine / closed - 1) < ALLOWED, "domain integral against $WH$"))
            continue
        off = fine / known - 1
        rows.append(Row(f"$G$ at the onset, {name}, over $\\psi_fl$", f"{known:.3f}, as in pure shear", f"{fine:.3f}",
                        error, None if name in CAUSES else abs(off) < ALLOWED, f"{off:+.1%}{REASONS.get(name, '')}"))
    return rows


REASONS = {
    SOLID: "; as thick as $l$, on two and four layers",
    TROUSERS: "; what a round cut needs depends on the mode, and on how the sheet bends at its tip: the rows below; on "
              "two and four layers",
}


def draw_tearing(points: Points, path: Path) -> None:
    """G over psi_f l of all pieces, on both meshes, with the band of 5 % about that of the first."""
    pieces = by_piece(points)
    with page(path, "Energy release rate at the onset of different test pieces", 1, 1, 2.8) as (ax,):
        if pieces:
            known = next(iter(pieces.values()))[-1]["G_over_band"]
            ax.axvspan((1 - ALLOWED) * known, (1 + ALLOWED) * known, color="0.9", label="5 % about pure shear")
        for i, (name, group) in enumerate(pieces.items()):
            for k, point in enumerate(group):
                ax.plot(point["G_over_band"], -i, "o", color="#a63d40", ms=5, fillstyle="full" if k else "none",
                        label=("coarser", "finer mesh")[k] if i == 0 else None)
            if name in PIECES and "closed_WH_over_band" in group[-1]:
                ax.plot(group[-1]["closed_WH_over_band"], -i, "kx", ms=5, label=None if i else "$WH$")
        ax.set(xlabel=r"$G$ at the onset over $\psi_fl$", yticks=-np.arange(len(pieces)), xlim=(0, 1.05),
               ylim=(-len(pieces) + 0.4, 0.6))
        ax.set_yticklabels(list(pieces))
        if pieces:
            ax.legend(fontsize=6, loc="lower left")
