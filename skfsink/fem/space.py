"""Finite element spaces on four-node quadrilaterals, plane or of a body of revolution, and eight-node hexahedra.

One :class:`Space` holds what both fields share and never changes in a run: the scikit-fem bases (displacement Q1,
density Q1, element constants), the 2x2(x2) Gauss points, the shape functions and their gradients there, and the
operators built on them: element means (the projection that gives J_bar, Eq. 13), sums from elements to nodes, and
the fixed sparsity of the matrices.

Nodes of an element and its Gauss points are numbered lexicographically, the first reference coordinate running
fastest: node (i, j[, k]) of the unit square or cube has the number i + 2j [+ 4k], and Gauss point q is the one
nearest to node q. A body of revolution about the y axis is meshed in its half plane x = R >= 0; its quadrature weights
are 2 pi R dA, so that all integrals are those of the whole body. Shapes: n nodes, `ne` elements, `na` = 4 or 8 nodes
and as many Gauss points `nq` in an element, `dim` = 2 or 3. Displacement component i of node a is degree of freedom
dim*a + i, as in scikit-fem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import skfem
from scipy.sparse import csr_array

from ..errors import MeshError, place_text
from .dissection import factor_entries
from .exchange import ALONE, Exchange
from .graph import adjacency, incidence, node_key
from .interpolation import at_gauss, lump, slopes
from .quadrature import AXES, points, shape_functions

__all__ = ["Space"]

CHUNK = 4096    # elements whose geometry is made at a time
ON_AXIS = 1e-9  # of the size of a body of revolution: x up to which a node is on its axis
_ELEMENTS = {"quad": skfem.ElementQuad1, "hex": skfem.ElementHex1}


@dataclass(frozen=True, eq=False)
class Space:
    """Spaces, quadrature and fixed operators on one mesh.

    Parameters
    ----------
    mesh: scikit-fem `MeshQuad` or `MeshHex`, coordinates in mm.
    axisymmetric: whether the quadrilaterals are the half plane x >= 0 of a body of revolution about the y axis.
    exchange: with the other parts of the body, if this is one of several.

    Raises
    ------
    MeshError
        The mesh has other elements, unused nodes, or an element whose Jacobian is not positive at a Gauss point; or
        that of a body of revolution is one of hexahedra, or has a node at x < 0.
    """

    mesh: skfem.Mesh
    axisymmetric: bool = False
    exchange: Exchange = ALONE
    X: np.ndarray = field(init=False)      #: nodal coordinates [mm], (n, dim)
    conn: np.ndarray = field(init=False)   #: nodes of the elements, lexicographic, (ne, na)
    N: np.ndarray = field(init=False)      #: shape functions at the Gauss points, (nq, na)
    w: np.ndarray = field(init=False)      #: quadrature weights of the body [mm^volume_dim], (ne, nq)
    dX: np.ndarray = field(init=False)     #: those of the mesh, which are the same but for 2 pi R [mm^dim], (ne, nq)
    _unit: np.ndarray = field(init=False, repr=False)  # gradients of N on the unit square or cube, (nq, na, dim)

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
        object.__setattr__(self, "_unit", dN_ref)
        for _ in range(2):
            conn = np.ascontiguousarray(mesh.t[order].T).astype(np.int64)
            detJ = np.concatenate([np.linalg.det(J) for J in _jacobians(X, conn, dN_ref)])
            if not (detJ < 0).all():
                break
            # numbered in the other sense throughout: exchange the first two axes of every element
            swapped = reference[:, [1, 0, *range(2, dim)]] @ (2 ** np.arange(dim))
            mesh = type(mesh)(mesh.p, np.ascontiguousarray(mesh.t[order[swapped]]))
        object.__setattr__(self, "mesh", mesh)
        unused = len(X) - np.count_nonzero(np.bincount(conn.ravel(), minlength=len(X)))
        if unused:
            raise MeshError(f"the mesh has {unused} node(s) that belong to no element")
        if not (detJ > 0).all():
            e = int(np.argmin(detJ.min(axis=1)))
            raise MeshError(f"element {e} is inverted or degenerate: its Jacobian is {detJ[e].min():.3g} at a Gauss "
                            f"point near {place_text(X[conn[e]].mean(axis=0))} mm, and must be positive: mend the mesh "
                            f"there")
        dX = detJ / 2**dim
        w = dX * self._round(X, conn, N) if self.axisymmetric else dX
        for name_, value in (("X", X), ("conn", conn), ("N", N), ("dX", dX), ("w", w)):
            value = np.ascontiguousarray(value)
            value.setflags(write=False)
            object.__setattr__(self, name_, value)

    def _round(self, X: np.ndarray, conn: np.ndarray, N: np.ndarray) -> np.ndarray:
        """Way around the axis of a body of revolution at the Gauss points, 2 pi R [mm], (ne, nq)."""
        if X.shape[1] == 3:
            raise MeshError("a body of revolution is meshed by quadrilaterals in its half plane x >= 0; this mesh has "
                            "hexahedra: take element jbar")
        least = int(np.argmin(X[:, 0]))
        if X[least, 0] < -ON_AXIS * float(np.ptp(X, axis=0).max()):
            raise MeshError(f"a body of revolution about the y axis has its mesh at x >= 0; the node at "
                            f"{place_text(X[least])} mm is beyond the axis: move the mesh by {-X[least, 0]:.3g} mm "
                            f"along x, or keep its half")
        return 2.0 * np.pi * (X[conn, 0] @ N.T)

    # --- geometry of elements, by some of them at a time: of all it takes 2 kB a hexahedron ---
    def chunks(self) -> Iterator[slice]:
        """All elements in order, some thousands at a time."""
        return (slice(at, min(at + CHUNK, self.n_elements)) for at in range(0, self.n_elements, CHUNK))

    @cached_property
    def invJ(self) -> np.ndarray:
        """d xi/d X [1/mm], (ne, nq, dim, dim); it is kept."""
        whole: np.ndarray = np.empty((*self.w.shape, self.dim, self.dim))
        for some in self.chunks():
            whole[some] = self.inverse(some)
        whole.setflags(write=False)
        return whole

    def inverse(self, elements: np.ndarray | slice) -> np.ndarray:
        """d xi/d X of some elements, (m, nq, dim, dim)."""
        if "invJ" in self.__dict__:
            return self.invJ[elements]
        found = [np.linalg.inv(J) for J in _jacobians(self.X, self.conn[elements], self._unit)]
        return found[0] if len(found) == 1 else np.concatenate(found)

    @property
    def dN(self) -> np.ndarray:
        """Grad N of all elements, see :meth:`slopes`: made anew each time."""
        return self.slopes(slice(None))

    def slopes(self, elements: np.ndarray | slice) -> np.ndarray:
        """Gradients of the shape functions Grad N at the Gauss points of some elements [1/mm], (m, nq, na, dim)."""
        inverse = self.invJ[elements]
        found: np.ndarray = np.empty((len(inverse), *self._unit.shape))
        slopes(self._unit, inverse, found)
        found.setflags(write=False)
        return found

    @cached_property
    def on_axis(self) -> np.ndarray:
        """Mask of the nodes on the axis of revolution, (n,); there is none in other bodies."""
        if not self.axisymmetric:
            return np.zeros(self.n_nodes, bool)
        near: np.ndarray = self.X[:, 0] <= ON_AXIS * float(np.ptp(self.X, axis=0).max())
        return near

    def revolved(self) -> Space:
        """The same mesh as the half plane of a body of revolution."""
        return Space(self.mesh, axisymmetric=True)

    @property
    def dim(self) -> int:
        """Dimension of the mesh, 2 or 3."""
        return int(self.X.shape[1])

    @property
    def volume_dim(self) -> int:
        """Dimension of the body: 3 of one of revolution too; 2 of a plane one, whose figures are per mm of thickness.
        """
        return 3 if self.axisymmetric else self.dim

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
        """Referential volume (area in the plane) of the elements [mm^volume_dim], (ne,)."""
        return self.w.sum(axis=1)

    @cached_property
    def factor_entries(self) -> float:
        """Entries of the factor of a matrix of the nodes, with one unknown each; see :mod:`.dissection`."""
        return factor_entries(self.conn, self.X)

    @cached_property
    def extent(self) -> np.ndarray:
        """Volume or area of the elements in the mesh [mm^dim], (ne,): V, but of rings their section."""
        return self.dX.sum(axis=1)

    @cached_property
    def around(self) -> np.ndarray:
        """N_a/R at the Gauss points of a body of revolution [1/mm], (ne, nq, na): they give u_r/R, the hoop strain."""
        return self.N / (self.X[self.conn, 0] @ self.N.T)[:, :, None]

    @cached_property
    def element_dofs(self) -> np.ndarray:
        """Displacement degrees of freedom of the elements, (ne, na*dim)."""
        return (self.conn[:, :, None] * self.dim + np.arange(self.dim)).reshape(self.n_elements, -1)

    @cached_property
    def h(self) -> np.ndarray:
        """Size of the elements in the mesh, its extent^(1/dim) [mm], (ne,)."""
        return self.extent ** (1 / self.dim)

    # --- scikit-fem bases, on the same Gauss points in the same order ---
    def rule(self, ends: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Points (dim, nq) and weights (nq,) in scikit-fem's axes, with `ends` as :func:`.points` takes it."""
        return points(self.dim, ends).T[AXES[self.dim]], np.full(2**self.dim, 0.5**self.dim)

    @cached_property
    def gamma_basis(self) -> skfem.Basis:
        """Q1 basis of the relative density."""
        return self.measured(skfem.Basis(self.mesh, self._elements(_ELEMENTS), quadrature=self.rule()))

    @cached_property
    def u_basis(self) -> skfem.Basis:
        """Q1 vector basis of the displacement."""
        return self.measured(self.gamma_basis.with_element(skfem.ElementVector(self._elements(_ELEMENTS))))

    def measured(self, basis: Any) -> Any:
        """A new basis on elements or facets of the mesh, made to integrate over the body: 2 pi R dA of revolution."""
        if self.axisymmetric:
            basis.dx = 2.0 * np.pi * np.asarray(basis.global_coordinates())[0] * basis.dx
        return basis

    def _elements(self, table: dict[str, type]) -> skfem.Element:
        return table["quad" if self.dim == 2 else "hex"]()

    # --- operators ---
    def at_gauss(self, nodal: np.ndarray) -> np.ndarray:
        """Values (ne, nq) at the Gauss points of the Q1 field with nodal values (n,)."""
        out = np.empty_like(self.w)
        at_gauss(np.ascontiguousarray(nodal, float), self.nodes, self.N, out)
        return out

    def gradient(self, nodal: np.ndarray) -> np.ndarray:
        """Gradient (ne, nq, ..., dim) of the Q1 field with nodal values (n, ...)."""
        out: np.ndarray = np.empty((*self.w.shape, *nodal.shape[1:], self.dim))
        for some in self.chunks():
            np.einsum("ea...,eqaJ->eq...J", nodal[self.conn[some]], self.slopes(some), out=out[some])
        return out

    def deformation_gradient(self, u: np.ndarray) -> np.ndarray:
        """F = I + Grad u at the Gauss points, (ne, nq, 3, 3); in 2D F_33 = 1, or r/R of a body of revolution."""
        F = np.zeros((self.n_elements, self.w.shape[1], 3, 3))
        F[...] = np.eye(3)
        F[..., :self.dim, :self.dim] += self.gradient(u)
        self.add_hoop(F, u)
        return F

    def add_hoop(self, F: np.ndarray, u: np.ndarray, elements: np.ndarray | slice = slice(None)) -> None:
        """Add u_r/R at the Gauss points of `elements` (m,) to the F_33 of `F` (m, nq, 3, 3); nothing if none turns."""
        if self.axisymmetric:
            F[..., 2, 2] += np.einsum("ea,eqa->eq", u[self.conn[elements], 0], self.around[elements])

    def element_mean(self, values: np.ndarray) -> np.ndarray:
        """L2 projection (ne,) of Gauss point values (ne, nq) on the element constants (Eq. 13)."""
        return np.einsum("eq,eq->e", self.w, values) / self.V

    def mean_slopes(self) -> np.ndarray:
        """Derivatives of the mean volume ratio of the undeformed elements with the displacements [1/mm], (ne, na, dim).

        They are the means of the gradients of the shape functions, and of N_a/R in a body of revolution.
        """
        slopes: np.ndarray = np.empty((*self.conn.shape, self.dim))
        for some in self.chunks():
            np.einsum("eq,eqai->eai", self.w[some], self.slopes(some), out=slopes[some])
        slopes /= self.V[:, None, None]
        if self.axisymmetric:
            slopes[..., 0] += np.einsum("eq,eqa->ea", self.w, self.around) / self.V[:, None]
        return slopes

    def lump(self, values: np.ndarray) -> np.ndarray:
        """Row sums of the mass matrix with weight `values` (ne, nq):  sum_q w_q values_q N_a(q), (n,)."""
        return self.exchange.whole(self.lumped(values))

    def lumped(self, values: np.ndarray) -> np.ndarray:
        """The share of this part in these row sums, (n,)."""
        out = np.zeros(self.n_nodes)
        lump(self.w, np.ascontiguousarray(values, float), self.nodes, self.N, out)
        return out

    @cached_property
    def nodes(self) -> np.ndarray:
        """`conn` unsigned, which spares the compiled loops a test for negative indices."""
        return self.conn.astype(np.uint32)

    @property
    def incidence(self) -> tuple[np.ndarray, np.ndarray]:
        """Elements at a node: (`start` (n+1,), `entry`), entry = na*element + local node, ascending for each node.

        It is made anew each time.
        """
        return incidence(self.nodes, self.n_nodes)

    @cached_property
    def outer_faces(self) -> np.ndarray:
        """Mask (ne, 2 dim) of the faces (in 2D: sides) that belong to one element only, numbered 2 axis + side."""
        return self.faces_without(np.zeros(0, int))

    def faces_without(self, gone: np.ndarray) -> np.ndarray:
        """The same of the body without the elements `gone` (their numbers), which have no faces."""
        there = np.ones(self.n_elements, bool)
        there[gone] = False
        faces = self._faces[there]
        mask = np.zeros(self._faces.shape, bool)
        mask[there] = (np.bincount(faces.ravel()) == 1)[faces]
        return mask

    @cached_property
    def _faces(self) -> np.ndarray:
        """Numbers of the faces of the elements, (ne, 2 dim): equal where elements share one."""
        faces = np.stack([node_key(self.conn[:, corners], self.n_nodes) for corners in self.face_corners], axis=1)
        return np.unique(faces, return_inverse=True)[1].reshape(faces.shape).astype(np.int32)

    @property
    def face_corners(self) -> np.ndarray:
        """Local nodes of these faces, (2 dim, na/2)."""
        corners = np.arange(2**self.dim)
        return np.array([corners[(corners >> axis & 1) == side] for axis in range(self.dim) for side in range(2)])

    @cached_property
    def graph(self) -> csr_array:
        """Node adjacency: nodes that share an element, symmetric with a full diagonal, (n, n)."""
        return adjacency(self.nodes, self.n_nodes)


def _jacobians(X: np.ndarray, conn: np.ndarray, dN_ref: np.ndarray) -> Iterator[np.ndarray]:
    """d X/d xi (m, nq, dim, dim) of the elements `conn` (ne, na), :data:`CHUNK` of them at a time."""
    for at in range(0, len(conn), CHUNK):
        yield np.einsum("eai,qak->eqik", X[conn[at:at + CHUNK]], dN_ref)
