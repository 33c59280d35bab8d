"""Debris that an explicit event takes out: which elements, what is booked, and that the body does not notice."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from bodies import FAILED, ends, grid, grips, held_body, same_bits
from guarded import Watched

from skfsink.errors import InstabilityError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.contact import Contact
from skfsink.fields.density import DensitySolver
from skfsink.fields.fragments import debris
from skfsink.fields.momentum import BulkViscosity, Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls
from skfsink.methods.explicit import Explicit
from skfsink.scene.options import Options

N = 15
LAW = SinkLaw(length_scale=0.3)  # of a plate of 1 mm: an island of 4 x 4 elements of a fifteenth is smaller than l


def block_of(space: Space, low: int, high: int) -> np.ndarray:
    """Mask (ne,) of the elements from row and column `low` up to `high`."""
    place = np.floor(space.X[space.conn].mean(axis=1) * N)
    return np.asarray(((place >= low) & (place < high)).all(axis=1))


SPACE = Space(grid("quad", (N, N)))
ISLAND = block_of(SPACE, 4, 8)
RING = block_of(SPACE, 3, 9) & ~ISLAND
REST = np.setdiff1d(np.arange(SPACE.n_nodes), SPACE.conn[ISLAND])


def started(choice: str, *, contact: bool = False, viscous: bool = False, mass_floor: float = 0.0,
            fixed: bool = True) -> tuple[Explicit, State]:
    """A stretched plate in motion, with a ring of elements around an island about to fail; steps may be fixed."""
    momentum = Momentum(SPACE, AAA(), bulk_viscosity=BulkViscosity(0.06 * viscous, 1.2 * viscous))
    free, velocity = grips(SPACE, 1e-3)
    if contact:
        momentum.contact = Contact(SPACE, momentum.parts, free)
    explicit = Explicit(held_body(momentum, DensitySolver(SPACE, LAW, tolerance=1e-13), free, velocity),
                        ExplicitControls(gamma_every=4, mass_floor=mass_floor, debris=choice))
    explicit.GAMMA_TOLERANCE = 1e-13
    state = State.intact(SPACE)
    state.phase = "event"
    state.u = SPACE.X * [-0.02, 0.02]
    state.v = 1e3 * np.sin(5 * SPACE.X[:, ::-1]) * free.reshape(-1, 2)
    state.W_max[RING] = FAILED
    explicit.begin(state)
    if fixed:
        explicit.length.fix(2e-8)
    return explicit, state


def test_pieces_that_are_held_or_large_stay() -> None:
    """Fails if a piece at a grip, or one not smaller than l, is debris; or one that is neither is not.

    Seen to fail with the mask of held nodes left out, and with the volume of all pieces.
    """
    gamma, held = np.ones(SPACE.n_nodes), ends(SPACE)[0]
    gamma[SPACE.conn[RING]] = 0.0
    none = np.zeros(SPACE.n_elements, bool)
    found = debris(SPACE, gamma, RING, held, 0.3)
    np.testing.assert_array_equal(found, np.flatnonzero(ISLAND))
    assert debris(SPACE, gamma, none, held, 4 / N - 1e-6).size == 0
    corner = block_of(SPACE, 0, 3)  # with the lower grip
    cut = block_of(SPACE, 0, 4) & ~corner
    gamma[:] = 1.0
    gamma[SPACE.conn[cut]] = 0.0
    assert debris(SPACE, gamma, cut, held, 0.3).size == 0
    np.testing.assert_array_equal(debris(SPACE, gamma, cut, np.zeros_like(held), 0.3), np.flatnonzero(corner))
    assert debris(SPACE, gamma, ~none, held, 0.3).size == 0


def test_energies_of_debris_are_booked() -> None:
    """Fails if the column `deletion` is not the stored and kinetic energy of the island at the moment it is removed.

    Seen to fail with the kinetic energy in `sink_kinetic`, and with the density before the solve.
    """
    explicit, state = started("remove")
    explicit.update_density(state)
    np.testing.assert_array_equal(state.deleted, RING | ISLAND)
    assert {element for _, element in state.deletions} == set(np.flatnonzero(state.deleted))
    at_gauss = explicit.momentum.effective(state.gamma, ~ISLAND)
    stored = float((SPACE.w * at_gauss * explicit.momentum.W).sum())
    mass = explicit.momentum.material.rho0 * SPACE.lump(at_gauss)
    kinetic = 0.5 * float(mass @ (state.v**2).sum(axis=1))
    assert kinetic > 0.1 * stored > 0.0
    assert state.ledger.deletion == state.ledger.debris == pytest.approx(stored + kinetic, rel=1e-9)
    assert state.ledger.paper == pytest.approx(LAW.failure_energy * SPACE.V[RING].sum())
    assert abs(state.ledger.balance) < 1e-12 * state.ledger.initial
    explicit.update_density(state)
    inside = np.setdiff1d(SPACE.conn[ISLAND], SPACE.conn[~ISLAND])
    assert state.gamma[inside].max() < 1e-6 and not explicit.momentum.gamma[ISLAND].any()


@pytest.mark.parametrize("more", [{}, {"contact": True}, {"viscous": True}, {"contact": True, "viscous": True}],
                         ids=str)
def test_ledger_closes(more: dict[str, bool]) -> None:
    """Fails if the balance of a run that removes debris does not close to rounding, also with contact and viscosity.

    Seen to fail with the kinetic energy of the island booked nowhere.
    """
    explicit, state = started("remove", mass_floor=1e-3, **more)
    for _ in range(60):
        explicit.step(state)
        assert abs(state.ledger.balance) < 1e-11 * state.ledger.initial
    assert state.deleted[ISLAND].all() and state.ledger.deletion > 1e-4 * state.ledger.initial


def test_body_does_not_notice() -> None:
    """Fails if the rest of the body moves otherwise without the island: they share no node that bears force."""
    ends_of = []
    for choice in ("keep", "remove"):
        explicit, state = started(choice)
        for _ in range(60):
            explicit.step(state)
        ends_of.append(state)
    kept, removed = ends_of
    assert not kept.deleted[ISLAND].any() and removed.deleted[ISLAND].all()
    assert kept.ledger.deletion < 1e-9 * removed.ledger.deletion
    for name in ("u", "v", "gamma"):
        one, other = getattr(kept, name)[REST], getattr(removed, name)[REST]
        assert np.abs(one - other).max() <= 1e-10 * np.abs(one).max(), name


@pytest.mark.parametrize("steps", [2, 6])
def test_resumed_run_removes_the_same(steps: int) -> None:
    """Fails if a run resumed before or after debris was found ends with other bits."""
    one, state = started("remove", viscous=True, fixed=False)
    for _ in range(steps):
        one.step(state)
    one.sync(state)
    assert state.deleted[ISLAND].all() == (steps == 6)
    resumed, memory = copy.deepcopy((state, one.memory()))
    two, _ = started("remove", viscous=True, fixed=False)
    two.restore(resumed, memory)
    for explicit, at in ((one, state), (two, resumed)):
        for _ in range(20):
            explicit.step(at)
        explicit.sync(at)
    same_bits(state, resumed)
    assert state.ledger == resumed.ledger and state.deletions == resumed.deletions and state.deleted[ISLAND].all()


def test_guard_lets_debris_go() -> None:
    """Fails if a run is stopped for what was in debris, or is not for what was in failed elements."""
    watched = Watched()
    ledger = watched.state.ledger
    ledger.initial += 0.2
    ledger.deletion = ledger.debris = 0.2
    watched.guard.check_record(watched.state)
    ledger.debris = 0.1
    with pytest.raises(InstabilityError, match=r"^energy lost in deleted elements 10.00%"):
        watched.guard.check_record(watched.state)


@pytest.mark.parametrize("options", [{"analysis": "quasistatic"}, {"analysis": "both"}, {"integrator": "hht"}], ids=str)
def test_refused_where_nothing_is_removed(options: dict[str, str]) -> None:
    """Fails if debris is to be removed in a run that does not look for it, and no word is said."""
    with pytest.raises(ParameterError, match=r"^debris remove is for analysis dynamic with integrator explicit; got .* "
                                             r"take debris keep$"):
        Options(debris="remove", **options)
    with pytest.raises(ParameterError, match=r"^debris must be .*keep.*remove.*crush"):
        Options(debris="crush")
