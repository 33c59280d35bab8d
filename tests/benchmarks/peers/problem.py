"""The two problems every library is given: the notched plate in plane strain, and a notched slab.

Both are stretched between grips, in five steps up to about 60 % of the displacement at which the crack would start,
with the relative density held at one. The stored energy is (31), psi(I1') + k/2 (J_bar - 1)^2.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

__all__ = ["PROBLEMS", "Problem", "make"]

ROOT = Path(__file__).resolve().parents[3]
PROBLEMS = ("plate", "slab")


@dataclass(frozen=True, eq=False)
class Problem:
    """A body between two grips, in plain arrays.

    Parameters
    ----------
    X: nodal coordinates [mm], (n, dim).
    cells: nodes of the elements in the order of VTK, (ne, 4) quads or (ne, 8) hexes.
    top, bottom: nodes held; those of the top move by +u, those of the bottom by -u along y, other components are zero.
    elongation: 2u at each step [mm].
    c1, c2, k: constants of the stored energy [MPa].
    tolerance: norm of the residual at free unknowns over the norm of all internal forces, at equilibrium.
    """

    X: np.ndarray
    cells: np.ndarray
    top: np.ndarray
    bottom: np.ndarray
    elongation: np.ndarray
    c1: float = 0.617
    c2: float = 1.215
    k: float = 500.0
    tolerance: float = 1e-9

    @property
    def dim(self) -> int:
        """2 or 3."""
        return int(self.X.shape[1])

    @property
    def held(self) -> np.ndarray:
        """Mask (n, dim) of the components the grips hold."""
        mask = np.zeros(self.X.shape, bool)
        mask[self.top] = mask[self.bottom] = True
        return mask

    def grips(self, elongation: float) -> np.ndarray:
        """Displacement (n, dim) of the grips, zero elsewhere."""
        u = np.zeros(self.X.shape)
        u[self.top, 1], u[self.bottom, 1] = elongation / 2, -elongation / 2
        return u

    def reaction(self, force: np.ndarray) -> float:
        """Force on the top grip along y [N/mm; N in 3D], of the internal forces (n, dim)."""
        return float(force[self.top, 1].sum())

    def save(self, path: Path) -> None:
        """Write the arrays to an .npz file."""
        np.savez(path, **{f.name: getattr(self, f.name) for f in fields(self)})

    @staticmethod
    def load(path: Path) -> Problem:
        """Read what :meth:`save` wrote."""
        with np.load(path) as data:
            return Problem(**{name: data[name] if data[name].ndim else float(data[name]) for name in data.files})


def make(name: str, mesh: str | None = None) -> Problem:
    """The `plate` on the mesh M4 of the single-edge notch, or the `slab`, its coarse mesh 0.1 mm thick, two layers."""
    import meshio

    mesh = mesh or {"plate": "M4", "slab": "coarse"}[name]
    data = meshio.read(ROOT / "cases" / "single_edge_notch" / "meshes" / f"{mesh}.vtu")
    X, cells = data.points[:, :2], data.cells_dict["quad"].astype(np.int64)
    x, y = X[cells[:, [1, 2, 3]]].transpose(2, 0, 1) - X[cells[:, [0]]].transpose(2, 0, 1)
    turned = x[:, 0] * y[:, 2] < y[:, 0] * x[:, 2]
    cells[turned] = cells[turned, ::-1]
    if name == "slab":
        X, cells = _extruded(X, cells, 0.1, 2)
    y = X[:, 1]
    near = 1e-9 * np.ptp(y)
    return Problem(np.ascontiguousarray(X), cells, np.flatnonzero(y > y.max() - near),
                   np.flatnonzero(y < y.min() + near), np.linspace(0.02, 0.1, 5))


def _extruded(X: np.ndarray, cells: np.ndarray, thickness: float, layers: int) -> tuple[np.ndarray, np.ndarray]:
    z = np.linspace(0, thickness, layers + 1)
    points = np.concatenate([np.column_stack([X, np.full(len(X), height)]) for height in z])
    hexes = [np.hstack([cells + i * len(X), cells + (i + 1) * len(X)]) for i in range(layers)]
    return points, np.concatenate(hexes)
