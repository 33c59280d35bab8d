"""How good the elements of a mesh are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fem.space import Space

__all__ = ["Quality"]


@dataclass(frozen=True, eq=False)
class Quality:
    """Figures of the elements of a mesh, each (ne,).

    Attributes
    ----------
    jacobian: scaled Jacobian, the least over the corners: 1 where all angles are right, <= 0 where a corner is flat or
        bent inwards.
    aspect: longest over shortest edge.
    h: size, the root of the area or the cube root of the volume [mm].
    """

    jacobian: np.ndarray
    aspect: np.ndarray
    h: np.ndarray

    @classmethod
    def of(cls, space: Space) -> Quality:
        """The quality of the elements of a space."""
        dim, x = space.dim, space.X[space.conn]
        jacobian = np.full(space.n_elements, np.inf)
        edges = []
        for corner in range(2**dim):
            away = [x[:, corner ^ 1 << i] - x[:, corner] for i in range(dim)]
            unit = np.stack([a / np.linalg.norm(a, axis=1)[:, None] for a in away], axis=1)
            sense = (-1) ** bin(corner).count("1")
            jacobian = np.minimum(jacobian, sense * np.linalg.det(unit))
            edges += [np.linalg.norm(a, axis=1) for i, a in enumerate(away) if not corner >> i & 1]
        return cls(jacobian, np.max(edges, axis=0) / np.min(edges, axis=0), space.h)

    def rows(self, length: float) -> list[tuple[str, float, float, float]]:
        """Least, median and greatest of each figure, with l/h for the `length` l [mm]."""
        figures = {"scaled Jacobian": self.jacobian, "aspect": self.aspect, "h (mm)": self.h, "l/h": length / self.h}
        return [(name, float(v.min()), float(np.median(v)), float(v.max())) for name, v in figures.items()]
