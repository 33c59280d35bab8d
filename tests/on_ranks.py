"""What `mpiexec -n N python tests/on_ranks.py` checks on all ranks: sums of parts against the whole body."""

from __future__ import annotations

import traceback
from collections.abc import Callable

import numpy as np
import skfem
from mpi4py import MPI

from skfsink.fem.exchange import ALONE
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.fragments import debris
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads import BodyForce, Filling, Grip, Pressure, Ramp, Rotation, Sliding, Traction
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.material.regions import Region
from skfsink.methods.controls import ExplicitControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.frequency import highest_frequency
from skfsink.methods.ranks.crew import Member
from skfsink.methods.ranks.part import parts_of, state_of

COMM = MPI.COMM_WORLD
LAW, STRONG = SinkLaw(), SinkLaw(phi=0.3)


def whole_body(dim: int, rings: bool = False) -> Body:
    """A block, or a body of rings, with a stiff and strong corner, held at the bottom, its top moved."""
    axes = [np.linspace(0, 0.5, 11), np.linspace(0, 0.4, 9), np.linspace(0, 0.2, 5)][:dim]
    space = Space((skfem.MeshQuad if dim == 2 else skfem.MeshHex).init_tensor(*axes), rings)
    centres = space.X[space.conn].mean(axis=1)
    region = Region("corner", np.flatnonzero((centres[:, :2] > 0.3).all(axis=1)), AAA(c1=1.0, viscosity=1e-8), STRONG)
    free, velocity = np.ones(space.X.shape, bool), np.zeros(space.X.shape)
    for height, speed in ((0.0, 0.0), (0.4, 50.0)):
        held = space.X[:, 1] == height
        free[held], velocity[held, 1] = False, speed
    if rings:
        free[space.X[:, 0] == 0.0, 0] = False
    loading = Loading.steady(space, free.ravel(), velocity)
    momentum = Momentum(space, AAA(), "axisymmetric" if rings else "jbar", regions=[region])
    return Body(momentum, DensitySolver(space, LAW, regions=[region], solver="jacobi"), loading)


def dead(space: Space, side: Callable[[int, float], np.ndarray]) -> Loading:
    """A traction, and a weight that falls with the density; of a part of the body too."""
    held = Grip("bottom", (0.0,) * space.dim)
    pull = Traction("top", (20.0, Ramp((0.0, 1.0), (0.0, 100.0)), 0.0)[:space.dim])
    fall = (0.0, 2e9, 0.0)[:space.dim]
    corner = np.flatnonzero((space.X[space.conn].mean(axis=1) < 0.2).all(axis=1))
    return Loading(space, [(side(1, 0.0), held)], [(side(1, 0.4), pull)],
                   [BodyForce(space, 1e-9, fall), BodyForce(space, 2e-9, fall, corner)])


def pressed(space: Space, side: Callable[[int, float], np.ndarray]) -> Loading:
    """A pressure that goes into cracks, and one that does not."""
    held = Grip("bottom", (0.0,) * space.dim)
    return Loading(space, [(side(1, 0.0), held)],
                   pressures=[(side(1, 0.4), Pressure("top", 150.0, True)), (side(0, 0.8), Pressure("right", 70.0))])


def filled(space: Space, side: Callable[[int, float], np.ndarray]) -> Loading:
    """A fluid over a body that slides along its walls, and is held at the bottom."""
    walls = [(side(i, x), Sliding(name)) for i, x, name in
             ((0, 0.0, "left"), (0, 0.8, "right"), (2, 0.0, "front"), (2, 0.2, "back")) if i < space.dim]
    return Loading(space, [(side(1, 0.0), Grip("bottom", (None, 0.0, None)[:space.dim])), *walls],
                   pressures=[(side(1, 0.4), Filling("top", 20.0, 1e-2))])


def oblique(space: Space, side: Callable[[int, float], np.ndarray]) -> Loading:
    """A turned body on two planes."""
    return Loading(space, [(side(0, 0.0), Sliding("left")), (side(1, 0.0), Sliding("bottom"))])


def turned(space: Space, side: Callable[[int, float], np.ndarray]) -> Loading:
    """A grip that turns ever faster."""
    angle = Ramp((0.0, 1e-3, 2e-3), (0.0, 1.0, 5.0))
    return Loading(space, [(side(1, 0.0), Grip("bottom", (0.0,) * space.dim)),
                           (side(1, 0.4), Rotation("top", angle, (0.2, 0.1, 0.1)[:space.dim],
                                                   (0.0, 1.0, 2.0) if space.dim == 3 else ()))])


