"""The compiled element loops against the scikit-fem forms, against their own derivatives, and against physics."""

from __future__ import annotations

import numba
import numpy as np
import pytest
import skfem
from bodies import boundary, box, close, distorted, ends, grid, momentum_of, patchy, wavy
from scipy.spatial.transform import Rotation

from skfsink.errors import MeshError, ParameterError
from skfsink.fem import kernels
from skfsink.fem.forms import density_forms, momentum_forms
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA, Material, MooneyRivlin, NeoHookean, SinkLaw

ROUNDING = 1e-12
both_elements = pytest.mark.parametrize("element", ["jbar", "plain"])
both_materials = pytest.mark.parametrize("material", [AAA(), NeoHookean(bulk_modulus=40.0)], ids=["AAA", "NeoHookean"])


def test_volumetric_indicator_is_the_rayleigh_quotient_of_one_element(space: Space):
    """Fails if the compiled indicator is not gamma_bar V sum |b_a|^2/m_a of some element, b from the deformation."""
    u, gamma = wavy(space, 0.15), patchy(space)
    momentum = momentum_of(space, AAA(), gamma)
    F = space.deformation_gradient(u)
    cofactor = np.linalg.det(F)[..., None, None] * np.swapaxes(np.linalg.inv(F), -1, -2)
    cofactor = cofactor[..., :space.dim, :space.dim]
    b = np.einsum("eq,eqiJ,eqaJ->eai", space.w, cofactor, space.dN) / space.V[:, None, None]
    inverse_mass = np.random.default_rng(4).uniform(0, 2, space.X.shape)
    ratio = space.element_mean(gamma) * space.V * np.einsum("eai,eai->e", b**2, inverse_mass[space.conn])
    assert momentum.backend.tiles.volumetric(space.X + u, [1.0], inverse_mass) == pytest.approx(ratio.max(), rel=1e-12)


# --- equal to the weak forms ---
@both_elements
@both_materials
def test_force_energy_and_tangent_equal_the_forms(space: Space, element: str, material):
    """Fails if a loop and its form differ in any term, in the numbering, or in deleted elements.

    Also for the stored energy density (against Material.energy with the mean J) and for a last tile partly filled.
    """
    u, gamma = wavy(space, 0.15), patchy(space)
    assert (gamma == 0).all(axis=1).any() and ((gamma > 0) & (gamma < 1)).any()
    momentum = momentum_of(space, material, gamma, element)
    basis, forms = space.u_basis, momentum_forms(material, j_bar=element == "jbar")
    fields = {"displacement": u.ravel(), "gamma": gamma, "dV": basis.dx}
    close(momentum.force(u).ravel(), forms.residual.assemble(basis, **fields))
    F = space.deformation_gradient(u)
    J = np.linalg.det(F)
    W = material.energy(F, space.element_mean(J)[:, None] if element == "jbar" else J)
    close(momentum.W, W, 1e-11)  # W is a small difference of large terms
    assert momentum.energy == pytest.approx(float((space.w * gamma * W).sum()), rel=1e-12)
    assert momentum.least_J == pytest.approx(J[gamma > 0].min(), rel=1e-12)
    pattern = Pattern(space, space.dim)
    close(pattern.matrix(momentum.tangent(pattern, u)), forms.tangent.assemble(basis, **fields))


@both_elements
def test_tangled_elements_and_a_partly_filled_tile(kind: str, element: str):
    """Fails if lanes or tiles mix, or if J below its floor (tangled elements) is read otherwise than in the forms."""
    space = box(kind, 9 if kind == "quad" else 5)  # 81 quads, 125 hexes: two tiles, the last partly filled
    u = np.random.default_rng(3).normal(size=space.X.shape) * 0.6 * space.h.min()
    J = np.linalg.det(space.deformation_gradient(u))
    assert J.min() < -0.5
    gamma = patchy(space)
    gamma[J.min(axis=1) < 0.1] *= 1e-6
    momentum = momentum_of(space, AAA(bulk_modulus=5.0), gamma, element)
    forms = momentum_forms(momentum.material, j_bar=element == "jbar")
    fields = {"displacement": u.ravel(), "gamma": gamma, "dV": space.u_basis.dx}
    close(momentum.force(u).ravel(), forms.residual.assemble(space.u_basis, **fields))
    assert momentum.least_J == pytest.approx(J[gamma > 0].min(), rel=1e-12)
    if kind == "quad":
        pattern = Pattern(space, 2)
        close(pattern.matrix(momentum.tangent(pattern, u)), forms.tangent.assemble(space.u_basis, **fields))


