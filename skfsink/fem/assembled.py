"""The weak forms assembled by scikit-fem: the backend to try another form with, for small meshes.

A changed form is a class with a method of its own:

    class Stiffened(AssembledMomentum):
        def forms(self, material):
            forms = super().forms(material)
            ...
            return replace(forms, energy=..., residual=..., tangent=...)

Energy, residual and tangent have to belong together: the balance of energy of a run compares the first two, and the
tangent, which must be symmetric, decides how fast Newton's method finds an equilibrium, and how long an explicit step
is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import skfem
from skfem import BilinearForm, CellBasis, DiscreteField, LinearForm
from skfem.assembly.form.form import FormExtraParams

from ..errors import ParameterError
from ..material import Material
from . import kernels
from .backend import BulkViscosity, Part
from .elements import ELEMENTS
from .forms import MomentumForms, ViscousForms, density_forms, row_sums, viscous_forms
from .forms.kinematics import kinematics
from .pattern import Pattern
from .space import Space

__all__ = ["AssembledDensity", "AssembledMomentum", "check_size"]

MOST = {2: 5000, 3: 500}  #: elements of a body by dimension: a step takes 0.13 (0.05) s then, a tangent 2 (9) s


def check_size(space: Space) -> None:
    """Refuse a body of too many elements (ParameterError)."""
    most = MOST[space.dim]
    if space.n_elements > most:
        kind = "quadrilaterals" if space.dim == 2 else "hexahedra"
        raise ParameterError(f"kernels forms is for at most {most} {kind}; this body has {space.n_elements}: take "
                             "kernels compiled, or a coarser mesh")


class _Assembly:
    """Forms of one material on its elements, and where their entries go in vectors and matrices of the whole body."""

    def __init__(self, space: Space, basis: CellBasis, elements: np.ndarray | None) -> None:
        self.elements = slice(None) if elements is None else elements
        self.basis = basis if elements is None else space.measured(basis.with_elements(elements))
        self.dofs = np.ascontiguousarray(self.basis.element_dofs.T)
        block = basis.element_dofs.shape[0] // space.conn.shape[1]
        first = (space.conn[self.elements][0][:, None] * block + np.arange(block)).ravel()
        order = np.argsort(self.dofs[0])
        self._place = order[np.searchsorted(self.dofs[0][order], first)]  # of the entries of `Space.conn`

    def vectors(self, form: LinearForm, **fields: Any) -> np.ndarray:
        """Element vectors (ne, nd), in scikit-fem's order."""
        found: np.ndarray = form.elemental(self.basis, **fields).tolocal()
        return found

    def matrices(self, form: BilinearForm, basis: CellBasis, **fields: Any) -> np.ndarray:
        """Element matrices (ne, nd, nd), in the order of `Space.conn`."""
        found: np.ndarray = form.elemental(basis, **fields).tolocal()[:, self._place[:, None], self._place]
        return found

    def add_matrix(self, form: BilinearForm, pattern: Pattern, data: np.ndarray, **fields: Any) -> None:
        """Add the matrix to its `data` on the pattern."""
        self.scatter(self.matrices(form, self.basis, **fields), pattern, data)

    def scatter(self, local: np.ndarray, pattern: Pattern, data: np.ndarray) -> None:
        """Add element matrices to the `data` on the pattern."""
        slot = pattern.slot[self.elements]
        kept = slot >= 0
        data += np.bincount(slot[kept], local[kept], data.size)


