"""The weak forms as scikit-fem forms: the readable statement of the physics, on quads and hexes alike.

A run evaluates them with `--kernels forms` (:mod:`skfsink.fem.assembled`); else it uses the compiled loops of
:mod:`skfsink.fem.kernels`, and tests hold the two equal to rounding. Each function here returns plain scikit-fem forms,
to be assembled on the bases of a :class:`~skfsink.fem.space.Space`:

    forms = momentum_forms(AAA())
    r = forms.residual.assemble(space.u_basis, displacement=u.ravel(), gamma=gamma_q, dV=space.u_basis.dx)

Fields passed at assembly (at Gauss points unless said otherwise): `displacement` the nodal vector of the displacement
(skfem interpolates it), `gamma` the relative density (ne, nq), zero in deleted elements, `dV` the quadrature
weights `basis.dx`, from which element means are made, and `fibres` (ne, nq, families, 3), directions of fibres. A field
`radius` (ne, nq), the R of the Gauss points, makes the body one of revolution about the axis x = 0: displacements then
have a gradient u_r/R around it, and `basis` integrates over 2 pi R dA, as those of such a space do. What is the same
for all test functions is found once an assembly.
"""

from .density import DensityForms, density_forms, row_sums
from .kinematics import element_mean
from .momentum import MomentumForms, momentum_forms
from .pressure import PressureForms, pressure_forms
from .sheet import plane_stress_forms
from .viscous import BulkViscosity, ViscousForms, viscous_forms

__all__ = ["BulkViscosity", "DensityForms", "MomentumForms", "PressureForms", "ViscousForms", "density_forms",
           "element_mean", "momentum_forms", "plane_stress_forms", "pressure_forms", "row_sums", "viscous_forms"]
