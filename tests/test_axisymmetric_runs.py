"""Bodies of revolution as they are run: beside wedges of hexahedra, by both integrators, and by decks."""

from __future__ import annotations

import copy
from functools import cache

import numpy as np
import pytest
import skfem
from bodies import Loadable, box, ends, held_body, notched

from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.pieces import pieces_of
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Sliding
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT

ANGLE = 0.08  # of the wedge [rad]


def wedge(section: skfem.MeshQuad) -> Space:
    """One layer of hexahedra around the axis y, between the half planes at the angles 0 and `ANGLE`."""
    r, y = section.p
    points = np.concatenate([[r * np.cos(a), y, r * np.sin(a)] for a in (0.0, ANGLE)], axis=1)
    corners = section.t[[0, 1, 3, 2]]
    cells = [corners[i + 2 * j] + r.size * k for i, j, k in skfem.MeshHex.elem.refdom.p.T.astype(int)]
    return Space(skfem.MeshHex(points, np.array(cells)))


def pulled(space: Space) -> Loadable:
    """A body whose ends part along y at 2 µm/s, and slide; a wedge slides on its sides as well."""
    low, high = (np.flatnonzero(mask) for mask in ends(space))
    free = (None,) * (space.dim - 2)
    held: list[tuple[np.ndarray, Grip]] = [(high, Grip("high", (None, 1e-3, *free))),
                                           (low, Grip("low", (None, -1e-3, *free)))]
    if space.dim == 3:
        angle = np.arctan2(space.X[:, 2], space.X[:, 0])
        held += [(np.flatnonzero(np.isclose(angle, a, atol=1e-9)), Sliding(f"at {a}")) for a in (0.0, ANGLE)]
    return Loadable(space, Loading(space, held), AAA(), SinkLaw(), onset_tolerance=1e-4)


@cache
def at_onset() -> tuple[Loadable, Loadable]:
    """A ring with a notch from its inner side, by its half plane and by a wedge of it, at the onset."""
    section = notched(15).mesh.translated((1.0, 0.0))
    ring, part = pulled(Space(section, axisymmetric=True)), pulled(wedge(section))
    ring.load(), part.load()
    return ring, part


def whole(body: Loadable) -> float:
    """How many such bodies make the ring."""
    return 1.0 if body.space.axisymmetric else 2 * np.pi / np.sin(ANGLE)  # the sides of wedges are chords


def test_onset_of_a_wedge() -> None:
    """Fails if onset, load or energy of a notched ring are not those of a wedge of hexahedra, within 1 %."""
    ring, part = at_onset()
    assert part.space.V.sum() * whole(part) == pytest.approx(ring.space.V.sum(), rel=1e-9)
    assert ring.state.grip == pytest.approx(part.state.grip, rel=0.01)
    at = {}
    for body in (ring, part):  # at the same displacement
        scale = ring.state.grip / body.state.grip
        u = body.state.u * scale
        body.momentum.set_gamma(np.ones(body.space.n_nodes), np.zeros(body.space.n_elements, bool))
        internal = body.momentum.force(u)
        at[body] = whole(body) * internal[ends(body.space)[1], 1].sum(), whole(body) * body.momentum.energy
    np.testing.assert_allclose(at[ring], at[part], rtol=0.01)
    assert np.abs(part.space.X[np.argmin(part.state.gamma), 1] - ring.space.X[np.argmin(ring.state.gamma), 1]) < 0.07


def test_event_of_a_wedge() -> None:
    """Fails if the explicit event of a notched ring is not that of a wedge: energies, what has failed, and momenta."""
    found = []
    for body in at_onset():
        state = copy.deepcopy(body.state)
        state.begin_event(0.01, body.statics.clock.grown(state.grip, 0.01))
        explicit = Explicit(body.body)
        explicit.begin(state)
        for _ in explicit.run(state, 2e-5):
            pass
        ledger = state.ledger
        assert ledger.error(ledger.initial) < 1e-10
        found.append((state.deleted.sum(), whole(body) * np.array([ledger.elastic, ledger.kinetic, ledger.sink])))
    (failed, energies), (others, expected) = found
    assert failed >= 20 and abs(int(failed) - int(others)) <= 1
    np.testing.assert_allclose(energies, expected, rtol=0.01)


# --- integrators ---
def test_explicit_beside_hht() -> None:
    """Fails if the two integrators part before the body fails, with the axis in it: displacements within 0.1 %."""
    space = box("quad", 6, 0.1).revolved()
    ends_ = []
    for make in ("explicit", "hht"):
        body = pulled(space)
        state, y = body.state, space.X[:, 1]
        state.phase = "event"
        state.v[:] = 2e3 * np.column_stack([-0.5 * np.pi * space.X[:, 0] * np.cos(np.pi * y), np.sin(np.pi * y)])
        state.v[~body.loading.free.reshape(-1, 2)] = 0.0
        integrator = (Explicit(body.body, ExplicitControls(raised_mass=0.0)) if make == "explicit" else
                      HHT(body.body, HHTControls(dt=5e-8, alpha=0.0)))
        integrator.begin(state)
        for _ in integrator.run(state, 1e-5):
            pass
        assert state.ledger.error(state.ledger.initial) < 1e-10
        assert not state.u[space.on_axis, 0].any()
        ends_.append(state.u + (1e-5 - state.time) * state.v)
    assert np.abs(ends_[0] - ends_[1]).max() < 1e-3 * np.abs(ends_[1]).max()


@pytest.mark.parametrize("hht", [False, True])
def test_a_free_body_keeps_its_momentum_along_the_axis(hht: bool) -> None:
    """Fails if what goes around pulls along the axis, or a body in free flight is held by anything but its axis."""
    space = box("quad", 5).revolved()
    momentum, density = Momentum(space, AAA(), "axisymmetric"), DensitySolver(space, SinkLaw(phi=1e3))  # none is lost
    body = held_body(momentum, density, np.ones(space.X.size, bool), np.zeros_like(space.X))
    state = State.intact(space)
    state.phase = "event"
    state.v[:] = [0.0, 3e3] + 2e3 * np.column_stack([space.X[:, 0] * np.cos(3 * space.X[:, 1]), space.X[:, 0] ** 2])
    mass = momentum.lumped_mass(0.0)
    before = float(mass @ state.v[:, 1])
    integrator = HHT(body, HHTControls(dt=2e-7)) if hht else Explicit(body, ExplicitControls(raised_mass=0.0))
    integrator.begin(state)
    for _ in integrator.run(state, 1e-5):
        pass
    pieces = pieces_of(momentum, state)
    assert pieces.momentum[0, 1] == pytest.approx(before, rel=1e-6 if hht else 1e-9)
    assert pieces.momentum[0, 0] == pieces.centre[0, 0] == pieces.angular_momentum[0, 0] == 0.0
    assert pieces.mass[0] == pytest.approx(AAA().rho0 * np.pi, rel=1e-12)
    assert pieces.volume[0] == pytest.approx(np.pi, rel=1e-12) and pieces.extent[0] == pytest.approx(1.0, rel=1e-12)
    assert pieces.translation[0] == pytest.approx(0.5 * before**2 / pieces.mass[0], rel=1e-5)
    assert pieces.kinetic[0] > 1.001 * pieces.translation[0] and not state.u[space.on_axis, 0].any()