@both_elements
def test_upper_triangle_of_the_constrained_tangent(space: Space, element: str):
    """Fails if the free-free map, the upper triangle, its diagonal or the mirrored matrix misplaces an entry."""
    u, gamma = wavy(space, 0.1), patchy(space)
    momentum = momentum_of(space, AAA(), gamma, element)
    forms = momentum_forms(momentum.material, j_bar=element == "jbar")
    basis = space.u_basis
    whole = forms.tangent.assemble(basis, displacement=u.ravel(), gamma=gamma, dV=basis.dx)
    free = np.random.default_rng(7).uniform(size=u.size) < 0.7
    pattern = Pattern(space, space.dim, free, upper=True)
    data = momentum.tangent(pattern, u)
    expected = whole[free][:, free].toarray()
    assert pattern.size == free.sum()
    rows = np.repeat(np.arange(pattern.size), np.diff(pattern.indptr))
    assert (pattern.indices >= rows).all()
    close(pattern.matrix(data).toarray(), np.triu(expected))
    close(pattern.symmetric(data).toarray(), expected)
    np.testing.assert_array_equal(data[pattern.diagonal], pattern.matrix(data).diagonal())
    assert abs(expected - expected.T).max() <= ROUNDING * abs(expected).max()


def test_mass_equals_the_form(space: Space):
    """Fails if gamma, rho0 or the block structure of the mass is wrong, or if its row sums are not the lumped mass."""
    gamma = patchy(space)
    momentum = momentum_of(space, AAA(), gamma)
    pattern = Pattern(space, space.dim)
    M = pattern.matrix(momentum.consistent_mass(pattern))
    close(M, momentum_forms(momentum.material).mass.assemble(space.u_basis, gamma=gamma))
    rows = (M @ np.ones(pattern.size)).reshape(space.X.shape)
    close(rows, np.repeat(momentum.lumped_mass(0.0)[:, None], space.dim, axis=1))
    intact = momentum_of(space, AAA(), np.ones_like(gamma)).lumped_mass(0.0)
    assert intact.sum() == pytest.approx(momentum.material.rho0 * space.V.sum(), rel=1e-13)
    assert (momentum.lumped_mass(0.01) >= 0.01 * intact).all()


def test_density_matrix_residual_and_load_equal_the_forms(space: Space):
    """Fails if the Laplacian, the sink or the load differ from Eq. (20)-(24)."""
    law = SinkLaw(length_scale=0.3)
    rng = np.random.default_rng(4)
    H, gamma = rng.uniform(1e-3, 1, space.w.shape), rng.uniform(0, 1, space.n_nodes)
    H[:3] = 0.0
    solver = DensitySolver(space, law, "consistent")
    forms, basis = density_forms(law.length_scale, law.epsilon), space.gamma_basis
    A = solver.pattern.matrix(solver._assemble(1 / (H + law.epsilon)))
    form = forms.matrix.assemble(basis, history=H)
    intact = H.min(axis=1) > 0
    close(A, form)
    nodes = np.setdiff1d(np.arange(space.n_nodes), space.conn[~intact])  # where 1e15 does not swamp the rest
    close(A[nodes], form[nodes])
    close(solver.load, forms.load.assemble(basis))
    residual = forms.residual.assemble(basis, density=gamma, history=H)
    close((solver.load - A @ gamma)[nodes], residual[nodes], 1e-11)


def test_lumped_sinks_keep_the_total(space: Space):
    """Fails if lumping by rows or to the nearest node loses or misplaces a part of the sink."""
    sink = np.random.default_rng(0).uniform(1, 5, space.w.shape)
    rows, total = {}, float((space.w * sink).sum())
    for name in ("consistent", "lumped", "nearest"):
        solver = DensitySolver(space, SinkLaw(), name)
        A = solver.pattern.matrix(solver._assemble(sink) - solver._laplacian)
        rows[name] = A @ np.ones(space.n_nodes)
        assert A.sum() == pytest.approx(total, rel=1e-12)
        assert name == "consistent" or abs(A - np.diag(A.diagonal())).max() == 0
    close(rows["lumped"], rows["consistent"])
    near = np.zeros(space.n_nodes)
    points = np.einsum("qa,ead->eqd", space.N, space.X[space.conn])
    for e in range(space.n_elements):
        for q in range(points.shape[1]):
            a = np.argmin(np.linalg.norm(space.X[space.conn[e]] - points[e, q], axis=1))
            near[space.conn[e, a]] += space.w[e, q] * sink[e, q]
    close(rows["nearest"], near)


