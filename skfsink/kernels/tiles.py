"""Element data in tiles of neighbouring elements, so that the force loops run on whole vector registers.

Element e sits in lane e % lanes of tile e // lanes. An array with `rows` numbers for each element is stored as
(tiles, rows, lanes): the same number of neighbouring elements is contiguous, and one tile's working set stays in the
first-level cache. The last tile is filled up with copies of the last element that carry gamma = 0 and are never read.

Bytes an explicit step has to move for one quadrilateral (hexahedron): 16 (32) connectivity, 160 (640) geometry,
32 (64) gamma, 32 (64) energy density written, 64 (192) force written and read again.
"""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from numba import njit

from ..material import CompiledLaw
from ..space import Space
from .faster import Faster
from .lanes import LANES, LANES_3D
from .plane_stress import stiffness_plane_stress
from .relax import relax
from .shared import FORCES, GENERAL_FORCES, VOLUMETRIC

__all__ = ["Tiles"]


class Tiles:
    """Tiled copy of a space's geometry, and the internal force evaluated on it.

    Attributes
    ----------
    gamma: relative density at the Gauss points as the force uses it, tiled; set with :meth:`set_gamma`.
    W: stored energy density of Eq. (31) [MPa] at the last evaluation, tiled.
    psi: gamma-weighted stored energy of each element [N mm, or N mm/mm in 2D] at the last evaluation, (tiles, lanes).
    lanes: elements in a tile.

    With `fibres` (ne, families, 3), directions, `law` is one of several invariants, in plane strain or space.

    The loops over tiles are shared by `threads` threads, those of the machine at the most, where that is faster (see
    :class:`.Faster`) and the body has `WORTH` Gauss points; results do not depend on it.
    """

    WORTH = 20_000

    def __init__(self, space: Space, plane_stress: bool = False, threads: int = 1,
                 fibres: np.ndarray | None = None) -> None:
        self.space = space
        ne, na, dim = space.n_elements, space.conn.shape[1], space.dim
        self.lanes = LANES if dim == 2 else LANES_3D
        self.count = -(-ne // self.lanes)
        geometry = np.concatenate([space.invJ.reshape(ne, na, dim * dim), space.w[:, :, None]], axis=2)
        self.conn = self.tile(space.conn).astype(np.uint32)
        self.geometry = self.tile(geometry.transpose(0, 2, 1).reshape(ne, -1))  # by component, then Gauss point
        self.gamma = np.zeros((self.count, na, self.lanes))
        self.W = np.zeros((self.count, na, self.lanes))
        self.psi = np.zeros((self.count, self.lanes))
        self._force = np.zeros((self.count, na * dim, self.lanes))
        self._kernels = FORCES[0 if plane_stress else dim] if fibres is None else GENERAL_FORCES[dim]
        self._fibres = () if fibres is None else (self.tile(fibres.reshape(ne, -1)),)
        most: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
        self.threads = 1 if space.w.size < self.WORTH else min(threads, most)
        self._faster: dict[object, Faster] = {}
        start, entry = space.incidence
        element, local = np.divmod(entry, na)
        tile, lane = np.divmod(element, self.lanes)
        self._start = start.astype(np.uint32)
        self._offset = (((tile * na + local) * dim) * self.lanes + lane).astype(np.uint32)

    def tile(self, values: np.ndarray) -> np.ndarray:
        """(ne, rows) as tiles (count, rows, lanes)."""
        pad = self.count * self.lanes - len(values)
        full = np.concatenate([values, np.repeat(values[-1:], pad, axis=0)])
        return np.ascontiguousarray(full.reshape(self.count, self.lanes, -1).transpose(0, 2, 1))

    def untile(self, values: np.ndarray) -> np.ndarray:
        """Tiles (count, rows, lanes) back as (ne, rows)."""
        return np.ascontiguousarray(values.transpose(0, 2, 1)).reshape(-1, values.shape[1])[:self.space.n_elements]

    def set_gamma(self, gamma: np.ndarray) -> None:
        """Give the force loops new relative densities at the Gauss points, (ne, nq)."""
        self.gamma[...] = self.tile(gamma)
        used = self.space.n_elements - (self.count - 1) * self.lanes
        self.gamma[-1, :, used:] = 0.0

    def relax(self, nodal: np.ndarray, deleted: np.ndarray, floor: float) -> float:
        """Give the force loops the Q1 field with nodal values (n,), zero below `floor` and in `deleted` elements (ne,).

        Returns the energy [N mm, or N mm/mm in 2D] its fall takes from the stored energy of the last evaluation.
        """
        gone = np.ones((self.count, self.lanes), bool)
        gone.reshape(-1)[:deleted.size] = deleted
        return float(relax(self.conn, nodal, self.space.N, gone, floor, self.geometry, self.W, self.gamma))

    def force(self, x: np.ndarray, law: CompiledLaw, constants: np.ndarray, bulk_modulus: float,
              out: np.ndarray, j_bar: bool = True) -> float:
        """Internal force (Eq. 17) at the positions `x` (n, dim) [mm] into `out` (n, dim) [N, or N/mm in 2D].

        Fills `W` and `psi`, and returns the least J at a Gauss point with gamma > 0. `j_bar=False` takes J instead of
        its element mean (the plain element, which locks).
        """
        least = min(self._share(self._kernels, law, constants, bulk_modulus, self.conn, x, self.geometry, self.gamma,
                                *self._fibres, j_bar, self._force, self.W, self.psi))
        _sum_at_nodes(self._force.reshape(-1), self._start, self._offset, self.lanes, out)
        return least

    def _share(self, loops: tuple[Callable[..., float], Callable[..., None]], *arguments: object) -> list[float]:
        """What the shares of a loop return, from one thread or several, whichever was faster when last compared."""
        single, shared = loops
        if self.threads == 1:
            return [float(single(*arguments))]
        numba.set_num_threads(self.threads)
        results = np.empty(self.threads)
        choice = self._faster.setdefault(single, Faster())
        with choice as several:
            if not several:
                return [float(single(*arguments))]
            shared(*arguments, results)
        return [float(result) for result in results]

    def volumetric(self, x: np.ndarray, inverse_mass: np.ndarray) -> float:
        """Greatest gamma_bar V |b|^2_(1/m) of an element, b = dJ_bar/du, at `x`; times k a frequency squared [1/s^2].

        `inverse_mass` (n, dim) is zero where a degree of freedom is held.
        """
        return max(self._share(VOLUMETRIC[self.space.dim], self.conn, x, self.geometry, self.gamma, inverse_mass))

    def plane_stiffness(self, x: np.ndarray, law: CompiledLaw, constants: np.ndarray, bulk_modulus: float,
                        inverse_mass: np.ndarray) -> float:
        """What :meth:`volumetric` times k is, for plane stress, where nothing resists a change of area but shear."""
        return float(stiffness_plane_stress(law, constants, bulk_modulus, self.conn, x, self.geometry, self.gamma,
                                            inverse_mass))

    def mean_force(self) -> float:
        """Mean magnitude of the forces the elements exert on their nodes, by component, at the last evaluation.

        Unlike the sums at the nodes it does not vanish in equilibrium, so it says what a small residual is.
        """
        _, rows, _ = self._force.shape
        return float(np.abs(self._force).sum()) / (rows * self.space.n_elements)


@njit(cache=True)
def _sum_at_nodes(local, start, offset, lanes, out):  # type: ignore[no-untyped-def]
    n, dim = out.shape
    two = np.uint32(2 * lanes)
    for a in range(n):
        f0, f1, f2 = 0.0, 0.0, 0.0
        for k in range(start[a], start[a + 1]):
            at = offset[k]
            f0 += local[at]
            f1 += local[at + np.uint32(lanes)]
            if dim == 3:
                f2 += local[at + two]
        out[a, 0] = f0
        out[a, 1] = f1
        if dim == 3:
            out[a, 2] = f2
