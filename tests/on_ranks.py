"""What `mpiexec -n N python tests/on_ranks.py` checks on all ranks: sums of parts against the whole body."""

from __future__ import annotations

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


def stretched(body: Body) -> State:
    """A state on its way to failure, with a hole and debris: the same on all ranks."""
    X, state = body.space.X, body.begin()
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
    found = highest_frequency(part.momentum, Pattern(space, space.dim, part.free, upper=True), part.free,
                              state.u[nodes], mass[nodes])[0]
    check("frequency", found, highest_frequency(
        body.momentum, Pattern(body.space, body.space.dim, body.free, upper=True), body.free, state.u, mass)[0], 1e-9)


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


def main() -> None:
    """Check a plane body, one in space, and one of revolution."""
    for dim, rings in ((2, False), (3, False), (2, True)):
        body = whole_body(dim, rings)
        state = stretched(body)
        member = Member(COMM)
        member.take(list(parts_of(body, ExplicitControls(), COMM.size))[COMM.rank])
        check_sums(body, state, member)
        check_debris(body, member)
        check_event(body, state, member)
    print(f"rank {COMM.rank} of {COMM.size}: as the whole body", flush=True)


if __name__ == "__main__":
    main()