def loaded_body(dim: int, load: Callable[[Space, Callable[[int, float], np.ndarray]], Loading],
                rings: bool = False) -> Body:
    """A block (or rings) under a load, so long that parts meet at its top; that on oblique planes is turned."""
    axes = [np.linspace(0, 0.8, 17), np.linspace(0, 0.4, 9), np.linspace(0, 0.2, 5)][:dim]
    mesh = (skfem.MeshQuad if dim == 2 else skfem.MeshHex).init_tensor(*axes)
    X, points = mesh.p.T.copy(), mesh.p.copy()
    if load is oblique:
        points[:2] = np.array([[0.8, -0.6], [0.6, 0.8]]) @ points[:2]
    space = Space(type(mesh)(points, mesh.t), rings)
    loading = load(space, lambda axis, at: np.flatnonzero(np.abs(X[:, axis] - at) < 1e-9))
    momentum = Momentum(space, AAA(viscosity=1e-8), "axisymmetric" if rings else "jbar", dead=loading.dead,
                        followers=loading.followers)
    return Body(momentum, DensitySolver(space, LAW, solver="jacobi"), loading)


def stretched(body: Body) -> State:
    """A state on its way to failure, with a hole and debris: the same on all ranks."""
    X, state = body.space.X, body.begin()
    state.grip = 1e-3
    body.momentum.set_time(state.grip)
    state.u[:, 1] = 0.06 * X[:, 1] * (1 + 0.3 * np.sin(7 * X[:, 0]))
    state.v[:, 0] = 300.0 * np.cos(5 * X[:, 1]) * body.free.reshape(X.shape)[:, 0]
    body.momentum.force(state.u)
    state.W_max = body.momentum.W * (LAW.phi * 1.05 / body.momentum.W.max())
    state.gamma = body.density.solve(state.W_max, state.gamma)
    return state


def check(what: str, value: object, expected: object, tolerance: float = 1e-12) -> None:
    """Compare on this rank, and end all ranks where it differs."""
    value, expected = np.asarray(value, float), np.asarray(expected, float)
    error = np.abs(value - expected).max(initial=0.0) / (np.abs(expected).max(initial=0.0) or 1.0)
    if not error <= tolerance:
        print(f"rank {COMM.rank} of {COMM.size}: {what} differs by {error:.2g}", flush=True)
        COMM.Abort(3)


def check_sums(body: Body, state: State, member: Member) -> None:
    """Forces, masses, energies, products, numbers of unknowns and frequencies."""
    part, space = member.body, member.body.space
    assert member.part is not None
    numbers, exchange = member.part.numbers, space.exchange
    nodes = numbers.nodes
    check("what counts", exchange.total(numbers.counted), body.space.n_nodes, 0.0)
    part.momentum.set_gamma(state.gamma[nodes], state.deleted[numbers.elements])
    body.momentum.set_gamma(state.gamma, state.deleted)
    check("force", part.momentum.force(state.u[nodes]), body.momentum.force(state.u)[nodes])
    check("energy", part.momentum.energy, body.momentum.energy)
    check("least J", part.momentum.least_J, body.momentum.least_J)
    check("viscous force", part.momentum.viscous_force(state.u[nodes], state.v[nodes]),
          body.momentum.viscous_force(state.u, state.v)[nodes])
    mass = body.momentum.lumped_mass(0.0)
    check("mass", part.momentum.lumped_mass(0.0), mass[nodes])
    check("product", exchange.dot(mass[nodes], state.v[nodes, 0]), ALONE.dot(mass, state.v[:, 0]))
    check("waves", part.momentum.shear_wave_speeds, body.momentum.shear_wave_speeds, 0.0)
    check("density", part.density.solve(state.W_max[numbers.elements], np.ones(nodes.size)),
          body.density.solve(state.W_max, np.ones(body.space.n_nodes))[nodes], 1e-9)
    own, every = exchange.over(part.free), ALONE.over(body.free)
    check("unknowns", (own.size, exchange.total(own.counted.sum())), (every.size, every.size), 0.0)
    whole = highest_frequency(body.momentum, Pattern(body.space, body.space.dim, body.free, upper=True), body.free,
                              state.u, mass)[0]
    for name, pattern, tolerance in (("frequency", Pattern(space, space.dim, part.free, upper=True), 1e-9),
                                     ("frequency by differences of forces", None, 1e-6)):
        found = highest_frequency(part.momentum, pattern, part.free, state.u[nodes], mass[nodes])[0]
        check(name, found, whole, tolerance)


def check_debris(body: Body, member: Member) -> None:
    """A piece that lies in several parts is debris as in the whole body, and one is not that is held, or large."""
    assert member.part is not None
    space, numbers = body.space, member.part.numbers
    gamma = np.ones(space.n_nodes)
    centre = np.abs(space.X[:, :2] - [0.25, 0.2]).max(axis=1)
    gamma[(centre > 0.04) & (centre < 0.06)] = 0.0
    deleted = np.zeros(space.n_elements, bool)
    held = np.zeros(space.n_nodes, bool)
    for hold, length in ((False, 0.5), (False, 0.01), (True, 0.5)):
        held[:] = hold
        expected = debris(space, gamma, deleted, held, length)
        found = debris(member.body.space, gamma[numbers.nodes], deleted[numbers.elements], held[numbers.nodes], length)
        check("debris", member.body.space.exchange.total(found.size), expected.size, 0.0)
        check("pieces of debris", np.isin(numbers.elements[found], expected), np.ones(found.size), 0.0)


