"""Finite element spaces on four-node quadrilaterals (plane strain) and eight-node hexahedra.

One :class:`Space` holds what both fields share and never changes in a run: the scikit-fem bases (displacement Q1,
density Q1, element constants), the 2x2(x2) Gauss points, the shape functions and their gradients there, and the
operators built on them: element means (the projection that gives J_bar, Eq. 13), sums from elements to nodes, and
the fixed sparsity of the matrices.

Nodes of an element and its Gauss points are numbered lexicographically, the first reference coordinate running
fastest: node (i, j[, k]) of the unit square or cube has the number i + 2j [+ 4k], and Gauss point q is the one
nearest to node q. Shapes: n nodes, `ne` elements, `na` = 4 or 8 nodes and as many Gauss points `nq` in an element,
`dim` = 2 or 3. Displacement component i of node a is degree of freedom dim*a + i, as in scikit-fem.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import skfem
from scipy.sparse import coo_array, csr_array

from ..errors import MeshError
from ..system.jit import njit
from .exchange import ALONE, Exchange
from .quadrature import AXES, points, shape_functions

__all__ = ["Space", "node_key"]

_ELEMENTS = {"quad": skfem.ElementQuad1, "hex": skfem.ElementHex1}


@dataclass(frozen=True, eq=False)
class Space:
    """Spaces, quadrature and fixed operators on one mesh.

    Parameters
    ----------
    mesh: scikit-fem `MeshQuad` or `MeshHex`, coordinates in mm.
    exchange: with the other parts of the body, if this is one of several.

    Raises
    ------
    MeshError
        The mesh has other elements, unused nodes, or an element whose Jacobian is not positive at a Gauss point.
    """

    mesh: skfem.Mesh
    exchange: Exchange = ALONE
    X: np.ndarray = field(init=False)      #: nodal coordinates [mm], (n, dim)
    conn: np.ndarray = field(init=False)   #: nodes of the elements, lexicographic, (ne, na)
    N: np.ndarray = field(init=False)      #: shape functions at the Gauss points, (nq, na)
    dN: np.ndarray = field(init=False)     #: their gradients Grad N [1/mm], (ne, nq, na, dim)
    w: np.ndarray = field(init=False)      #: quadrature weights times Jacobian [mm^dim], (ne, nq)
    invJ: np.ndarray = field(init=False)   #: d xi/d X [1/mm], (ne, nq, dim, dim)

    def __post_init__(self) -> None:
        name = self.mesh.refdom.name.lower()[:4].rstrip("a")
        kind = {"quad": "quad", "hexa": "hex", "hex": "hex"}.get(name)
        if kind is None or self.mesh.t.shape[0] not in (4, 8):
            raise MeshError(f"elements must be four-node quadrilaterals or eight-node hexahedra; "
                            f"got {type(self.mesh).__name__}")
        dim = {"quad": 2, "hex": 3}[kind]
        mesh = self.mesh
        reference = mesh.elem.refdom.p[AXES[dim]].T.astype(int)
        order = np.argsort(reference @ (2 ** np.arange(dim)))
        X = np.ascontiguousarray(mesh.p.T)
        if not np.isfinite(X).all():
            raise MeshError("the mesh has a node whose coordinates are not finite numbers")
        N, dN_ref = shape_functions(points(dim))
        for _ in range(2):
            conn = np.ascontiguousarray(mesh.t[order].T).astype(np.int64)
            J = np.einsum("eai,qak->eqik", X[conn], dN_ref)
            detJ = np.linalg.det(J)
            if not (detJ < 0).all():
                break
            # numbered in the other sense throughout: exchange the first two axes of every element
            swapped = reference[:, [1, 0, *range(2, dim)]] @ (2 ** np.arange(dim))
            mesh = type(mesh)(mesh.p, np.ascontiguousarray(mesh.t[order[swapped]]))
        object.__setattr__(self, "mesh", mesh)
        unused = len(X) - len(np.unique(conn))
        if unused:
            raise MeshError(f"the mesh has {unused} node(s) that belong to no element")
        if not (detJ > 0).all():
            e = int(np.argmin(detJ.min(axis=1)))
            raise MeshError(f"element {e} is inverted or degenerate: its Jacobian is {detJ[e].min():.3g} at a Gauss "
                            f"point, and must be positive")
        invJ = np.linalg.inv(J)
        for name_, value in (("X", X), ("conn", conn), ("N", N), ("w", detJ / 2**dim), ("invJ", invJ),
                             ("dN", np.einsum("qak,eqkJ->eqaJ", dN_ref, invJ))):
            value = np.ascontiguousarray(value)
            value.setflags(write=False)
            object.__setattr__(self, name_, value)

    @property
    def dim(self) -> int:
        """Dimension of the mesh, 2 (plane strain) or 3."""
        return int(self.X.shape[1])

    @property
    def n_nodes(self) -> int:
        """Number of nodes, and of density unknowns."""
        return len(self.X)

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return len(self.conn)

    @cached_property
    def V(self) -> np.ndarray:
        """Referential volume (area in 2D) of the elements [mm^dim], (ne,)."""
        return self.w.sum(axis=1)

    @cached_property
    def element_dofs(self) -> np.ndarray:
        """Displacement degrees of freedom of the elements, (ne, na*dim)."""
        return (self.conn[:, :, None] * self.dim + np.arange(self.dim)).reshape(self.n_elements, -1)

    @cached_property
    def h(self) -> np.ndarray:
        """Size of the elements, V^(1/dim) [mm], (ne,)."""
        return self.V ** (1 / self.dim)

    # --- scikit-fem bases, on the same Gauss points in the same order ---
    def rule(self, ends: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Points (dim, nq) and weights (nq,) in scikit-fem's axes, with `ends` as :func:`.points` takes it."""
        return points(self.dim, ends).T[AXES[self.dim]], np.full(2**self.dim, 0.5**self.dim)

    @cached_property
    def gamma_basis(self) -> skfem.Basis:
        """Q1 basis of the relative density."""
        return skfem.Basis(self.mesh, self._elements(_ELEMENTS), quadrature=self.rule())

    @cached_property
    def u_basis(self) -> skfem.Basis:
        """Q1 vector basis of the displacement."""
        return self.gamma_basis.with_element(skfem.ElementVector(self._elements(_ELEMENTS)))

    def _elements(self, table: dict[str, type]) -> skfem.Element:
        return table["quad" if self.dim == 2 else "hex"]()

    # --- operators ---
    def at_gauss(self, nodal: np.ndarray) -> np.ndarray:
        """Values (ne, nq) at the Gauss points of the Q1 field with nodal values (n,)."""
        out = np.empty_like(self.w)
        _at_gauss(np.ascontiguousarray(nodal, float), self.nodes, self.N, out)
        return out

    def gradient(self, nodal: np.ndarray) -> np.ndarray:
        """Gradient (ne, nq, ..., dim) of the Q1 field with nodal values (n, ...)."""
        return np.einsum("ea...,eqaJ->eq...J", nodal[self.conn], self.dN)

    def deformation_gradient(self, u: np.ndarray) -> np.ndarray:
        """F = I + Grad u at the Gauss points, (ne, nq, 3, 3); plane strain in 2D (F_33 = 1)."""
        F = np.zeros((self.n_elements, self.w.shape[1], 3, 3))
        F[...] = np.eye(3)
        F[..., :self.dim, :self.dim] += self.gradient(u)
        return F

    def element_mean(self, values: np.ndarray) -> np.ndarray:
        """L2 projection (ne,) of Gauss point values (ne, nq) on the element constants (Eq. 13)."""
        return np.einsum("eq,eq->e", self.w, values) / self.V

    def mean_slopes(self) -> np.ndarray:
        """Means over the elements of the gradients of the shape functions [1/mm], (ne, na, dim)."""
        return np.einsum("eq,eqai->eai", self.w, self.dN) / self.V[:, None, None]

    def lump(self, values: np.ndarray) -> np.ndarray:
        """Row sums of the mass matrix with weight `values` (ne, nq):  sum_q w_q values_q N_a(q), (n,)."""
        out = np.zeros(self.n_nodes)
        _lump(self.w, np.ascontiguousarray(values, float), self.nodes, self.N, out)
        return self.exchange.whole(out)

    @cached_property
    def nodes(self) -> np.ndarray:
        """`conn` unsigned, which spares the compiled loops a test for negative indices."""
        return self.conn.astype(np.uint32)

    @cached_property
    def incidence(self) -> tuple[np.ndarray, np.ndarray]:
        """Elements at a node: (`start` (n+1,), `entry`), entry = na*element + local node, ascending for each node."""
        entry = np.argsort(self.conn.ravel(), kind="stable")
        start = np.zeros(self.n_nodes + 1, np.int64)
        np.cumsum(np.bincount(self.conn.ravel(), minlength=self.n_nodes), out=start[1:])
        return start, entry

    @cached_property
    def outer_faces(self) -> np.ndarray:
        """Mask (ne, 2 dim) of the faces (in 2D: sides) that belong to one element only, numbered 2 axis + side."""
        faces = np.stack([node_key(self.conn[:, corners], self.n_nodes) for corners in self.face_corners], axis=1)
        _, index, count = np.unique(faces, return_inverse=True, return_counts=True)
        mask: np.ndarray = (count == 1)[index].reshape(faces.shape)
        return mask

    @property
    def face_corners(self) -> np.ndarray:
        """Local nodes of these faces, (2 dim, na/2)."""
        corners = np.arange(2**self.dim)
        return np.array([corners[(corners >> axis & 1) == side] for axis in range(self.dim) for side in range(2)])

    @cached_property
    def graph(self) -> csr_array:
        """Node adjacency: nodes that share an element, symmetric with a full diagonal, (n, n)."""
        na = self.conn.shape[1]
        rows, cols = np.repeat(self.conn, na, axis=1).ravel(), np.tile(self.conn, (1, na)).ravel()
        graph = csr_array(coo_array((np.ones(rows.size, np.int8), (rows, cols)), shape=(self.n_nodes,) * 2))
        graph.sum_duplicates()
        graph.data[:] = 1
        return graph


