"""Small bodies the tests share: distorted meshes, random fields, boundary masks."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import meshio
import numpy as np
import skfem

from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.nodal import NodalLoads
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, Material, SinkLaw
from skfsink.material.regions import Region
from skfsink.meshing.sample import _from_meshio
from skfsink.meshing.sweeping import swept
from skfsink.methods.controls import StaticsControls
from skfsink.methods.newton import Newton
from skfsink.methods.statics import Statics

FAILED = 1.0  # MPa: six times Phi, H = 0


def distorted(mesh: skfem.Mesh, amount: float, seed: int = 0) -> skfem.Mesh:
    """`mesh` with its interior nodes moved at random by up to `amount` of the shortest edge along each axis."""
    p = mesh.p.copy()
    inside = np.setdiff1d(np.arange(p.shape[1]), mesh.boundary_nodes())
    edge = np.inf
    for i in range(mesh.t.shape[0]):
        for j in range(i):
            edge = min(edge, np.linalg.norm(p[:, mesh.t[i]] - p[:, mesh.t[j]], axis=0).min())
    p[:, inside] += np.random.default_rng(seed).uniform(-amount, amount, (p.shape[0], inside.size)) * edge
    return type(mesh)(p, mesh.t)


def grid(kind: str, shape: tuple[int, ...], size: tuple[float, ...] | float = 1.0) -> skfem.Mesh:
    """Regular mesh of `shape` elements over a box of the given `size` [mm] with a corner at the origin."""
    sizes = np.broadcast_to(np.asarray(size, float), len(shape))
    axes = [np.linspace(0.0, length, n + 1) for length, n in zip(sizes, shape, strict=True)]
    return (skfem.MeshQuad if kind == "quad" else skfem.MeshHex).init_tensor(*axes)


def box(kind: str, n: int, amount: float = 0.2, size: float = 1.0, seed: int = 0) -> Space:
    """Space on a distorted mesh of n elements along each edge of a square or cube."""
    return Space(distorted(grid(kind, (n,) * (2 if kind == "quad" else 3), size), amount, seed))


def notched(n: int, length: float = 1.0, notch: float = 0.4) -> Space:
    """Square plate of n x n elements without those of one row (n odd: at mid-height) up to x = `notch`."""
    mesh = grid("quad", (n, n), length)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    slit = (x < notch) & (np.abs(y - length / 2) < 0.51 * length / n)
    return Space(mesh.remove_elements(np.flatnonzero(slit)))


class Loadable:
    """A body, as its loading has it, the two fields, and statics on the way."""

    def __init__(self, space: Space, loading: Loading, material: Material, law: SinkLaw, **controls: Any) -> None:
        self.space, self.loading = space, loading
        element = "axisymmetric" if space.axisymmetric else "jbar"
        self.momentum = Momentum(space, material, element, dead=loading.dead, followers=loading.followers)
        self.body = Body(self.momentum, DensitySolver(space, law), loading)
        self.statics = Statics(self.body, StaticsControls(**controls))
        self.state = State.intact(space)

    def load(self, until: float = np.inf) -> State:
        """Load up to a time, or to the onset."""
        for state in self.statics.load(self.state):
            if state.grip >= until:
                break
        return self.state

    def start(self, past: float) -> State:
        """Go from the onset to the start of the event."""
        self.state.begin_event(past, self.statics.clock.grown(self.state.grip, past))
        return self.state


def boundary(space: Space) -> np.ndarray:
    """Mask (n,) of the nodes on the boundary."""
    mask = np.zeros(space.n_nodes, bool)
    mask[space.mesh.boundary_nodes()] = True
    return mask


def ends(space: Space, axis: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Masks (n,) of the nodes on the lower and on the upper end of the body along `axis`."""
    x = space.X[:, axis]
    return np.isclose(x, x.min()), np.isclose(x, x.max())