# --- derivatives ---
@both_elements
def test_force_is_the_derivative_of_the_energy(space: Space, element: str):
    """Fails if the force is not dPi/du: extrapolated differences of the energy along random directions, to 1e-9."""
    gamma = patchy(space)
    momentum = momentum_of(space, AAA(), gamma, element)
    u = wavy(space, 0.1)
    force = momentum.force(u)
    for seed in range(4):
        d = np.random.default_rng(seed).normal(size=u.shape)

        def slope(h: float, d: np.ndarray = d) -> float:
            momentum.force(u + h * d)
            up = momentum.energy
            momentum.force(u - h * d)
            return (up - momentum.energy) / (2 * h)

        rate = (4 * slope(1e-4) - slope(2e-4)) / 3
        assert rate == pytest.approx(float(np.vdot(force, d)), abs=1e-8 * np.linalg.norm(force))


@both_elements
@both_materials
def test_tangent_is_the_derivative_of_the_force(kind: str, element: str, material):
    """Fails if the tangent lacks a term (material, geometric, J_bar coupling): differences of the force agree to 1e-9.

    Densities are above SOFT_GAMMA, below which the tangent gets a little stiffness that the force does not have.
    """
    space = box(kind, 2, 0.25)
    gamma = np.random.default_rng(1).uniform(kernels.SOFT_GAMMA, 1, space.w.shape)
    momentum = momentum_of(space, material, gamma, element)
    u = wavy(space, 0.15)
    pattern = Pattern(space, space.dim)
    K = pattern.matrix(momentum.tangent(pattern, u)).toarray()
    difference = np.empty_like(K)
    for i in range(u.size):
        d = np.zeros(u.size)
        d[i] = 1.0
        d = d.reshape(u.shape)
        slopes = [(momentum.force(u + h * d) - momentum.force(u - h * d)) / (2 * h) for h in (2e-4, 1e-4)]
        difference[:, i] = ((4 * slopes[1] - slopes[0]) / 3).ravel()
    close(difference, K, 1e-9)


@both_elements
def test_convex_tangent_is_that_of_the_potential_where_points_are_stable(space: Space, element: str):
    """Fails if bounding the pressure changes the tangent of a body in tension, or leaves a crushed one indefinite."""
    pattern = Pattern(space, space.dim, np.repeat(~ends(space)[0], space.dim), upper=True)
    momentum = momentum_of(space, AAA(), np.ones_like(space.w), element)
    stretches = np.array([1.3, 1 / 1.3, 1.0] if space.dim == 2 else [1.3, 1.3**-0.5, 1.3**-0.5])
    least = np.prod(np.sort(stretches[:space.dim])[:2]) if space.dim == 3 else 1.0
    slope = float(momentum.material.isochoric(np.sum(stretches**2))[1])
    pressure = slope * (2 / 3 * np.sum(stretches**2) - least)  # tension in every direction
    swell = (1 + pressure / momentum.material.bulk_modulus) ** (1 / space.dim)
    for u in (np.zeros_like(space.X), space.X * (stretches[:space.dim] * swell - 1)):
        close(momentum.tangent(pattern, u, convex=True), momentum.tangent(pattern, u))
    for size in (0.0, 0.1, 0.3):
        u = space.X * np.array([0.0, -0.15, 0.0])[:space.dim] + wavy(space, size)
        exact, convex = (pattern.symmetric(momentum.tangent(pattern, u, c)).toarray() for c in (False, True))
        assert np.linalg.eigvalsh(exact)[0] < 0 < np.linalg.eigvalsh(convex)[0]


