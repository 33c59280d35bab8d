"""The momentum balance on one mesh: force, stored energy, tangent and mass for a given relative density."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import csr_array

from ..errors import ParameterError
from ..fem.backend import BulkViscosity, MomentumBackend, Part
from ..fem.backends import backend
from ..fem.elements import check_element
from ..fem.pattern import Pattern
from ..fem.space import Space
from ..loads.follower import FollowerLoads
from ..loads.nodal import NodalLoads
from ..loads.sliding import SlidingPlanes
from ..material import GeneralMaterial, Material
from ..material.regions import Region, by_element, rest_of
from .contact import Contact
from .energy import OPTIONAL_TERMS, Ledger

__all__ = ["BulkViscosity", "Momentum", "Part", "terms_without"]


FLAT = 1e-6  # degrees by which fibres may leave the plane of a sheet: rounding


class Momentum:
    """Internal force and its derivatives (Eq. 14-19, 28) for the relative density last given.

    Memory: the density last given to `set_gamma` and the load time last given to `set_time`: `force`, `tangent`,
    `along`, `stiffest`, `viscous_force`, `viscous_tangent`, `lumped_mass` and `consistent_mass` are for these.
    `potential`, `W`, `energy` and `pressed` are of the last `force`, `compression` of the last `viscous_force`.
    `contact` is set once; `book_contact` and `memory` are of what it has seen, and `restore` takes up the last.
    `pressure_work`, `load_size`, `added_stiffness` and `skew_stiffness` are for the load time last given.

    Parameters
    ----------
    space, material: the spaces and the stored energy, of the elements that are in no region.
    element: "jbar" for the element-constant J_bar, "plain" for the standard element, "planestress" for a thin sheet of
        quadrilaterals, whose forces, energies and masses are per mm of undeformed thickness as in plane strain;
        "axisymmetric" for the J_bar of a body of revolution, as which `space` was made: figures are of all of it.
    force_floor: Gauss points with gamma below this exert no force. Their stiffness and mass are then gone together.
    threads: that share the loops over elements; results do not depend on their number.
    regions: elements of other materials.
    kernels: what evaluates the weak forms, a name in :data:`.BACKENDS`.
    dead: dead loads, if there are any, at the load time last given to :meth:`set_time`; `force` is less them.
    followers: pressures that follow the surface, in the same way.
    bulk_viscosity: coefficients of the bulk viscosity; the shear viscosity is that of the materials.

    Attributes
    ----------
    parts: the body by its materials.
    backend: what evaluates the weak forms.
    rho0: density of the intact solid [t/mm^3], a number, or where materials differ one for each element (ne, 1).
    shear_moduli, shear_wave_speeds: least and greatest of the materials [MPa; m/s].
    contact: the medium between the lips of cracks, if there is to be one; :meth:`force` contains its force.
    sliding: planes on which nodes slide, if there are any; matrices are constrained to them, forces are not.
    energy: gamma-weighted stored energy at the last evaluation [N mm; N mm/mm in 2D].
    loads: potential -f.u of the dead loads at the last evaluation, in the same units.
    least_J: least J (plane stress: its part in the plane) at a Gauss point with gamma > 0 at the last evaluation.
    evaluations: how often the force was evaluated.
    is_viscous: whether there is any viscosity, so that `viscous_force` is not zero.
    compression: greatest -L/c_d min(0, D) of an element, with which the bulk viscosity grows.
    """

    def __init__(self, space: Space, material: Material, element: str = "jbar", force_floor: float = 1e-3,
                 threads: int = 1, *, regions: Sequence[Region] = (), dead: NodalLoads | None = None,
                 followers: FollowerLoads | None = None, kernels: str = "compiled",
                 bulk_viscosity: BulkViscosity = BulkViscosity()) -> None:  # noqa: B008
        made = check_element(element, space, kernels)
        self.plane_stress, self.j_bar = made.thin_sheet, made.j_bar
        self.space, self.material, self.element, self.force_floor = space, material, element, force_floor
        self.regions, self.kernels = tuple(regions), kernels
        self.parts = self._divide(regions)
        materials = [part.material for part in self.parts]
        self.bulk_viscosity, self._threads = bulk_viscosity, threads
        self.backend: MomentumBackend = self.new_backend()
        greatest = space.exchange.greatest
        self.is_viscous = any(bulk_viscosity) or greatest(max(m.viscosity for m in materials)) > 0.0
        self.compression = 0.0
        moduli, speeds = [m.shear_modulus for m in materials], [m.shear_wave_speed for m in materials]
        self.shear_moduli = -greatest(-min(moduli)), greatest(max(moduli))
        self.shear_wave_speeds = -greatest(-min(speeds)), greatest(max(speeds))
        rho0 = by_element(space.n_elements, material.rho0, regions, lambda region: region.material.rho0)
        self.rho0 = rho0[:, None] if isinstance(rho0, np.ndarray) else rho0
        self.energy = self.loads = 0.0
        self.dead, self.followers = dead, followers
        if self.plane_stress and followers is not None:
            raise ParameterError("element planestress has no thickness for a pressure on its edges to act on: take "
                                 "jbar, or a dead traction")
        self.contact: Contact | None = None
        self.sliding: SlidingPlanes | None = None
        self.least_J = 1.0
        self.evaluations = 0
        self._intact = self._mass = self._lumped(np.ones_like(space.w))
        self._gamma: np.ndarray | None = np.ones_like(space.w)
        self.backend.set_gamma(self._gamma)

    def new_backend(self) -> MomentumBackend:
        """What evaluates the weak forms, made anew."""
        return backend(self.kernels).momentum(self.space, self.parts, self.element, threads=self._threads,
                                              bulk_viscosity=self.bulk_viscosity)

    def evaluate_by(self, other: MomentumBackend) -> None:
        """Let another backend evaluate the weak forms from now on, or tell that its density has changed."""
        self.backend, self._gamma = other, None

    def _divide(self, regions: Sequence[Region]) -> list[Part]:
        """The body by its materials; without regions it is one part, all elements in their order."""
        space, parts = self.space, []
        rest = rest_of(regions, space.n_elements)
        for material, elements in ((self.material, rest), *((r.material, r.elements) for r in regions)):
            if not elements.size:
                continue
            fibres = None
            if isinstance(material, GeneralMaterial):
                fibres = material.fibres(space.X[space.conn[elements]].mean(axis=1))
                if self.plane_stress:
                    _check_in_plane(fibres, type(material).__name__)
                if space.axisymmetric:
                    _check_mirrored(fibres, type(material).__name__)
            parts.append(Part(material, elements if elements.size < space.n_elements else None, fibres))
        return parts

    @property
    def gamma(self) -> np.ndarray:
        """Effective relative density at the Gauss points, zero in deleted elements and below the floor, (ne, nq)."""
        if self._gamma is None:
            self._gamma = self.backend.untile(self.backend.gamma)
        return self._gamma

    @gamma.setter
    def gamma(self, gamma: np.ndarray) -> None:
        """Only for tangents and masses; forces keep what :meth:`set_gamma` gave."""
        self._gamma = gamma

    def effective(self, gamma: np.ndarray, deleted: np.ndarray, elements: np.ndarray | None = None) -> np.ndarray:
        """Relative density the force sees (ne, nq), for nodal values `gamma` (n,) and `deleted` elements (ne,).

        Of some `elements` (m,) alone if they are given, (m, nq).
        """
        if elements is None:
            at_gauss = self.space.at_gauss(gamma)
        else:
            at_gauss, deleted = gamma[self.space.conn[elements]] @ self.space.N.T, deleted[elements]
        at_gauss[(at_gauss < self.force_floor) | deleted[:, None]] = 0.0
        return at_gauss

    def set_gamma(self, gamma: np.ndarray, deleted: np.ndarray, *, medium: bool = True) -> float:
        """Use the nodal relative density `gamma` (n,) and the `deleted` elements (ne,) from now on.

        Without `medium` that between the lips of cracks stays what it is, as in a step on trial. Returns the energy
        [N mm; N mm/mm in 2D] that its fall takes from the stored energy last evaluated.
        """
        self._gamma = None
        if self.dead is not None:
            nodes, e = self.space.conn[self.dead.elements], self.dead.elements
            self.dead.keep(((gamma[nodes] @ self.space.N.T >= self.force_floor) & ~deleted[e, None]).any(axis=1))
            if self.dead.weighs:
                self.dead.weigh(self.effective(gamma, deleted))
        if self.followers is not None:
            self.followers.keep(gamma, deleted, self.force_floor)
        taken = self.space.exchange.total(self.backend.relax(gamma, deleted, self.force_floor))
        if self.contact is not None:
            self._mass = self._lumped(self.gamma)
            if medium:
                self.contact.update(self.gamma, self._mass, self._intact)
        return taken

    def set_time(self, t: float) -> None:
        """Use the loads of load time `t` [s] from now on."""
        if self.dead is not None:
            self.dead.at(t)
        if self.followers is not None:
            self.followers.at(t)

    @property
    def potential(self) -> float:
        """Stored energy, contact and potential of the dead loads at the last evaluation.

        `force` is its derivative, less the forces of pressures, which have no potential.
        """
        return self.energy + self.loads + self.pressed

    @property
    def pressure_values(self) -> np.ndarray | None:
        """:attr:`.FollowerLoads.values` now, for :meth:`pressure_work` later; None without pressures."""
        return None if self.followers is None else self.followers.values

    def pressure_work(self, u: np.ndarray, end: np.ndarray, before: np.ndarray | None = None,
                      equilibria: bool = False) -> float:
        """Work of the pressures on the straight way from `u` to `end` (n, dim) [N mm; N mm/mm in 2D].

        They stand still in time, or go evenly from those `before`, :attr:`pressure_values` then; see
        :meth:`.FollowerLoads.work` for `equilibria`.
        """
        loads = self.followers
        return 0.0 if loads is None else loads.work(loads.values if before is None else before, u, end, equilibria)

    def load_size(self, u: np.ndarray) -> float:
        """Norms of the nodal forces of dead loads and of pressures at `u`, added [N; N/mm in 2D]."""
        dead = 0.0 if self.dead is None else float(np.linalg.norm(self.dead.values))
        return dead if self.followers is None else dead + self.followers.size(u)

    @property
    def pressed(self) -> float:
        """Energy of the medium between the lips of cracks, of its last evaluation [N mm; N mm/mm in 2D]."""
        return 0.0 if self.contact is None else self.contact.energy

    def book_contact(self, ledger: Ledger, u: np.ndarray) -> None:
        """Book the energy that the medium between lips loses at the displacement `u` (n, dim) as density falls."""
        if self.contact is not None:
            self.contact.book(ledger, u)

    def added_stiffness(self, u: np.ndarray, free: np.ndarray) -> np.ndarray | None:
        """Columns B over the unknowns that are `free` (n*dim,), of a stiffness B B^T beside :meth:`tangent`.

        They are those of lips that press on each other (:meth:`.Contact.tangent`) and of fluids in cavities at the
        displacement `u` (n, dim); None where there are none.
        """
        lips = None if self.contact is None else self.contact.tangent(u)
        fluids = None if self.followers is None else self.followers.stiffening(u)
        if fluids is not None and self.sliding is not None:
            fluids = self.sliding.matrix() @ fluids
        parts = [B for B in (lips, None if fluids is None else fluids[free]) if B is not None]
        return np.hstack(parts) if len(parts) > 1 else parts[0] if parts else None

    def skew_stiffness(self, u: np.ndarray, free: np.ndarray) -> csr_array | None:
        """The part of the stiffness of pressures that is not symmetric; see :meth:`.FollowerLoads.skew`."""
        return None if self.followers is None else self.followers.skew(u, free, self.sliding)

    def memory(self) -> dict[str, np.ndarray]:
        """What contact and pressures remember beyond density and load time, for a checkpoint."""
        return {**({} if self.contact is None else {"contact_rest": self.contact.rest}),
                **({} if self.followers is None else self.followers.memory())}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Take up what :meth:`memory` gave; evaluations after it are with it."""
        if self.contact is not None:
            self.contact.rest[...] = memory["contact_rest"]
        if self.followers is not None:
            self.followers.restore(memory)

    def force(self, u: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
        """Internal force at the displacement `u` less the loads, (n, dim) [N; N/mm in 2D].

        Sets `energy`, `loads`, `least_J` and `W`. With `contact`, nodes without mass are moved in `u` to where they
        follow the lips.
        """
        out = np.empty_like(self.space.X) if out is None else out
        placed = u if self.contact is None else self.contact.place(u)
        exchange, least = self.space.exchange, self.backend.force(u, out)
        self.least_J = -exchange.greatest(-least)
        self.energy = exchange.total(self.backend.energy)
        if self.dead is not None:
            out[self.dead.nodes] -= self.dead.values
            self.loads = self.dead.potential(u)
        if self.followers is not None:
            self.followers.add_force(u, out)
        exchange.whole(out)
        if self.contact is not None:
            self.contact.add_force(placed, out)
        self.evaluations += 1
        return out

    def viscous_force(self, u: np.ndarray, v: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
        """Force of the viscosity at displacement `u` and velocity `v` (n, dim) [mm; mm/s], (n, dim) [N; N/mm in 2D].

        Its power with `v` is never negative. Sets `compression`.
        """
        out = np.empty_like(self.space.X) if out is None else out
        self.compression = self.space.exchange.greatest(self.backend.viscous_force(u, v, out))
        return self.space.exchange.whole(out)

    def unheld(self, x: np.ndarray) -> np.ndarray:
        """Forces or displacements (n, dim) without what planes on which nodes slide take; `x` itself without these."""
        return x if self.sliding is None else self.sliding.along(x)

    def _constrained(self, pattern: Pattern, data: np.ndarray) -> np.ndarray:
        return data if self.sliding is None else self.sliding.constrained(pattern, data)

    def viscous_tangent(self, pattern: Pattern, u: np.ndarray, v: np.ndarray, compression: float = 0.0) -> np.ndarray:
        """Data of the derivative of that force with `v` on `pattern`, symmetric and nowhere negative [N s/mm].

        Elements count as compressed by `compression` at least.
        """
        return self._constrained(pattern, self.backend.viscous_tangent(pattern, (u, v), self.gamma, compression))

    @property
    def W(self) -> np.ndarray:
        """Stored energy density of the undamaged material at the last evaluation [MPa], (ne, nq)."""
        return self.backend.untile(self.backend.W)

    def tangent(self, pattern: Pattern, u: np.ndarray, convex: bool = False) -> np.ndarray:
        """Data of the tangent stiffness at `u` on `pattern`; with `convex` one that is positive at every point.

        The stiffness of pressures, its symmetric part, is in it but where it is to be convex.
        """
        data = self.backend.tangent(pattern, u, self.gamma, convex)
        if self.followers is not None and not convex:
            self.followers.add_stiffness(pattern, u, data)
        return self._constrained(pattern, data)

    def along(self, u: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """:meth:`tangent` as a function of a displacement (n, dim) [mm], for bodies too large for its matrix.

        It gives forces [N; N/mm in 2D], of a part of a body its share of them, until the density changes.
        """
        inner, loads = self.backend.along(u), None if self.followers is None else self.followers.along(u)

        def derivative(d: np.ndarray) -> np.ndarray:
            d = self.unheld(d)
            change = inner(d)
            return self.unheld(change if loads is None else change + loads(d))

        return derivative

    def stiffest(self, u: np.ndarray, inverse_mass: np.ndarray) -> float:
        """Cheap indicator of the highest frequency squared at `u`, and below it [1/s^2].

        The greatest Rayleigh quotient of what each element resists most: a change of volume, or of area in plane
        stress. `inverse_mass` (n, dim) is zero where a degree of freedom is held.
        """
        return self.space.exchange.greatest(self.backend.stiffest(u, inverse_mass))

    def consistent_mass(self, pattern: Pattern) -> np.ndarray:
        """Data of the mass matrix of Eq. (28) on `pattern`."""
        return self._constrained(pattern, self.backend.mass(pattern, self.gamma))

    def lumped_mass(self, floor: float, factors: np.ndarray | None = None) -> np.ndarray:
        """Row sums (n,) [t; t/mm in 2D] of Eq. (28), at least `floor` times those of the intact solid.

        With `factors` (ne, 1) of the mass of elements.
        """
        if factors is not None:
            mass = self._lumped(self.gamma * factors)
        else:
            mass = self._lumped(self.gamma) if self.contact is None else self._mass
        return np.maximum(mass, floor * self._intact)

    def _lumped(self, gamma: np.ndarray) -> np.ndarray:
        """Row sums (n,) of the mass matrix."""
        if isinstance(self.rho0, np.ndarray):
            return self.backend.lump(gamma * self.rho0)
        return self.backend.lump(gamma) * self.rho0


def _check_in_plane(fibres: np.ndarray, material: str) -> None:
    """Refuse directions (ne, families, 3) out of a thin sheet: they would bear a shear stress on its free faces."""
    steepest = float(np.degrees(np.arcsin(min(np.abs(fibres[..., 2]).max(initial=0.0), 1.0))))
    if steepest > FLAT:
        raise ParameterError("element planestress is for isotropic laws, and for fibres in the plane of the sheet; "
                             f"those of {material} rise out of it by up to {steepest:.3g} degrees: let normal be along "
                             "z, or mesh the sheet with hexahedra between free faces")


def _check_mirrored(fibres: np.ndarray, material: str) -> None:
    """Refuse directions (ne, families, 3) that would twist a body of revolution: their mirror images are not there."""
    cosine = np.abs(np.einsum("efi,egi->efg", fibres * [1.0, 1.0, -1.0], fibres))
    if fibres.shape[1] and not (cosine.max(axis=2) > 1.0 - 1e-9).all():
        raise ParameterError(f"the fibres of {material} would twist a body of revolution: let those at plus and minus "
                             f"the angle to r, y or the way around be alike (axis and normal along x, y or z)")


def terms_without(momentum: Momentum, dynamic: bool) -> tuple[str, ...]:
    """The optional terms that neither options nor materials of a run ask for; none of its files has them.

    This alone says whether a term is written, whatever its value: `contact` in runs with contact, `viscous` in
    `dynamic` ones with a viscosity. What is made from the files of a run takes it from the header of `history.csv`.
    """
    asked = {"contact": momentum.contact is not None, "viscous": dynamic and momentum.is_viscous}
    return tuple(name for name in OPTIONAL_TERMS if not asked[name])