def grips(space: Space, speed: float, axis: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Mask of the free unknowns (n*dim,) and velocities (n, dim) when both ends move apart along `axis` at `speed`."""
    low, high = ends(space, axis)
    free = np.repeat(~(low | high), space.dim)
    velocity = np.zeros_like(space.X)
    velocity[low, axis], velocity[high, axis] = -speed, speed
    return free, velocity


def wavy(space: Space, size: float, seed: int = 1) -> np.ndarray:
    """A smooth displacement (n, dim) with gradients of about `size`, without any symmetry."""
    rng = np.random.default_rng(seed)
    u = np.zeros_like(space.X)
    for i in range(space.dim):
        for _ in range(3):
            k = rng.uniform(-3, 3, space.dim)
            u[:, i] += np.sin(space.X @ k + rng.uniform(0, 6)) * size / 3
    return u


def patchy(space: Space, seed: int = 2, dead: float = 0.2) -> np.ndarray:
    """Gauss point densities (ne, nq), random in (0.01, 1), with a share `dead` of the elements at zero."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(0.01, 1, space.w.shape)
    gamma[rng.uniform(size=space.n_elements) < dead] = 0.0
    return gamma


def gauss_points(space: Space) -> np.ndarray:
    """Coordinates of the Gauss points [mm], (ne, nq, dim)."""
    return np.einsum("qa,eai->eqi", space.N, space.X[space.conn])


def crack(space: Space, width: float = 0.06) -> np.ndarray:
    """W [MPa] (ne, nq) of a wavy crack, `width` [mm] wide, through 0.6 of the body; it cuts elements between points."""
    points, size = gauss_points(space), np.ptp(space.X, axis=0)
    x, y = points[..., 0] / size[0], points[..., 1] - space.X[:, 1].mean()
    return np.where((np.abs(y - 0.05 * np.sin(8 * x)) < width / 2) & (x < 0.6), FAILED, 0.0)


def held_body(momentum: Momentum, density: DensitySolver, free: np.ndarray, velocity: np.ndarray, **settings) -> Body:
    """A body whose degrees of freedom but `free` (n*dim,) are held, and move at `velocity` (n, dim)."""
    return Body(momentum, density, Loading.steady(momentum.space, free, velocity), **settings)


class Weight(NodalLoads):
    """Body forces that grow at `rate` [MPa/(mm s)] downwards along the last axis, on the elements that bear any."""

    def __init__(self, space: Space, rate: float) -> None:
        self.space, self._rate, self._time = space, rate, 0.0
        self.nodes, self.elements = np.arange(space.n_nodes), np.arange(space.n_elements)
        self.keep(np.ones(space.n_elements, bool))

    def at(self, t: float) -> None:
        self._time = t
        self.values = np.zeros_like(self.space.X)
        self.values[:, -1] = -self._rate * t * self._volume

    def rate(self, t: float) -> float:
        return self._rate * float(np.ptp(self.space.X[:, -1]))

    def keep(self, alive: np.ndarray) -> None:
        self._volume = self.space.lump(np.repeat(alive[:, None], self.space.w.shape[1], axis=1).astype(float))
        self.at(self._time)


class Fracture(NamedTuple):
    """A body just past its onset: a maker of fresh states, the body, and what it was made from."""

    fresh: Callable[[], State]
    momentum: Momentum
    density: DensitySolver
    free: np.ndarray
    velocity: np.ndarray

    @property
    def body(self) -> Body:
        """What an integrator takes."""
        return held_body(self.momentum, self.density, self.free, self.velocity)


def at_onset(space: Space, speed: float = 1e-3, overshoot: float = 0.01, regions: Sequence[Region] = ()) -> Fracture:
    """`space` loaded to its onset and scaled just past it, as the event of a run begins."""
    momentum, density = Momentum(space, AAA(), regions=regions), DensitySolver(space, SinkLaw(), regions=regions)
    free, velocity = grips(space, speed)
    state = State.intact(space)
    for _ in Statics(held_body(momentum, density, free, velocity)).load(state):
        pass
    assert state.gamma.min() > 0.85
    state.begin_event(overshoot)
    return Fracture(lambda: copy.deepcopy(state), momentum, density, free, velocity)


def pulled(space: Space, law: SinkLaw, **controls: Any) -> Loadable:
    """A body whose ends are moved apart by 1e-3 mm/s each."""
    return Loadable(space, Loading.steady(space, *grips(space, 1e-3)), AAA(), law, **controls)


def at_density(momentum: Momentum, gamma: np.ndarray) -> Momentum:
    """The momentum balance, at the relative density `gamma` (ne, nq) of the Gauss points from now on."""
    momentum.gamma = gamma
    momentum.backend.set_gamma(gamma)
    return momentum


def momentum_of(space: Space, material: Material, gamma: np.ndarray, element: str = "jbar",
                regions: Sequence[Region] = (), threads: int = 1) -> Momentum:
    """The momentum balance at the relative density `gamma` (ne, nq) of the Gauss points."""
    return at_density(Momentum(space, material, element, regions=regions, threads=threads), gamma)


def same_bits(one: State, other: State) -> None:
    """Fails if two states differ by a bit in a field."""
    for name in ("u", "v", "a", "gamma", "W_max", "deleted"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def close(got, expected, tolerance: float = 1e-12) -> None:
    """Assert that arrays of one shape differ by at most `tolerance` of their greatest entry."""
    assert got.shape == expected.shape
    error = abs(got - expected).max() / abs(expected).max()
    assert error <= tolerance, f"relative difference {error:.2e}"


def greatest_square(momentum: Momentum, pattern: Pattern, free: np.ndarray, u: np.ndarray, mass: np.ndarray) -> float:
    """Highest frequency squared [1/s^2] of a small body with the masses (n,) of its nodes, of the whole spectrum."""
    root = np.sqrt(np.repeat(mass, momentum.space.dim)[free])
    K = pattern.symmetric(momentum.tangent(pattern, u)).toarray() / root / root[:, None]
    return float(np.linalg.eigvalsh(K)[-1])


def pulled_sheet_and_slab(section: meshio.Mesh, thickness: float, material: Material
                          ) -> list[tuple[float, float, np.ndarray]]:
    """Load of the top, energy and displacement of a sheet in plane stress, and of the slab of two layers on it, pulled
    by 12 %."""
    answers = []
    for mesh, element in ((section, "planestress"), (swept(section, thickness, 2), "jbar")):
        sample = _from_meshio("plate", mesh)
        space, free = sample.space, np.ones(sample.space.X.shape, bool)
        grip = np.union1d(sample.nodes("top"), sample.nodes("bottom"))
        free[grip, :2] = False
        free[0, 2:] = False
        u = np.zeros_like(space.X)
        u[:, 1] = 0.12 * space.X[:, 1]
        momentum = Momentum(space, material, element)
        u, force = Newton(momentum, free.ravel(), 1e-8, 60).equilibrium(u)
        answers.append((float(force[sample.nodes("top"), 1].sum()), momentum.energy, u))
    return answers