@both_elements
def test_only_dead_points_get_the_ersatz_stiffness(kind: str, element: str):
    """Fails if a dead element leaves its nodes without stiffness, or if live ones get more than their own."""
    space = box(kind, 2, 0.2)
    gamma = np.ones_like(space.w)
    gamma[0] = 0.0
    pattern = Pattern(space, space.dim)
    dead = momentum_of(space, AAA(), np.zeros_like(gamma), element)
    mu = dead.material.shear_modulus
    laplacian = Pattern(space)
    scalar = laplacian.matrix(kernels.laplacian(space, laplacian, kernels.ERSATZ_STIFFNESS * mu)).toarray()
    u = wavy(space, 0.1)
    K = pattern.matrix(dead.tangent(pattern, u)).toarray()
    close(K, np.kron(scalar, np.eye(space.dim)))
    assert not dead.force(u).any() and dead.energy == 0


# --- physics ---
@both_elements
def test_force_turns_with_the_body(space: Space, element: str):
    """Fails if the force is not objective: f(Q x) = Q f(x), and a rigid motion of the undeformed body gives none."""
    momentum = momentum_of(space, AAA(), patchy(space), element)
    Q = Rotation.from_rotvec([0, 0, 2.0]).as_matrix()[:2, :2] if space.dim == 2 else \
        Rotation.from_rotvec([0.7, -1.1, 1.6]).as_matrix()
    x = space.X + wavy(space, 0.15)
    force, energy = momentum.force(x - space.X), momentum.energy
    turned = momentum.force(x @ Q.T + 0.3 - space.X)
    close(turned, force @ Q.T)
    assert momentum.energy == pytest.approx(energy, rel=1e-12)
    rigid = momentum.force(space.X @ Q.T - space.X)
    assert abs(rigid).max() <= 1e-11 * momentum.material.bulk_modulus * space.h.max() ** (space.dim - 1)
    assert abs(force.sum(axis=0)).max() <= 1e-11 * abs(force).max()


@both_elements
def test_patch(space: Space, element: str):
    """Fails if a homogeneous finite deformation of a distorted mesh leaves forces inside, or misses W V or P N."""
    momentum = momentum_of(space, AAA(), np.full_like(space.w, 0.7), element)
    F = np.eye(3)
    F[:space.dim, :space.dim] += np.random.default_rng(9).uniform(-0.15, 0.15, (space.dim, space.dim))
    force = momentum.force(space.X @ (F[:space.dim, :space.dim] - np.eye(space.dim)).T)
    assert abs(force[~boundary(space)]).max() <= ROUNDING * abs(force).max()
    assert momentum.energy == pytest.approx(0.7 * float(momentum.material.energy(F)), rel=1e-10)
    P = 0.7 * momentum.material.first_piola(F)[:space.dim, :space.dim]
    close(np.einsum("ai,aJ->iJ", force, space.X), P)  # virial on the unit box


def test_j_bar_is_the_projection_on_the_element_constants(space: Space):
    """Fails if the element mean is not scikit-fem's L2 projection of J on the piecewise constants (Eq. 13)."""
    J = np.linalg.det(space.deformation_gradient(wavy(space, 0.2)))
    assert np.ptp(J, axis=1).max() > 1e-3
    constants = space.gamma_basis.with_element(skfem.ElementQuad0() if space.dim == 2 else skfem.ElementHex0())
    projected = constants.project(J)[constants.element_dofs[0]]
    close(space.element_mean(J), projected)


# --- meshes that are refused, and one that is put right ---
def test_mesh_numbered_in_the_other_sense_is_put_right(kind: str):
    """Fails if a mesh whose elements are all left-handed is refused, or gives other forces than its mirror image."""
    mesh = distorted(grid(kind, (3,) * (2 if kind == "quad" else 3)), 0.2)
    mirrored = mesh.p.copy()
    mirrored[0] *= -1
    one, two = Space(mesh), Space(type(mesh)(mirrored, mesh.t))
    assert (two.w > 0).all() and two.V.sum() == pytest.approx(1, rel=1e-13)
    flip = np.array([-1.0] + [1.0] * (one.dim - 1))
    u = wavy(one, 0.1)
    close(momentum_of(two, AAA(), np.ones_like(two.w)).force(u * flip),
          momentum_of(one, AAA(), np.ones_like(one.w)).force(u) * flip)
    forms = momentum_forms(AAA()).residual.assemble(two.u_basis, displacement=(u * flip).ravel(),
                                                   gamma=np.ones_like(two.w), dV=two.u_basis.dx)
    close(momentum_of(two, AAA(), np.ones_like(two.w)).force(u * flip).ravel(), forms)