def check_event(body: Body, state: State, member: Member) -> None:
    """Thirty steps of an event, with elements that fail: fields and ledger are those of the whole body."""
    assert member.part is not None
    numbers = member.part.numbers
    member.begin(state_of(state, numbers))
    alone = Explicit(body, ExplicitControls())
    alone.begin(state)
    for _ in range(30):
        alone.step(state)
        member.step()
    for name in ("u", "v", "a", "gamma"):
        check(name, getattr(member.state, name), getattr(state, name)[numbers.nodes], 1e-8)
    check("deleted", member.state.deleted, state.deleted[numbers.elements], 0.0)
    energies, expected = member.state.ledger.as_dict(), state.ledger.as_dict()
    scale = state.ledger.initial
    for name, value in expected.items():
        check(f"ledger, {name}", energies[name] / scale, value / scale, 1e-8) if name != "balance" else None
    assert state.deleted.any(), "nothing has failed"
    check("number of zones", len(member.explicit._zones), len(alone._zones), 0.0)
    for own, whole in zip(member.explicit._zones, alone._zones):
        check("zone", own.depth, whole.depth, 1e-6)
        check("nodes of a zone", (own.size, own.size - own.nodes.size >= 0), (whole.size, True), 0.0)
    check("time", (member.state.time, member.state.step), (state.time, state.step), 1e-9)


def check_loads(body: Body, state: State, member: Member) -> None:
    """Energies, sizes and volumes of loads, also where cracks go from the top through all parts and along borders."""
    assert member.part is not None
    part, numbers = member.body, member.part.numbers
    nodes, X = numbers.nodes, body.space.X
    own, whole = part.momentum, body.momentum
    centres = X[body.space.conn].mean(axis=1)
    near = [np.abs(centres - (0.05 * k + 0.025)) < 0.03 for k in range(16)]
    crosses = [mask[:, 0] | near[k % 8][:, 1] for k, mask in enumerate(near)]
    apart = near[4][:, 0] & ~near[4][:, 1]  # the lower half is not joined to the top
    last = 0.5 * state.u
    for deleted in (state.deleted, *(state.deleted | crack for crack in (apart, *crosses))):
        for momentum, gone, gamma, u in ((own, deleted[numbers.elements], state.gamma[nodes], last[nodes]),
                                         (whole, deleted, state.gamma, last)):
            momentum.set_time(2.0 * state.grip)
            momentum.force(u)
            momentum.set_gamma(gamma, gone)
        check("loaded force", own.force(state.u[nodes]), whole.force(state.u)[nodes])
        check("potential", own.loads, whole.loads)
        products = []
        for one, momentum, u in ((part, own, state.u[nodes]), (body, whole, state.u)):
            pattern, unknowns = Pattern(one.space, X.shape[1], one.free), one.space.exchange.over(one.free)
            product = pattern.matrix(momentum.tangent(pattern, u)) @ np.sin(unknowns.numbers)
            unknowns.whole(product)
            products.append((unknowns.numbers, product))
        check("tangent", products[0][1], products[1][1][products[0][0]])
        check("work of pressures", own.pressure_work(last[nodes], state.u[nodes]), whole.pressure_work(last, state.u))
        if whole.dead is not None and own.dead is not None:
            check("change", own.dead.changed(0.3 * own.dead.values, state.u[nodes]),
                  whole.dead.changed(0.3 * whole.dead.values, state.u))
            check("effort", own.dead.effort(0.3 * own.dead.values, state.u[nodes]),
                  whole.dead.effort(0.3 * whole.dead.values, state.u))
        if whole.followers is not None and own.followers is not None:
            inverse = body.free.reshape(X.shape) / whole.lumped_mass(1e-3)[:, None]
            for name in ("swept", "area", "pressures", "size"):
                check(name, getattr(own.followers, name)(state.u[nodes]), getattr(whole.followers, name)(state.u))
            check("stiffest", own.followers.stiffest(state.u[nodes], inverse[nodes]),
                  whole.followers.stiffest(state.u, inverse))
            check("facets", part.space.exchange.total(own.followers._wet.owner.size), whole.followers._wet.owner.size)


def check_all(body: Body) -> None:
    """Check the parts of a body."""
    state = stretched(body)
    member = Member(COMM)
    member.take(list(parts_of(body, ExplicitControls(), COMM.size))[COMM.rank])
    check_sums(body, state, member)
    check_debris(body, member)
    check_loads(body, state, member)
    body.take(state)
    member.take(list(parts_of(body, ExplicitControls(), COMM.size))[COMM.rank])
    check_event(body, state, member)


def main() -> None:
    """Check a plane body, one in space and one of revolution, by themselves and under loads of all kinds."""
    for dim, rings in ((2, False), (3, False), (2, True)):
        check_all(whole_body(dim, rings))
    for dim in (2, 3):
        for load in (dead, pressed, filled, oblique, turned):
            check_all(loaded_body(dim, load))
    for load in (dead, pressed, filled):
        check_all(loaded_body(2, load, True))
    print(f"rank {COMM.rank} of {COMM.size}: as the whole body", flush=True)


if __name__ == "__main__":
    try:
        main()
    except BaseException:
        traceback.print_exc()
        COMM.Abort(4)
