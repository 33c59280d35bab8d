"""Follower loads on a mesh: pressures as nodal forces on the deformed surface, their stiffness and their work."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from scipy.sparse import coo_array, csr_array

from ..errors import ParameterError
from ..fem.facets import Facets
from ..fem.kernels.surface import add_pressure, pressure_tangents, swept_volumes
from ..fem.pattern import Pattern
from ..fem.selection import Selection
from ..fem.space import Space
from .grips import Ramp
from .pressure import Filling, Pressure
from .sliding import SlidingPlanes
from .wetted import WettedSurface

__all__ = ["FollowerLoads"]

_Load = Pressure | Filling


class FollowerLoads:
    """Nodal forces f_a = -p int N_a n da of pressures on the deformed surface, n its outward normal.

    They have no potential in general, so that their work is found on the way: it is exact on a straight one.

    Memory: the load time last given to `at`; the facets that bear load, of the density last given to `keep`; the
    displacement last given to `add_force` or `size`, at which the volume below a facet that fails is kept; what `hold`
    has added to fluids; in a part of a body, its space last given to `on`. `of_part`, `check_closed`, `pressures`,
    `work`, `add_stiffness`, `along`, `skew`, `stiffening`, `stiffest`, `swept`, `area`, `idle` and `nodes` are for
    these; `memory` gives what a checkpoint needs, and `restore` takes it up.

    Parameters
    ----------
    space: the mesh.
    loads: each with the nodes of its boundary; it acts on the facets of the surface that have all their nodes in it.

    Attributes
    ----------
    values: of each load at the time last given to `at`: a pressure [MPa], or the volume pumped in [mm^volume_dim];
        replaced, never changed.
    areas: of the undeformed boundaries [mm^(volume_dim-1)].
    places: of its facets of undamaged boundaries among those of the whole body, of which it is a part, (b,).

    Raises
    ------
    MeshError
        The mesh has no facet on a boundary.
    ParameterError
        Two loads act on one facet.
    """

    def __init__(self, space: Space, loads: Sequence[tuple[np.ndarray, _Load]]) -> None:
        self.space, self.loads = space, tuple(load for _, load in loads)
        self._fillings = [(k, load) for k, load in enumerate(self.loads) if isinstance(load, Filling)]
        in_crack = [k for k, load in enumerate(self.loads) if isinstance(load, Pressure) and load.in_crack]
        self._wet = WettedSurface(space, [(load.boundary, nodes) for nodes, load in loads], in_crack)
        self._kept_volume = np.zeros(self._wet.bears.size)  # swept below each facet that does not bear load any more
        self._added = np.zeros(len(self.loads))             # to the volumes pumped in, at the start of an event
        self._last: np.ndarray | None = None                # displacement last evaluated
        self.places = np.arange(self._wet.bears.size)
        self.areas = self.area(np.zeros_like(space.X))
        self.at(0.0)

    @property
    def nodes(self) -> np.ndarray:
        """Nodes of the facets that bear load now, (k,)."""
        return self._wet.nodes

    # --- parts of a body ---
    def of_part(self, part: Selection) -> FollowerLoads:
        """What a part of the body has of them, to be put `on` the space of this part: forces are its shares then."""
        own = copy(self)
        own._wet = self._wet.of_part(part)
        own.places = np.flatnonzero(part.element[self._wet.boundary.elements] >= 0)
        own._kept_volume, own._added, own._last = self._kept_volume[own.places], self._added.copy(), None
        del own.space
        return own

    def on(self, space: Space) -> None:
        """Act on the `space` of the part."""
        self.space = space
        self._wet.on(space)

    # --- the loads at a time ---
    def at(self, t: float) -> None:
        """Take the loads of load time `t` [s]."""
        self.values = np.array([c.value(t) if isinstance(c := _course(load), Ramp) else c * t for load in self.loads])

    def rates(self, t: float) -> np.ndarray:
        """Rates of all loads from load time `t` on, (loads,) [MPa/s; mm^volume_dim/s]."""
        return np.array([_rate(load, t) for load in self.loads])

    def rate(self, t: float) -> float:
        """Fastest change of a given pressure from load time `t` on [MPa/s]; it decides on load increments."""
        return max((abs(_rate(load, t)) for load in self.loads if isinstance(load, Pressure)), default=0.0)

    def speed(self, t: float) -> float:
        """Fastest mean motion of the boundary of a filling from load time `t` on [mm/s]."""
        return max((abs(_rate(load, t)) / float(self.areas[k]) for k, load in self._fillings), default=0.0)

    def keep(self, gamma: np.ndarray, deleted: np.ndarray, floor: float) -> None:
        """Let loads act where elements bear force; see :meth:`.WettedSurface.keep`."""
        before = self._wet.bears
        if self._wet.keep(gamma, deleted, floor) and self._fillings:
            self._kept_volume[self._wet.bears] = 0.0
            if self._last is not None:
                dies = before & ~self._wet.bears
                self._kept_volume[dies] = self._swept(self._last, self._wet.boundary.some(dies),
                                                      self._wet.boundary_owner[dies])

    # --- forces, stiffness, work ---
    def pressures(self, u: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Pressure of each load at the displacement `u` (n, dim), (loads,) [MPa]; `values` are of now if left out."""
        values = self.values if values is None else values
        if not self._fillings:
            return values
        p, volumes = values.copy(), self.swept(u)
        for k, load in self._fillings:
            p[k] = (p[k] + self._added[k] - volumes[k]) / load.compliance
        return p

    def hold(self, u: np.ndarray, pressures: np.ndarray) -> None:
        """Give fluids the volumes with which they have the `pressures` (loads,) at `u` (n, dim), now.

        An event begins with a body that is scaled past its onset; a stiff fluid would burst it, or let go of it.
        """
        volumes = self.swept(u)
        for k, load in self._fillings:
            self._added[k] = pressures[k] * load.compliance + volumes[k] - self.values[k]

    def add_force(self, u: np.ndarray, out: np.ndarray) -> None:
        """Take the forces at the displacement `u` from `out`, both (n, dim): it is the internal force less loads.

        In a part of a body, the shares of its facets.
        """
        if self._fillings:
            self._last = u.copy()
        self._add_pressure(self.pressures(u), u, out)

    def _add_pressure(self, p: np.ndarray, u: np.ndarray, out: np.ndarray) -> None:
        """Add p int N_a n da at the displacement `u` to `out`, both (n, dim); `p` (loads,) may be any."""
        add_pressure(self._wet.facets.nodes, self._wet.owner, p, self.space.X, u, out, self.space.axisymmetric)

    def idle(self, free: np.ndarray) -> list[int]:
        """Numbers of the loads that strain nothing: where they push, all nodes are held, and no crack is to be theirs.

        `free` (n, dim) is of the degrees of freedom.
        """
        found, alone = [], np.eye(len(self.loads))
        for number, load in enumerate(self.loads):
            force, nowhere = np.zeros((2, *self.space.X.shape))
            self._add_pressure(alone[number], nowhere, force)
            moves = float(np.abs(force[free]).max(initial=0.0))
            if moves <= 1e-9 * float(np.abs(force).max()) and not (isinstance(load, Pressure) and load.in_crack):
                found.append(number)
        return found

    def size(self, u: np.ndarray) -> float:
        """Norm of the nodal forces at `u` [N; N/mm in 2D]."""
        out = np.zeros_like(self.space.X)
        self.add_force(u, out)
        exchange = self.space.exchange
        counted = exchange.whole(out)[exchange.counted]
        return math.sqrt(exchange.total(float(np.vdot(counted, counted))))

    def work(self, before: np.ndarray, u: np.ndarray, end: np.ndarray, equilibria: bool = False) -> float:
        """Work on the straight way from `u` to `end` (n, dim), while `values` (loads,) go evenly from those `before`.

        Between `equilibria` the pressures of fluids go evenly as well: a body in equilibrium leaves the straight way to
        follow its fluid.
        """
        first, last = self.pressures(u, before), self.pressures(end)
        for k, load in self._fillings if not equilibria else ():  # p = (Q - V)/C, where V goes as the way has it
            mean, half = 0.5 * (first[k] + last[k]), 0.5 * (self.values[k] - before[k]) / load.compliance
            first[k], last[k] = mean - half, mean + half
        return self._swept_work(first, last, u, end)

    def _swept_work(self, first: np.ndarray, last: np.ndarray, u: np.ndarray, end: np.ndarray) -> float:
        """Work of pressures that go evenly from the `first` to the `last` (loads,)."""
        out = np.empty(self._wet.owner.size)
        swept_volumes(self._wet.facets.nodes, self._wet.owner, np.stack([first, last]), self.space.X, u, end, out,
                      self.space.axisymmetric)
        return self.space.exchange.total(float(out.sum()))

    def add_stiffness(self, pattern: Pattern, u: np.ndarray, data: np.ndarray) -> None:
        """Add the symmetric part of the load stiffness at `u`, at fixed pressures, to `data` on the `pattern`."""
        K = self._stiffness(u)
        slot = pattern.slot[self._wet.facets.elements[:, None, None], self._unknowns[:, :, None],
                            self._unknowns[:, None, :]]
        there = slot >= 0
        np.add.at(data, slot[there], K[there])

    def along(self, u: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """That part as a function of a displacement (n, dim) [mm], which gives forces [N; N/mm in 2D]."""
        K, nodes = self._stiffness(u), self._wet.facets.nodes

        def derivative(d: np.ndarray) -> np.ndarray:
            change, own = np.zeros_like(d), d[nodes]
            np.add.at(change, nodes, np.einsum("fij,fj->fi", K, own.reshape(len(K), -1)).reshape(own.shape))
            return change

        return derivative

    def _stiffness(self, u: np.ndarray) -> np.ndarray:
        """Symmetric parts of the load stiffness of the facets at `u`, at fixed pressures, (f, k*dim, k*dim)."""
        K = self._tangents(u, self.pressures(u))
        return 0.5 * (K + K.transpose(0, 2, 1))

    @property
    def _unknowns(self) -> np.ndarray:
        """Unknowns of the facets by their numbers in the element, (f, k*dim)."""
        dim, local = self.space.dim, self._wet.facets.local
        unknowns: np.ndarray = (local[:, :, None] * dim + np.arange(dim)).reshape(len(local), dim * local.shape[1])
        return unknowns

    def skew(self, u: np.ndarray, free: np.ndarray, sliding: SlidingPlanes | None = None) -> csr_array | None:
        """The other part, over the unknowns that are `free` (n*dim,); None where it vanishes.

        It does where the surface is closed, or its rim is held or slides in the planes that close it, be they oblique
        ones, `sliding`.
        """
        return self._skew(u, free, sliding, self.pressures(u))

    def check_closed(self, free: np.ndarray, sliding: SlidingPlanes | None = None) -> None:
        """Refuse a filling whose boundary encloses no volume: the rim of a cavity must not move out of its planes.

        `free` is the mask of the unknowns that nothing holds, (n*dim,), but for planes oblique to the axes, `sliding`.

        Raises
        ------
        ParameterError
            There is such a filling.
        """
        for k, load in self._fillings:
            if self._skew(np.zeros_like(self.space.X), free, sliding, np.eye(len(self.loads))[k]) is not None:
                raise ParameterError(f"the boundary {load.boundary!r} of a filling encloses no volume: hold "
                                     f"its rim, or let it slide in planes of symmetry, or close it")

    def _skew(self, u: np.ndarray, free: np.ndarray, sliding: SlidingPlanes | None, p: np.ndarray) -> csr_array | None:
        K = self._tangents(u, p)
        K = 0.5 * (K - K.transpose(0, 2, 1))
        dofs = (self._wet.facets.nodes[:, :, None] * self.space.dim + np.arange(self.space.dim)).reshape(len(K), -1)
        rows = np.repeat(dofs, dofs.shape[1], axis=1).ravel()
        columns = np.tile(dofs, (1, dofs.shape[1])).ravel()
        matrix = csr_array(coo_array((K.ravel(), (rows, columns)), shape=(free.size,) * 2))
        if sliding is not None:
            P = sliding.matrix()
            matrix = csr_array(P @ matrix @ P)
        matrix = matrix[free][:, free]
        matrix.sum_duplicates()
        scale = float(np.abs(K).max(initial=0.0))
        return matrix if scale > 0.0 and float(np.abs(matrix.data).max(initial=0.0)) > 1e-9 * scale else None

    def _tangents(self, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Derivatives of the forces of the facets at `u` under pressures `p` (loads,), (f, k*dim, k*dim)."""
        unknowns = self._wet.facets.nodes.shape[-1] * self.space.dim
        K = np.empty((self._wet.owner.size, unknowns, unknowns))
        pressure_tangents(self._wet.facets.nodes, p[self._wet.owner], self.space.X + u, K, self.space.axisymmetric)
        return K

    def stiffening(self, u: np.ndarray) -> np.ndarray | None:
        """Columns B (n*dim, fillings) of the stiffness B B^T by which fluids resist a change of volume, or None."""
        if not self._fillings:
            return None
        columns = np.zeros((len(self._fillings), *self.space.X.shape))
        for column, (k, load) in zip(columns, self._fillings):
            p = np.zeros(len(self.loads))
            p[k] = load.compliance**-0.5
            self._add_pressure(p, u, column)
            self.space.exchange.whole(column)
        return columns.reshape(len(columns), -1).T

    def stiffest(self, u: np.ndarray, inverse_mass: np.ndarray) -> float:
        """Bound of what fluids add to the highest frequency squared at `u` [1/s^2]; `inverse_mass` is (n, dim)."""
        B = self.stiffening(u)
        if B is None:
            return 0.0
        exchange = self.space.exchange
        weights = np.where(exchange.counts(self.space.n_nodes)[:, None], inverse_mass, 0.0).ravel()
        return exchange.total(float(np.einsum("ik,i,ik->", B, weights, B)))

    # --- volumes and areas ---
    def swept(self, u: np.ndarray) -> np.ndarray:
        """Volume by which the boundaries have opened at `u`, (loads,) [mm^3; mm^2 in 2D].

        That by which a cavity has grown where its boundary is closed, or by planes in which the rim slides. In a crack
        it is counted from the undeformed crack on; the volume below elements that have failed stays as it was.
        """
        count = len(self.loads)
        volumes = np.bincount(self._wet.owner, self._swept(u, self._wet.facets, self._wet.owner), minlength=count)
        volumes = volumes + np.bincount(self._wet.boundary_owner, self._kept_volume, minlength=count)
        return self.space.exchange.sums(volumes)

    def _swept(self, u: np.ndarray, facets: Facets, owner: np.ndarray) -> np.ndarray:
        out, X = np.empty(owner.size), self.space.X
        swept_volumes(facets.nodes, owner, np.ones((2, len(self.loads))), X, np.zeros_like(X), u, out,
                      self.space.axisymmetric)
        return out

    def area(self, u: np.ndarray) -> np.ndarray:
        """Area of the boundaries that bear load, deformed by `u`, (loads,) [mm^2; mm in 2D]."""
        return self.space.exchange.sums(np.bincount(self._wet.owner, self._wet.area(u), minlength=len(self.loads)))

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What they remember beyond density and load time, for a checkpoint."""
        return {"kept_volume": self._kept_volume.copy(), "added_volume": self._added.copy()} if self._fillings else {}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Take up what :meth:`memory` gave; the density of then is to be given to :meth:`keep` before any force."""
        self._last = None
        if self._fillings:
            self._kept_volume[...], self._added[...] = memory["kept_volume"], memory["added_volume"]


def _course(load: _Load) -> float | Ramp:
    return load.rate if isinstance(load, Pressure) else load.inflow


def _rate(load: _Load, t: float) -> float:
    course = _course(load)
    return course.rate(t) if isinstance(course, Ramp) else course