def node_key(nodes: np.ndarray, n: int) -> np.ndarray:
    """One number for each row of nodes (m, 1 to 4) out of n, in any order; three nodes tell the faces of hexahedra."""
    ordered = np.sort(nodes, axis=1)[:, :3]
    key: np.ndarray = ordered @ (n ** np.arange(ordered.shape[1] - 1, -1, -1, dtype=np.int64))
    return key


@njit(cache=True)
def _at_gauss(nodal, conn, N, out):  # type: ignore[no-untyped-def]
    if conn.shape[1] == 4:
        for e in range(conn.shape[0]):
            x0, x1, x2, x3 = nodal[conn[e, 0]], nodal[conn[e, 1]], nodal[conn[e, 2]], nodal[conn[e, 3]]
            for q in range(4):
                out[e, q] = N[q, 0] * x0 + N[q, 1] * x1 + N[q, 2] * x2 + N[q, 3] * x3
        return
    x = np.empty(8)
    for e in range(conn.shape[0]):
        for a in range(8):
            x[a] = nodal[conn[e, a]]
        for q in range(8):
            total = 0.0
            for a in range(8):
                total += N[q, a] * x[a]
            out[e, q] = total


@njit(cache=True)
def _lump(w, values, conn, N, out):  # type: ignore[no-untyped-def]
    if conn.shape[1] == 4:
        for e in range(conn.shape[0]):
            x0, x1 = w[e, 0] * values[e, 0], w[e, 1] * values[e, 1]
            x2, x3 = w[e, 2] * values[e, 2], w[e, 3] * values[e, 3]
            for a in range(4):
                out[conn[e, a]] += x0 * N[0, a] + x1 * N[1, a] + x2 * N[2, a] + x3 * N[3, a]
        return
    x = np.empty(8)
    for e in range(conn.shape[0]):
        for q in range(8):
            x[q] = w[e, q] * values[e, q]
        for a in range(8):
            total = 0.0
            for q in range(8):
                total += x[q] * N[q, a]
            out[conn[e, a]] += total
