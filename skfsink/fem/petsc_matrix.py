"""Tangents as matrices of PETSc, on one rank or shared by several: GAMG before conjugate gradients, or MUMPS's factors.

A part of a body gives its share of the matrix; PETSc adds shares at nodes between parts. Rows are those of all
components of the nodes that are free in one of them, by the part in which a node counts; held ones have 1 on the
diagonal. GAMG is given what :class:`.Multigrid` gives pyamg: the matrix scaled to a diagonal of ones, and the rigid
motions. PETSc's options are those of the prefix `skfsink_`, as in PETSC_OPTIONS="-skfsink_pc_gamg_threshold 0.01".
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ConvergenceError, ParameterError
from ..system.jit import njit
from .direct import conjugate
from .multigrid import NOT_POSITIVE, rigid_motions
from .pattern import Pattern
from .space import Space

if TYPE_CHECKING:
    from mpi4py import MPI

__all__ = ["GAMG", "MUMPS", "PETSC", "Matrix", "check", "is_there"]

PETSC = GAMG, MUMPS = "petsc-gamg", "petsc-mumps"  #: names of solvers, which solve on all ranks
CHUNK = 200_000   # rows whose values are given to PETSc at once


def check(name: str) -> None:
    """Refuse a solver whose library is not there (ParameterError). PETSc itself is not begun: all ranks have to do it.
    """
    if name in PETSC:
        try:
            import petsc4py  # noqa: F401
        except ImportError as error:
            raise _missing(name, error) from None


def is_there() -> bool:
    """Whether PETSc can be had here."""
    try:
        check(GAMG)
    except ParameterError:
        return False
    return True


def _missing(name: str, why: object) -> ParameterError:
    return ParameterError(f"linear {name} needs petsc4py ({why}): install it, or take linear = 'multigrid' on one rank")


def _load(name: str) -> Any:
    """The module PETSc of petsc4py; ParameterError if it is not there. All ranks load it at once."""
    try:
        from petsc4py import PETSc
    except ImportError as error:
        raise _missing(name, error) from None
    return PETSc


class Matrix:
    """The tangent of a body, or of all of its parts, with what solves for a right-hand side.

    All parts have to call the same, in the same order. Vectors are over the free unknowns that count in this part, in
    the order of their nodes.

    Memory: the matrix last given to `set`, and the hierarchy or the factors last made by `prepare`, which `conjugate`
    and `substitute` use and `release` drops.

    Parameters
    ----------
    name: of the solver, one of :data:`PETSC`.
    space: the mesh of the part.
    free: mask of its unknowns, (n*dim,).
    pattern: of these, the upper triangle.
    comm: the ranks that have parts; None for a body in one piece.

    Raises
    ------
    ParameterError
        petsc4py is not there, or is of another MPI than mpi4py.
    """

    def __init__(self, name: str, space: Space, free: np.ndarray, pattern: Pattern, comm: MPI.Intracomm | None = None
                 ) -> None:
        self._petsc = petsc = _load(name)
        self._gamg, self._exchange, self._comm = name == GAMG, space.exchange, comm or petsc.COMM_SELF
        if comm is not None and petsc.COMM_WORLD.size != comm.size:
            raise ParameterError(f"mpi4py sees {comm.size} ranks and petsc4py {petsc.COMM_WORLD.size}: they are of "
                                 f"different MPIs; install both for one")
        exchange, dim, n = space.exchange, space.dim, space.n_nodes
        used = np.any(free.reshape(n, dim), axis=1)  # nodes come with all of their components
        counted = exchange.counts(n)
        own = counted & used
        bounds = np.concatenate([[0], np.cumsum(exchange.all(np.array([own.sum()])))])
        first = int(bounds[exchange.number])
        number = np.zeros(n)
        number[own] = first + np.arange(own.sum())
        number = exchange.whole(number).astype(petsc.IntType)
        rows = (number[:, None] * dim + np.arange(dim, dtype=petsc.IntType)).ravel()
        self._rows, own_rows = rows[free], np.repeat(own, dim)
        self._place = rows[free & own_rows] - first * dim
        self._held = rows[~free & own_rows]
        self._size = int(own.sum()) * dim
        self._motions = self._rigid(space)[own_rows]
        self._motions[self._held - first * dim] = 0.0
        self._indptr, columns, self._source = _whole_rows(pattern.indptr, pattern.indices)
        self._columns = self._rows[columns]
        self._matrix = self._made(dim, _entries(space, used, np.searchsorted(bounds, number, "right"))[own] * dim)
        self._scaled: Any = None
        self._scale = np.ones(self._size)
        self._cycle: Any = None
        self._in, self._out = self._matrix.createVecs()

    def _rigid(self, space: Space) -> np.ndarray:
        """The rigid motions of the whole body at the nodes of this part."""
        exchange, counted = space.exchange, space.X[space.exchange.counts(space.n_nodes)]
        nodes, *sums = exchange.totals((float(len(counted)), *counted.sum(axis=0).tolist()))
        size = max(exchange.greatest(float(x.max(initial=-np.inf))) + exchange.greatest(-float(x.min(initial=np.inf)))
                   for x in counted.T)
        return rigid_motions(space.X, np.array(sums) / nodes, size)

    def _made(self, dim: int, entries: np.ndarray) -> Any:
        """An empty matrix with room for `entries` (own nodes, 2) a row: of columns of this part, and of others."""
        petsc, size = self._petsc, (self._size, self._petsc.DECIDE)
        room = np.repeat(entries, dim, axis=0)
        total = int(self._exchange.total(self._size))
        room = np.minimum(room, [[self._size, total - self._size]]).astype(petsc.IntType)
        matrix = petsc.Mat().createAIJ((size, size), bsize=dim, comm=self._comm, nnz=(
            np.ascontiguousarray(room[:, 0]), np.ascontiguousarray(room[:, 1])))
        matrix.setOption(petsc.Mat.Option.SYMMETRIC, True)
        return matrix

    def set(self, data: np.ndarray) -> None:
        """Take the share of the matrix of this part, with these values on its pattern."""
        matrix, petsc = self._matrix, self._petsc
        matrix.zeroEntries()
        for low in range(0, self._rows.size, CHUNK):
            start = self._indptr[low:low + CHUNK + 1]
            piece = slice(start[0], start[-1])
            matrix.setValuesIJV((start - start[0]).astype(petsc.IntType), self._columns[piece],
                                data[self._source[piece]], petsc.InsertMode.ADD, self._rows[low:low + CHUNK])
        matrix.setValuesIJV(np.arange(self._held.size + 1, dtype=petsc.IntType), self._held, np.ones(self._held.size),
                            petsc.InsertMode.ADD, self._held)
        matrix.assemble()

    def prepare(self) -> bool:
        """Make the hierarchy or the factors; False if these are of a matrix that is not positive definite.

        Raises
        ------
        ConvergenceError
            There is neither.
        """
        return self._hierarchy() if self._gamg else self._factors()

    def _new_cycle(self, kind: str) -> Any:
        cycle = self._petsc.PC().create(self._comm)
        cycle.setOptionsPrefix("skfsink_")
        cycle.setType(kind)
        return cycle

    def _hierarchy(self) -> bool:
        diagonal = self._matrix.getDiagonal().getArray().copy()
        if not self._exchange.greatest(-float(diagonal.min(initial=np.inf))) < 0.0:
            raise ConvergenceError(NOT_POSITIVE)
        self._scale = 1.0 / np.sqrt(diagonal)
        self._release_cycle()
        if self._scaled is None:
            self._scaled = self._matrix.duplicate(copy=True)
        else:
            self._matrix.copy(self._scaled, self._petsc.Mat.Structure.SAME_NONZERO_PATTERN)
        scale = self._vector(self._scale)
        self._scaled.diagonalScale(scale, scale)
        motions = self._motions / self._scale[:, None]
        gram = self._exchange.sums(motions.T @ motions)
        motions = motions @ np.linalg.inv(np.linalg.cholesky(gram)).T
        self._scaled.setNearNullSpace(self._petsc.NullSpace().create(
            vectors=[self._vector(column) for column in motions.T], comm=self._comm))
        self._cycle = self._new_cycle("gamg")
        self._cycle.setFromOptions()
        self._cycle.setOperators(self._scaled)
        self._cycle.setUp()
        return True

    def _factors(self) -> bool:
        if self._cycle is None:
            self._cycle = self._new_cycle("cholesky")
            self._cycle.setFactorSolverType(self._petsc.Mat.SolverType.MUMPS)
            self._cycle.setOperators(self._matrix)
            self._cycle.setFactorSetUpSolverType()
            self._cycle.getFactorMatrix().setMumpsIcntl(13, 1)  # the signs of all pivots are counted
            self._cycle.setFromOptions()
        self._cycle.setReusePreconditioner(False)
        self._cycle.setUp()
        self._cycle.setReusePreconditioner(True)  # for the matrices that follow
        factors = self._cycle.getFactorMatrix()
        error, negative = factors.getMumpsInfog(1), factors.getMumpsInfog(12)
        if error < 0:
            raise ConvergenceError(f"the direct solver failed: MUMPS reports error {error}"
                                   + (" (not enough memory)" if error in (-8, -9, -11, -13, -19) else ""))
        return bool(negative == 0)

    def _vector(self, values: np.ndarray) -> Any:
        return self._petsc.Vec().createWithArray(np.array(values), size=(self._size, self._petsc.DECIDE),
                                                 comm=self._comm)

    def conjugate(self, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        """Solution with the matrix last given, by conjugate gradients with the hierarchy or the factors kept.

        It ends as :meth:`.Factorization.conjugate` does.
        """
        x, iterations, met = conjugate(self._times, self._precondition, self._wide(b), tolerance, most,
                                       self._exchange.total)
        return x[self._place], iterations, met

    def substitute(self, b: np.ndarray) -> np.ndarray:
        """What the hierarchy makes of a right-hand side in a cycle, or the solution with the factors kept."""
        z: np.ndarray = self._precondition(self._wide(b))[self._place]
        return z

    def _wide(self, b: np.ndarray) -> np.ndarray:
        wide: np.ndarray = np.zeros(self._size)
        wide[self._place] = b
        return wide

    def _times(self, x: np.ndarray) -> np.ndarray:
        self._in.setArray(x)
        self._matrix.mult(self._in, self._out)
        y: np.ndarray = self._out.getArray().copy()
        return y

    def _precondition(self, r: np.ndarray) -> np.ndarray:
        self._in.setArray(self._scale * r)
        self._cycle.apply(self._in, self._out)
        z: np.ndarray = self._scale * self._out.getArray()
        return z

    def _release_cycle(self) -> None:
        if self._cycle is not None:
            self._cycle.destroy()
            self._cycle = None

    def release(self) -> None:
        """Free the memory of all of it; nothing else can be called after."""
        self._release_cycle()
        for matrix in (self._matrix, self._scaled):
            if matrix is not None:
                matrix.destroy()


def _entries(space: Space, used: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Nodes beside each node (n, 2), itself among them, that count in its own part, and in others; at least as many."""
    graph = space.graph
    row = np.repeat(np.arange(space.n_nodes), np.diff(graph.indptr))
    kept, same = used[graph.indices], owner[row] == owner[graph.indices]
    counts = np.stack([np.bincount(row[kept & which], minlength=space.n_nodes) for which in (same, ~same)], axis=1)
    return space.exchange.whole(counts.astype(float))


@njit(cache=True)
def _whole_rows(indptr, indices):  # type: ignore[no-untyped-def]
    """Rows of the whole matrix of which these are the upper triangle, and where their entries stand in that one."""
    n = indptr.size - 1
    start = np.zeros(n + 1, np.int64)
    for i in range(n):
        for k in range(indptr[i], indptr[i + 1]):
            start[i + 1] += 1
            if indices[k] != i:
                start[indices[k] + 1] += 1
    for i in range(n):
        start[i + 1] += start[i]
    columns, source, at = np.empty(start[n], np.int32), np.empty(start[n], np.int32), start[:-1].copy()
    for i in range(n):  # those of earlier rows have come to this one by now
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            columns[at[i]], source[at[i]] = j, k
            at[i] += 1
            if j != i:
                columns[at[j]], source[at[j]] = i, k
                at[j] += 1
    return start, columns, source
