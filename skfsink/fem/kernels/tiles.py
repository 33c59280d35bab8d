"""Element data in tiles of neighbouring elements, so that the force loops run on whole vector registers.

Element e sits in lane e % lanes of tile e // lanes. An array with `rows` numbers for each element is stored as
(tiles, rows, lanes): the same number of neighbouring elements is contiguous, and one tile's working set stays in the
first-level cache. The last tile is filled up with copies of the last element that carry gamma = 0 and are never read.
Each part of a body of several materials has tiles of its own, its elements in ascending order and its last tile filled
up: the loops run over one part after the other, and the sums at the nodes over all.

Bytes an explicit step has to move for one quadrilateral (hexahedron): 16 (32) connectivity, 160 (640) geometry,
32 (64) gamma, 32 (64) energy density written, 64 (192) force written and read again.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple

import numba
import numpy as np

from ...material import CompiledLaw
from ..space import Space
from .faster import Faster
from .general_sheet_tangent import stiffness_general_sheet
from .lanes import LANES, LANES_3D
from .loops import FORCES, GENERAL_FORCES, VISCOUS, VOLUMETRIC
from .nodal_sums import Sums, sum_at_nodes
from .plane_stress import stiffness_plane_stress
from .records import Elements, Viscous, Volumetric
from .relax import relax

__all__ = ["Law", "Tiles"]

Loop = Callable[..., float]

DIFFERENCE = 1e-6  # of the smallest element: displacement of a central difference of forces, at the most

class Law(NamedTuple):
    """Stored energy as the loops take it: psi, its constants, and the bulk modulus [MPa]."""

    psi: CompiledLaw
    constants: np.ndarray
    bulk_modulus: float


class _Part(NamedTuple):
    """Tiles of the elements of one material, parts of the arrays of the whole body, and the loop for their force.

    `stiffness` is that of plane stress alone.
    """

    loop: Loop
    elements: Elements
    stiffness: Callable[..., float]


class Tiles:
    """Tiled copy of a space's geometry, and the internal force evaluated on it.

    Memory: the densities last given to `set_gamma` or `relax`, of which `force`, `along`, `viscous_force` and
    `volumetric` are, and the results of the last evaluation; `tile`, `untile`, `set_gamma` and `relax` depend on no
    earlier call but for the energy that `relax` returns, which is of the last evaluation.

    Attributes
    ----------
    gamma: relative density at the Gauss points as the force uses it, tiled; set with :meth:`set_gamma`.
    W: stored energy density of Eq. (31) [MPa] at the last evaluation, tiled.
    psi: gamma-weighted stored energy of each element [N mm, or N mm/mm in 2D] at the last evaluation, (tiles, lanes).
    lanes: elements in a tile.

    `parts` divides the body by materials: for each its elements (None for all), and None, or for a law of several
    invariants the directions of its fibres (elements, families, 3).

    The loops over tiles are shared by `threads` threads, those of the machine at the most, where that is faster (see
    :class:`.Faster`) and the body has `WORTH` Gauss points; results do not depend on it.
    """

    WORTH = 20_000

    def __init__(self, space: Space, plane_stress: bool = False, threads: int = 1,
                 parts: Sequence[tuple[np.ndarray | None, np.ndarray | None]] = ((None, None),)) -> None:
        self.space = space
        na, dim = space.conn.shape[1], space.dim
        self.lanes = LANES if dim == 2 else LANES_3D
        ends = self._arrange([elements for elements, _ in parts])
        self.conn, self.geometry = self.tile(space.nodes), self._geometry()
        self.gamma = np.zeros((self.count, na, self.lanes))
        self.W = np.zeros((self.count, na, self.lanes))
        self.psi = np.zeros((self.count, self.lanes))
        self._force = np.zeros((self.count, na * dim, self.lanes))
        self._parts = []
        for (_, fibres), a, b in zip(parts, ends[:-1], ends[1:]):
            directions = np.empty((b - a, 0, self.lanes)) if fibres is None else _in_tiles(
                fibres.reshape(len(fibres), -1), self.lanes)
            loop = (FORCES if fibres is None else GENERAL_FORCES)[0 if plane_stress else dim]
            self._parts.append(_Part(loop, Elements(self.conn[a:b], self.geometry[a:b], self.gamma[a:b], directions,
                                                    self._force[a:b], self.W[a:b], self.psi[a:b]),
                                     stiffness_plane_stress if fibres is None else stiffness_general_sheet))
        none = np.empty((self.count, 0, self.lanes))
        self._whole = Elements(self.conn, self.geometry, self.gamma, none, self._force, self.W, self.psi)
        most: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
        self.threads = 1 if space.w.size < self.WORTH else min(threads, most)
        self._faster: dict[object, Faster] = {}
        self._viscous: tuple[np.ndarray, list[Elements]] | None = None
        start, entry = space.incidence
        element, local = np.divmod(entry, na)
        tile, lane = np.divmod(np.arange(self.count * self.lanes)[self._place][element], self.lanes)
        self._start = start.astype(np.uint32)
        self._offset = (((tile * na + local) * dim) * self.lanes + lane).astype(np.uint32)

    def _arrange(self, parts: Sequence[np.ndarray | None]) -> list[int]:
        """Give each element its lane; tiles at which the parts begin, and the number of all."""
        ne, lanes = self.space.n_elements, self.lanes
        ends = [0]
        for elements in parts:
            ends.append(ends[-1] - (-(ne if elements is None else elements.size) // lanes))
        self.count = ends[-1]
        self._place: slice | np.ndarray = slice(0, ne)   # of the elements among all lanes
        self._element: np.ndarray | None = None          # in each lane, if they are not in order
        if len(parts) > 1:
            self._place, self._element = np.empty(ne, np.int64), np.empty(self.count * lanes, np.int64)
            for elements, first, end in zip(parts, ends[:-1], ends[1:]):
                assert elements is not None
                self._place[elements] = first * lanes + np.arange(elements.size)
                self._element[first * lanes:end * lanes] = elements[-1]
                self._element[self._place[elements]] = elements
        return ends

    def _geometry(self) -> np.ndarray:
        """See :class:`.Elements`: by component, then Gauss point."""
        space, lanes, made = self.space, self.lanes, 512  # tiles at a time
        element = np.minimum(np.arange(self.count * lanes), space.n_elements - 1) if self._element is None else (
            self._element)
        out: np.ndarray = np.empty((self.count, space.w.shape[1] * (space.dim**2 + 1 + space.axisymmetric), lanes))
        for tile in range(0, self.count, made):
            some = element[tile * lanes:(tile + made) * lanes]
            around = [1.0 / (space.X[space.conn[some], 0] @ space.N.T)[:, :, None]] if space.axisymmetric else []
            inverse = space.inverse(some).reshape(some.size, -1, space.dim**2)
            rows = np.concatenate([inverse, space.w[some][:, :, None], *around], axis=2)
            out[tile:tile + made] = _in_tiles(rows.transpose(0, 2, 1).reshape(some.size, -1), lanes)
        return out

    def tile(self, values: np.ndarray) -> np.ndarray:
        """(ne, rows) as tiles (count, rows, lanes)."""
        return _in_tiles(values if self._element is None else values[self._element], self.lanes)

    def untile(self, values: np.ndarray) -> np.ndarray:
        """Tiles (count, rows, lanes) back as (ne, rows)."""
        return np.ascontiguousarray(values.transpose(0, 2, 1)).reshape(-1, values.shape[1])[self._place]

    def set_gamma(self, gamma: np.ndarray) -> None:
        """Give the force loops new relative densities at the Gauss points, (ne, nq)."""
        used = np.zeros((self.count, 1, self.lanes), bool)
        used.reshape(-1)[self._place] = True
        self.gamma[...] = np.where(used, self.tile(gamma), 0.0)

    def relax(self, nodal: np.ndarray, deleted: np.ndarray, floor: float) -> float:
        """Give the force loops the Q1 field with nodal values (n,), zero below `floor` and in `deleted` elements (ne,).

        Returns the energy [N mm, or N mm/mm in 2D] its fall takes from the stored energy of the last evaluation.
        """
        gone = np.ones((self.count, self.lanes), bool)
        gone.reshape(-1)[self._place] = deleted
        return float(relax(nodal, self.space.N, gone, floor, self._whole))

    def force(self, x: np.ndarray, laws: Sequence[Law], out: np.ndarray, j_bar: bool = True) -> float:
        """Internal force (Eq. 17) at the positions `x` (n, dim) [mm] into `out` (n, dim) [N, or N/mm in 2D].

        `laws` are those of the parts. Fills `W` and `psi`, and returns the least J at a Gauss point with gamma > 0.
        `j_bar=False` takes J instead of its element mean (the plain element, which locks).
        """
        least = self._evaluate(x, laws, j_bar, [part.elements for part in self._parts])
        self._sum(self._force, out)
        return least

    def along(self, x: np.ndarray, laws: Sequence[Law], j_bar: bool = True) -> Callable[[np.ndarray], np.ndarray]:
        """The derivative of :meth:`force` at the positions `x`, as a function of a displacement (n, dim) [mm].

        It is made by central differences, and no matrix is. What :meth:`force` has left is not touched.
        """
        scratch = self._apart(self._force.shape), self._apart(self.W.shape), self._apart(self.psi.shape)
        parts = [part.elements._replace(force=force, W=W, psi=psi)
                 for part, force, W, psi in zip(self._parts, *(arrays for _, arrays in scratch))]
        local, step, out = scratch[0][0], DIFFERENCE * float(self.space.h.min()), np.empty((2, *x.shape))

        def derivative(d: np.ndarray) -> np.ndarray:
            greatest = float(np.abs(d).max())
            if greatest == 0.0:
                return np.zeros_like(d)
            for sign, force in zip((1.0, -1.0), out):
                self._evaluate(x + sign * step / greatest * d, laws, j_bar, parts)
                self._sum(local, force)
            change: np.ndarray = (out[0] - out[1]) * (greatest / (2.0 * step))
            return change

        return derivative

    def _evaluate(self, x: np.ndarray, laws: Sequence[Law], j_bar: bool, parts: Sequence[Elements]) -> float:
        """Forces of the elements of all `parts`, and what the loops leave there; the least J, at the most 1."""
        least = 1.0
        for number, (law, part, elements) in enumerate(zip(laws, self._parts, parts)):
            least = min(least, *self._share(part.loop, number, law.psi.address, law.constants,
                                            Volumetric(law.bulk_modulus, j_bar), x, elements))
        return least

    def _apart(self, shape: tuple[int, ...]) -> tuple[np.ndarray, list[np.ndarray]]:
        """An array over all tiles, and its part for each material."""
        whole: np.ndarray = np.zeros(shape)
        ends = np.cumsum([len(part.elements.conn) for part in self._parts])
        return whole, np.split(whole, ends[:-1])

    def viscous_force(self, x: np.ndarray, v: np.ndarray, laws: Sequence[Viscous], out: np.ndarray) -> float:
        """Viscous force at positions `x` and velocities `v` (n, dim) [mm; mm/s] into `out` (n, dim) [N, or N/mm in 2D].

        `laws` are those of the parts. Returns the greatest compression -L/c_d min(0, D) of an element with gamma > 0,
        0 without bulk viscosity. What :meth:`force` has left is not touched.
        """
        if self._viscous is None:
            force, shares = self._apart(self._force.shape)
            self._viscous = force, [part.elements._replace(force=own) for part, own in zip(self._parts, shares)]
        force, parts = self._viscous
        greatest = 0.0
        for number, (law, elements) in enumerate(zip(laws, parts)):
            greatest = max(greatest, *self._share(VISCOUS[self.space.dim], number, law, x, v, elements))
        self._sum(force, out)
        return greatest

    def _sum(self, local: np.ndarray, out: np.ndarray) -> None:
        """Sum at the nodes (n, dim) of what the elements have there."""
        self._share(sum_at_nodes, 0, local.reshape(-1), self._offset, np.uint32(self.lanes), Sums(self._start, out))

    def _share(self, loop: Loop, part: int, *arguments: object) -> list[float]:
        """What the shares of a loop return, by one thread or several, whichever was faster when last compared.

        A share is a run of neighbouring tiles or nodes. Threads call the very loop that one calls, so that no bit
        depends on their number: compiled again for shares it might add in another order.
        """
        if self.threads == 1:
            return [float(loop(*arguments))]
        with self._faster.setdefault((loop, part), Faster()) as several:
            if not several:
                return [float(loop(*arguments))]
            own, *others = (_share_of(arguments, s, self.threads) for s in range(self.threads))
            pool = _pool(self.threads - 1, os.getpid())
            waiting = [pool.submit(loop, *theirs) for theirs in others]
            return [float(loop(*own)), *(float(one.result()) for one in waiting)]

    def volumetric(self, x: np.ndarray, bulk_moduli: Sequence[float], inverse_mass: np.ndarray) -> float:
        """Greatest k gamma_bar V |b|^2_(1/m) of an element, b = dJ_bar/du, at `x`: a frequency squared [1/s^2].

        `bulk_moduli` are those of the parts; `inverse_mass` (n, dim) is zero where a degree of freedom is held.
        """
        loop = VOLUMETRIC[self.space.dim]
        return max(k * max(self._share(loop, number, x, part.elements, inverse_mass))
                   for number, (k, part) in enumerate(zip(bulk_moduli, self._parts)))

    def plane_stiffness(self, x: np.ndarray, laws: Sequence[Law], inverse_mass: np.ndarray) -> float:
        """What :meth:`volumetric` is, for plane stress, where nothing resists a change of area but shear."""
        return max(float(part.stiffness(law.psi.address, law.constants, law.bulk_modulus, x, part.elements,
                                        inverse_mass)) for law, part in zip(laws, self._parts))

    def mean_force(self) -> float:
        """Mean magnitude of the forces the elements exert on their nodes, by component, at the last evaluation.

        Unlike the sums at the nodes it does not vanish in equilibrium, so it says what a small residual is.
        """
        _, rows, _ = self._force.shape
        return float(np.abs(self._force).sum()) / (rows * self.space.n_elements)


def _share_of(arguments: tuple[object, ...], s: int, shares: int) -> list[object]:
    """Arguments of share number `s`: of what can be shared, its share."""
    return [x.share(s, shares) if isinstance(x, Elements | Sums) else x for x in arguments]


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads beside the one that asks, of a process: one that was forked has none of its parent's."""
    return ThreadPoolExecutor(threads)


def _in_tiles(values: np.ndarray, lanes: int) -> np.ndarray:
    """(m, rows) as tiles (-(-m // lanes), rows, lanes), filled up with the last row."""
    full = np.concatenate([values, np.repeat(values[-1:], -len(values) % lanes, axis=0)])
    return np.ascontiguousarray(full.reshape(len(full) // lanes, lanes, -1).transpose(0, 2, 1))