def test_inverted_elements_are_refused(kind: str):
    """Fails if one element turned inside out, or one numbered in the other sense, passes silently."""
    mesh = grid(kind, (3,) * (2 if kind == "quad" else 3))
    p = mesh.p.copy()
    inside = np.setdiff1d(np.arange(p.shape[1]), mesh.boundary_nodes())[0]
    p[:, inside] += 0.9
    with pytest.raises(MeshError, match=r"inverted or degenerate: its Jacobian is -?\d\S* at a Gauss point near \(0"):
        Space(type(mesh)(p, mesh.t))
    t = Space(mesh).mesh.t.copy()  # all of one sense
    order = [1, 0, 3, 2] if kind == "quad" else [1, 0, 4, 5, 2, 3, 7, 6]
    t[:, 4] = t[order, 4]
    with pytest.raises(MeshError, match="element 4 is inverted"):
        Space(type(mesh)(mesh.p, t))


def test_unused_nodes_triangles_and_nan_are_refused(kind: str):
    """Fails if a node without element (a singular matrix later), another element or a NaN coordinate is let in."""
    mesh = grid(kind, (2,) * (2 if kind == "quad" else 3))
    with pytest.raises(MeshError, match="1 node"):
        Space(type(mesh)(np.column_stack([mesh.p, mesh.p[:, :1] + 9]), mesh.t, validate=False))
    p = mesh.p.copy()
    p[0, 0] = np.nan
    with pytest.raises(MeshError, match="not finite"):
        Space(type(mesh)(p, mesh.t, validate=False))
    with pytest.raises(MeshError, match="MeshTri1"):
        Space(skfem.MeshTri())
    with pytest.raises(ParameterError, match="element must be one of jbar, plain, planestress, axisymmetric; got 'q2'"):
        Momentum(Space(mesh), AAA(), "q2")


def test_threads_do_not_change_a_bit(kind: str, monkeypatch: pytest.MonkeyPatch):
    """Fails if the shares of two threads overlap, leave a tile out, or their least J is not the least of both."""
    monkeypatch.setattr(kernels.Tiles, "WORTH", 0)
    space = box(kind, 24 if kind == "quad" else 5)  # eight or nine tiles
    u = 0.1 * np.sin(7 * space.X)
    one, two = (Momentum(space, AAA(), threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.force(u), two.force(u))
    assert (one.energy, one.least_J) == (two.energy, two.least_J)
    ones = np.ones_like(space.X)
    assert one.stiffest(u, ones) == two.stiffest(u, ones)
    body = kernels.Tiles(space, threads=2)
    assert body.threads == min(2, numba.config.NUMBA_NUM_THREADS)
    monkeypatch.undo()
    assert kernels.Tiles(space, threads=2).threads == 1  # too small to be shared


@pytest.mark.parametrize("element", ["jbar", "plain"])
@pytest.mark.parametrize("material", [AAA(), MooneyRivlin()], ids=lambda value: type(value).__name__)
def test_a_crushed_point_is_driven_back(kind: str, element: str, material: Material) -> None:
    """Fails if the force is not the derivative of the energy where points are flat or inside out, or pulls on them.

    One node is moved through its elements: J goes from 1 over 0 to -2 there. Seen to fail where J is read as its floor.
    """
    space = box(kind, 3 if kind == "quad" else 2, 0.0)
    momentum = Momentum(space, material, element)
    node = int(np.argmin(np.linalg.norm(space.X - space.X.mean(axis=0) + 0.01, axis=1)))
    away = np.zeros_like(space.X)
    away[node] = 1.0

    def energy(way: float) -> tuple[float, float]:
        force = momentum.force(way * away)
        return momentum.energy, float(force[node].sum())

    least = []
    for way in np.linspace(0.0, 1.2, 25):
        _, slope = energy(way)
        least.append(momentum.least_J)
        expected = (energy(way + 1e-7)[0] - energy(way - 1e-7)[0]) / 2e-7
        assert slope == pytest.approx(expected, rel=1e-5, abs=1e-6)
        assert way == 0.0 or slope > 0.0
    assert min(least) < -1.0 and any(abs(J) < 0.2 for J in least)