class AssembledMomentum:
    """Momentum balance by the forms of each material; values at Gauss points stay (ne, nq).

    Memory: see :class:`.MomentumBackend`.
    """

    def __init__(self, space: Space, parts: Sequence[Part], element: str, *, threads: int = 1,
                 bulk_viscosity: BulkViscosity = BulkViscosity()) -> None:  # noqa: B008
        self._space, self._element, self._parts, self._bulk_viscosity = space, element, parts, bulk_viscosity
        self._forms = [self.forms(part.material) for part in parts]
        self._viscous = [self.viscous_forms(part.material) for part in parts]
        self._assemblies = [_Assembly(space, space.u_basis, part.elements) for part in parts]
        self._scalar = _Assembly(space, space.gamma_basis, None)
        self.gamma, self.W = np.zeros_like(space.w), np.zeros_like(space.w)
        self._force = np.zeros((space.n_elements, space.conn[0].size * space.dim))

    def forms(self, material: Material) -> MomentumForms:
        """The forms of a material; a form that is to be tried takes the place of one of them."""
        return ELEMENTS[self._element].forms(material)

    def viscous_forms(self, material: Material) -> ViscousForms:
        """Those of its viscosity."""
        return viscous_forms(material, self._bulk_viscosity, ELEMENTS[self._element].thin_sheet)

    def _fields(self, number: int, u: np.ndarray, gamma: np.ndarray) -> dict[str, Any]:
        """What the forms of a part are functions of, at the displacement `u` (n, dim) and density (ne, nq)."""
        assembly, fibres = self._assemblies[number], self._parts[number].fibres
        fields = {"displacement": assembly.basis.interpolate(u.ravel()), "gamma": gamma[assembly.elements],
                  "dV": assembly.basis.dx}
        if self._space.axisymmetric:
            fields["radius"] = np.asarray(assembly.basis.global_coordinates())[0]
        if fibres is not None:
            fields["fibres"] = np.repeat(fibres[:, None], gamma.shape[1], axis=1)
        return fields

    def tile(self, values: np.ndarray) -> np.ndarray:
        """A copy."""
        return values.copy()

    untile = tile

    def set_gamma(self, gamma: np.ndarray) -> None:
        """Use the relative densities (ne, nq) from now on."""
        self.gamma[...] = gamma

    def relax(self, nodal: np.ndarray, deleted: np.ndarray, floor: float) -> float:
        """Use the nodal relative density; see :class:`.MomentumBackend`."""
        before = self.gamma.copy()
        at_points = np.asarray(self._scalar.basis.interpolate(nodal))
        self.gamma[...] = np.where((at_points < floor) | deleted[:, None], 0.0, at_points)
        return float((self._scalar.basis.dx * self.W * (before - self.gamma)).sum())

    def force(self, u: np.ndarray, out: np.ndarray) -> float:
        """Internal force; see :class:`.MomentumBackend`."""
        total, least = np.zeros(u.size), 1.0
        for number, (forms, assembly) in enumerate(zip(self._forms, self._assemblies)):
            fields = self._fields(number, u, self.gamma)
            vectors = assembly.vectors(forms.residual, **fields)
            total += np.bincount(assembly.dofs.ravel(), vectors.ravel(), u.size)
            self._force[assembly.elements] = vectors
            self.W[assembly.elements] = forms.energy.form(_extra(fields))
            least = min(least, float(kinematics(_extra(fields)).J.min(where=fields["gamma"] > 0.0, initial=1.0)))
        out[...] = total.reshape(u.shape)
        return least

    def along(self, u: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The derivative of the force; see :class:`.MomentumBackend`."""
        pattern = Pattern(self._space, self._space.dim)
        tangent = pattern.matrix(self.tangent(pattern, u, self.gamma, False))

        def derivative(d: np.ndarray) -> np.ndarray:
            change: np.ndarray = (tangent @ d.ravel()).reshape(d.shape)
            return change

        return derivative

    @property
    def energy(self) -> float:
        """gamma-weighted stored energy at the last evaluation [N mm; N mm/mm in 2D]."""
        return float((self._scalar.basis.dx * self.gamma * self.W).sum())

    def mean_force(self) -> float:
        """Mean magnitude of the forces the elements exert on their nodes, by component, at the last evaluation."""
        return float(np.abs(self._force).mean())

    def tangent(self, pattern: Pattern, u: np.ndarray, gamma: np.ndarray, convex: bool) -> np.ndarray:
        """Data of the tangent; see :class:`.MomentumBackend`."""
        data = np.zeros(pattern.nnz)
        for number, (forms, assembly) in enumerate(zip(self._forms, self._assemblies)):
            assembly.add_matrix(forms.convex if convex else forms.tangent, pattern, data,
                                **self._fields(number, u, gamma))
        return data

    def mass(self, pattern: Pattern, gamma: np.ndarray) -> np.ndarray:
        """Data of the consistent mass matrix; see :class:`.MomentumBackend`."""
        data = np.zeros(pattern.nnz)
        for forms, assembly in zip(self._forms, self._assemblies):
            assembly.add_matrix(forms.mass, pattern, data, gamma=gamma[assembly.elements])
        return data

    def lump(self, values: np.ndarray) -> np.ndarray:
        """Row sums (n,) of the scalar mass matrix with weight `values` (ne, nq)."""
        sums: np.ndarray = row_sums.assemble(self._scalar.basis, weight=values)
        return sums

    def stiffest(self, u: np.ndarray, inverse_mass: np.ndarray) -> float:
        """Cheap lower bound of the highest frequency squared; see :class:`.MomentumBackend`.

        Of the volumetric stiffness alone, k gamma_bar V |b|^2 with b = dJ_bar/du; in plane stress, where that is not
        what an element resists, of its whole second derivative along M^-1 b.
        """
        greatest = 0.0
        for number, (forms, assembly) in enumerate(zip(self._forms, self._assemblies)):
            fields, dV = self._fields(number, u, self.gamma), assembly.basis.dx
            b = assembly.vectors(forms.dilatation, **fields)
            moved = b * inverse_mass.ravel()[assembly.dofs]
            norm = np.einsum("ei,ei->e", b, moved)
            if ELEMENTS[self._element].thin_sheet:
                d = self._motion(assembly, moved)
                stiffness = np.sum(np.asarray(forms.tangent.form(d, d, _extra(fields))) * dV, axis=1)
                quotient = stiffness[norm > 0.0] / norm[norm > 0.0]
            else:
                V = dV.sum(axis=1)
                mean = (dV * fields["gamma"]).sum(axis=1) / V
                quotient = self._parts[number].material.bulk_modulus * mean * norm / V
            greatest = max(greatest, float(quotient.max(initial=0.0)))
        return greatest

    def _motion(self, assembly: _Assembly, local: np.ndarray) -> DiscreteField:
        """A motion of each element by itself, with its nodal values (ne, nd) in scikit-fem's order."""
        functions = [field for (field,) in assembly.basis.basis]
        value = sum(np.asarray(field) * local[:, i, None] for i, field in enumerate(functions))
        gradient = sum(field.grad * local[:, i, None] for i, field in enumerate(functions))
        return DiscreteField(value, gradient)

    def viscous_force(self, u: np.ndarray, v: np.ndarray, out: np.ndarray) -> float:
        """Viscous force; see :class:`.MomentumBackend`."""
        total, greatest = np.zeros(u.size), 0.0
        for number, (forms, assembly) in enumerate(zip(self._viscous, self._assemblies)):
            fields = {**self._fields(number, u, self.gamma), "velocity": assembly.basis.interpolate(v.ravel())}
            vectors = assembly.vectors(forms.force, **fields)
            total += np.bincount(assembly.dofs.ravel(), vectors.ravel(), u.size)
            if any(self._bulk_viscosity):
                live = fields["gamma"].any(axis=1)
                compression = np.asarray(forms.compression.form(_extra(fields)))
                greatest = max(greatest, float(compression[live].max(initial=0.0)))
        out[...] = total.reshape(u.shape)
        return greatest

    def viscous_tangent(self, pattern: Pattern, motion: tuple[np.ndarray, np.ndarray], gamma: np.ndarray,
                        compression: float) -> np.ndarray:
        """Data of its derivative with the velocity; see :class:`.MomentumBackend`."""
        u, v = motion
        data = np.zeros(pattern.nnz)
        for number, (forms, assembly) in enumerate(zip(self._viscous, self._assemblies)):
            assembly.add_matrix(forms.tangent, pattern, data, **self._fields(number, u, gamma),
                                velocity=assembly.basis.interpolate(v.ravel()), compression=compression)
        return data


def _extra(fields: dict[str, Any]) -> FormExtraParams:
    """Fields as a form takes them."""
    return FormExtraParams(fields)


class AssembledDensity:
    """Matrices of the mass balance by its forms; see :class:`.DensityBackend`."""

    def __init__(self, space: Space, length_scale: float) -> None:
        self._space, self._forms = space, density_forms(length_scale, 0.0)
        self._assembly = _Assembly(space, space.gamma_basis, None)

    def laplacian(self, pattern: Pattern, *, monotone: bool) -> np.ndarray:
        """Data of the gradient term; see :class:`.DensityBackend`."""
        data = np.zeros(pattern.nnz)
        if monotone:
            self._assembly.scatter(self._monotone(), pattern, data)
        else:
            self._assembly.add_matrix(self._forms.flux, pattern, data)
        return data

    def _monotone(self) -> np.ndarray:
        """Element matrices without positive off-diagonals, (ne, na, na), of those of the form by each rule."""
        gauss, matrices, usable = self._assembly.basis, [], []
        sense = np.sign(gauss.mapping.detDF(gauss.X))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # of rules that are left out
            for ends in range(2**self._space.dim):
                basis = self._space.measured(skfem.Basis(self._space.mesh, gauss.elem,
                                                         quadrature=self._space.rule(ends)))
                matrices.append(self._assembly.matrices(self._forms.flux, basis))
                jacobian = (sense * basis.mapping.detDF(basis.X)).min(axis=1)
                usable.append(jacobian > kernels.LEAST_JACOBIAN * self._space.extent)
        return kernels.monotone(np.stack(matrices, axis=1), np.stack(usable, axis=1))

    def sink(self, pattern: Pattern, sink: np.ndarray) -> np.ndarray:
        """Data of  int sink N_a N_b  on a scalar pattern."""
        data = np.zeros(pattern.nnz)
        self._assembly.add_matrix(self._forms.sink, pattern, data, sink=sink)
        return data

    def lump(self, values: np.ndarray) -> np.ndarray:
        """Row sums (n,) of that matrix for the sink `values` (ne, nq)."""
        sums: np.ndarray = row_sums.assemble(self._assembly.basis, weight=values)
        return sums
