"""Which elements and nodes of a body a part of it has."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import skfem

from .space import Space

__all__ = ["Selection", "selected_mesh"]


@dataclass(frozen=True, eq=False)
class Selection:
    """Some elements of a body and their nodes, in the order in which a part of it has them.

    Parameters
    ----------
    elements, nodes: their numbers in the whole body, (m,) and (k,).
    n_elements, n_nodes: of the whole body.
    """

    elements: np.ndarray
    nodes: np.ndarray
    n_elements: int
    n_nodes: int

    @cached_property
    def element(self) -> np.ndarray:
        """Number in the part of each element of the body, (n_elements,); -1 of those it does not have."""
        return _here(self.elements, self.n_elements)

    @cached_property
    def node(self) -> np.ndarray:
        """Number in the part of each node of the body, (n_nodes,); -1 of those it does not have."""
        return _here(self.nodes, self.n_nodes)


def selected_mesh(space: Space, part: Selection) -> skfem.Mesh:
    """Elements and nodes of a part, of the mesh of the whole body."""
    return type(space.mesh)(np.ascontiguousarray(space.X[part.nodes].T),
                            np.ascontiguousarray(part.node[space.mesh.t[:, part.elements]]))


def _here(numbers: np.ndarray, count: int) -> np.ndarray:
    here = np.full(count, -1)
    here[numbers] = np.arange(numbers.size)
    return here
