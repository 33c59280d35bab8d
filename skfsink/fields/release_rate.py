"""Energy release rate of a crack: the flux of energy into a domain around its tip, per length that it advances.

With everything weighted by gamma, Psi = gamma W, K = gamma rho0 |v|^2/2, P = gamma P0, rho = gamma rho0, and a weight q
that is 1 around the tip and 0 outside of the domain, the vector

    J_k = int [ -(Psi + K) q,_k + P_iJ u_i,k q,_J + rho (a_i u_i,k - v_i v_i,k) q ] dV

is the mean, over the contours between the two, of the flux of energy through one that moves with the tip, over its
speed (Freund, Dynamic Fracture Mechanics (1990), Sec. 5.2; Nakamura, Shih, Freund, Int. J. Fract. 27 (1985) 229-243),
less what motion inside of it takes up. G = J . d for the direction d of the crack. The derivation with gamma, and what
G has to do with the energy that the sink takes, are in `docs/theory.md`, Sec. 9.

q is linear in the distance r from the tip from 1 at half of the radius to 0 at the radius, and Q1 on the mesh; J is
then the sum of configurational forces (:mod:`.configurational`) with the weights -q at the nodes, and inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..errors import ParameterError, place_text, require
from ..fem.backend import among
from ..fem.graph import node_key
from ..fem.space import Space
from ..material import Material
from .body import Body
from .configurational import PointStress, point_stress
from .crack import CRACKED
from .momentum import Momentum
from .state import State

__all__ = ["RADIUS", "ReleaseRate", "area_vectors", "energy_release_rate", "stress_intensity"]

RADIUS = 6.0      #: default radius of the domain of a crack that has failed elements, in lengths l
PLATEAU = 0.5     #: share of the radius up to which q is 1
SLOPING = 0.05    # share of G that surfaces across the way of the crack may add to a domain
SMALL = 0.02      # strain up to which G is turned into a stress intensity factor


@dataclass(frozen=True)
class ReleaseRate:
    """The energy release rate of a crack at one time.

    Attributes
    ----------
    G: energy release rate [N/mm].
    vector: J, of which G is the component along `direction` [N/mm], (dim,).
    tip, direction: for which it is [mm; 1], (dim,).
    radius: of the domain [mm].
    static: G without its kinetic terms [N/mm].
    strain: greatest principal Green strain, in amount, where gamma > 0.5 and 0 < q < 1.
    thickness: length of the front in the domain [mm]; 1 in 2D, where energies are per mm, and 2 pi R of the tip in a
        body of revolution.
    """

    G: float
    vector: np.ndarray
    tip: np.ndarray
    direction: np.ndarray
    radius: float
    static: float
    strain: float
    thickness: float = 1.0


class _Domain(NamedTuple):
    """Elements of a domain, and the weight q at their nodes (m, na).

    `around` is w q/R at their Gauss points, (m, nq): an advance along r makes rings longer. It is 0 of other bodies.
    """

    elements: np.ndarray
    q: np.ndarray
    thickness: float
    around: np.ndarray


def energy_release_rate(body: Body, state: State, tip: np.ndarray, direction: np.ndarray, radius: float, *,
                        front: np.ndarray | None = None) -> ReleaseRate:
    """Energy release rate of the crack whose tip is at `tip`, for an advance along `direction`; both undeformed.

    Of the state at rest this is the J-integral of finite strain, also of a notch or a slit in the mesh. Of a body that
    is cut in half by a plane of symmetry along the crack it is half of that of the whole.

    Parameters
    ----------
    body, state: what is cracked; the state's displacement, velocity, acceleration and density are used.
    tip: of the crack [mm], (dim,).
    direction: in which it advances, (dim,), of any length.
    radius: of the domain [mm]: G does not depend on it where all that fails is nearer than half of it; 6 l and more.
    front: in 3D, direction of the crack's front, (3,); the domain is a cylinder about it, through the sheet.

    Returns
    -------
    The rate, per length of front.

    Raises
    ------
    ParameterError
        The domain has too few elements, or is not one in which energy comes from outside alone: it meets the boundary
        across the way of the crack, a dead load, a grip that deforms, other materials, fibres that turn, failed
        elements ahead of the crack, or the body is viscous or has lips that press on each other.
    """
    momentum, space = body.momentum, body.space
    tip, direction, front = _place(space, tip, direction, front)
    require("radius", radius, "mm", low=0, low_open=True)
    domain = _domain(space, tip, front, radius)
    at = f"the domain of {radius:.4g} mm around the tip at {place_text(tip)} mm"
    _check_forces(momentum, state, domain, at)
    elements = domain.elements
    gamma = momentum.effective(state.gamma, state.deleted, elements)
    w, dN = space.w[elements], space.slopes(elements)
    stress = point_stress(momentum, state.u, elements, gamma, dN)
    dq = (domain.q[:, None, None] @ dN)[..., 0, :]
    dq *= w[..., None]
    static = -np.einsum("eqKJ,eqJ->K", stress.tensor, dq) / domain.thickness
    static[0] -= float(np.einsum("eq,eq->", stress.around, domain.around)) / domain.thickness
    rho = gamma * (momentum.rho0[elements] if isinstance(momentum.rho0, np.ndarray) else momentum.rho0)
    kinetic, inertia = _inertia(space, state, domain, (dN, stress.H), rho)
    vector = static + (inertia - np.einsum("eq,eqK->K", kinetic, dq)) / domain.thickness
    vector[0] -= float(np.einsum("eq,eq->", kinetic, domain.around)) / domain.thickness
    if not np.isfinite(vector).all():
        raise ParameterError(f"{at} has an energy release rate that is no number: the displacements there are none")
    G = float(vector @ direction)
    density = ((stress.energy + kinetic) * w).sum(axis=1) / w.sum(axis=1)
    _check_surroundings(body, state, domain, density, (tip, direction), G, at)
    return ReleaseRate(G, vector, tip, direction, radius, float(static @ direction),
                       _strain(stress, gamma, domain), domain.thickness)


def stress_intensity(rate: ReleaseRate, material: Material, *, plane_stress: bool = False) -> float:
    """Stress intensity factor K_I [MPa mm^(1/2)] of a crack in mode I, from its energy release rate.

    K_I = sqrt(E' G), with E' = E in plane stress and E/(1 - nu^2) in plane strain (Irwin 1957); E and nu are those of
    the undeformed `material`. A part in mode II or III would count as mode I.

    Raises
    ------
    ParameterError
        Strains in the domain of `rate` exceed 0.02, so that the response is not linear there, or G is negative.
    """
    if rate.strain > SMALL:
        raise ParameterError(f"a stress intensity factor needs strains up to {SMALL:g} in the domain of the energy "
                             f"release rate; got {rate.strain:.3g}: use G itself, or load less")
    require("G", rate.G, "N/mm: a crack that would close has no stress intensity factor", low=0)
    k, mu = material.bulk_modulus, material.shear_modulus
    young, nu = 9 * k * mu / (3 * k + mu), (3 * k - 2 * mu) / (6 * k + 2 * mu)
    return float(np.sqrt((young if plane_stress else young / (1 - nu**2)) * rate.G))


# --- the domain ---
def _place(space: Space, tip: np.ndarray, direction: np.ndarray,
           front: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Tip, unit direction, unit front, checked."""
    if (front is not None) != (space.dim == 3):
        raise ParameterError("front, the direction of the crack's front, must be given of a body in space, and of no "
                             "other")
    found = []
    for name, given in (("tip", tip), ("direction", direction), ("front", front)):
        if given is None:
            continue
        value = np.asarray(given, float)
        if value.shape != (space.dim,) or not np.isfinite(value).all():
            raise ParameterError(f"{name} must be {space.dim} finite numbers; got {given!r:.80}")
        if name != "tip":
            length = float(np.linalg.norm(value))
            if length == 0.0:
                raise ParameterError(f"{name} must not be zero")
            value = value / length
        found.append(value)
    if front is not None and abs(found[1] @ found[2]) > 0.02:
        raise ParameterError(f"direction must be at right angles to front; the cosine between them is "
                             f"{found[1] @ found[2]:.3g}")
    return found[0], found[1], found[2] if front is not None else None


def _domain(space: Space, tip: np.ndarray, front: np.ndarray | None, radius: float) -> _Domain:
    """The elements where q is not 0: around the tip, in 3D about the front, as far as they hang together."""
    away, thickness = space.X - tip, 1.0
    if front is not None:
        along = away @ front
        away = away - along[:, None] * front
    r = np.sqrt(np.einsum("ni,ni->n", away, away))
    q = np.clip((1 - r / radius) / (1 - PLATEAU), 0.0, 1.0)
    if front is not None:
        inside = np.flatnonzero(q > 0)
        if inside.size:  # a tube has another wall behind
            _, label = connected_components(space.graph[inside][:, inside], directed=False)
            nearest = label[np.argmin(np.linalg.norm(space.X[inside] - tip, axis=1))]
            q[inside[label != nearest]] = 0.0
            near = along[(q > 0) & (r <= max(r[q > 0].min(initial=np.inf) * 1.01, 0.25 * radius))]
            thickness = float(np.ptp(near)) if near.size else 0.0
    elements = np.flatnonzero(np.logical_or.reduce([(q > 0)[nodes] for nodes in space.conn.T]))
    at_nodes = q[space.conn[elements]]
    whole = (at_nodes == 1).all(axis=1).sum()
    if whole < 4 or thickness <= 0.0:
        raise ParameterError(f"the domain of {radius:.4g} mm around the tip at {place_text(tip)} mm has {int(whole)} "
                             f"elements within half of the radius, and needs 4: give a greater radius, or a tip in "
                             f"the body")
    around = np.zeros((elements.size, space.N.shape[0]))
    if space.axisymmetric:
        if (q[space.on_axis] > 0).any():
            raise ParameterError(f"the domain of {radius:.4g} mm around the tip at {place_text(tip)} mm reaches the "
                                 f"axis of revolution: give a smaller radius")
        thickness = 2.0 * np.pi * float(tip[0])
        around = space.w[elements] * np.einsum("ea,eqa->eq", at_nodes, space.around[elements])
    return _Domain(elements, at_nodes, thickness, around)


def _inertia(space: Space, state: State, domain: _Domain, gradients: tuple[np.ndarray, np.ndarray],
             rho: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """gamma-weighted kinetic energy at the Gauss points (m, nq) [MPa], and int rho (a u,_k - v v,_k) q (dim,).

    `gradients` are those of the shape functions and Grad u there.
    |v|^2/2 is interpolated from its values at the nodes, as the lumped mass has it, and the sink that takes it: across
    an element that fails the velocities of the two lips are opposite.
    """
    nodes, (dN, H) = space.conn[domain.elements], gradients
    v, a = state.v[nodes], state.a[nodes]
    if not (v.any() or a.any()):
        return np.zeros_like(rho), np.zeros(space.dim)
    half = 0.5 * np.einsum("eai,eai->ea", v, v)
    push = np.einsum("eqi,eqiK->eqK", space.N @ a, H)
    push -= (half[:, None, None] @ dN)[..., 0, :]
    weight = space.w[domain.elements] * rho * (domain.q @ space.N.T)
    return rho * (half @ space.N.T), np.einsum("eq,eqK->K", weight, push)


def _strain(stress: PointStress, gamma: np.ndarray, domain: _Domain) -> float:
    """Greatest principal Green strain, in amount, of the points that bear, in the elements where q changes."""
    bears = (gamma > 0.5) & np.any(domain.q < 1, axis=1, keepdims=True)
    H = stress.H[bears]
    if not H.size:
        return 0.0
    if H.shape[-1] == 3:
        E = 0.5 * (H + np.swapaxes(H, -1, -2) + np.swapaxes(H, -1, -2) @ H)
        return float(np.abs(np.linalg.eigvalsh(E)).max())
    around, (ux, uy, vx, vy) = stress.strain[bears], H.reshape(-1, 4).T
    one, other = ux + 0.5 * (ux * ux + vx * vx), vy + 0.5 * (uy * uy + vy * vy)
    in_plane = (0.5 * np.abs(one + other) + 0.5 * np.hypot(one - other, uy + vx + ux * uy + vx * vy)).max()
    return float(max(in_plane, np.abs(around + 0.5 * around**2).max()))


# --- what a domain must not have ---
def _check_forces(momentum: Momentum, state: State, domain: _Domain, at: str) -> None:
    """Refuse a domain with forces in it that are not of the elastic body, or a body that is not homogeneous there."""
    if momentum.is_viscous and state.v.any():
        raise ParameterError("a viscous body that moves has no energy release rate: what viscosity takes on the way to "
                             "the tip makes it depend on the domain")
    if momentum.pressed > 0.0:
        raise ParameterError("an energy release rate knows no contact, and lips of the crack press on each other: take "
                             "a state in which the crack is open")
    elements = domain.elements
    dead, followers, inside = momentum.dead, momentum.followers, momentum.space.conn[elements][domain.q > 0]
    if dead is not None and np.isin(dead.nodes[np.any(dead.values != 0, axis=1)], inside).any():
        raise ParameterError(f"{at} has a dead load in it, which feeds in energy there: give a smaller radius")
    if followers is not None and followers.pressures(state.u).any() and np.isin(followers.nodes, inside).any():
        raise ParameterError(f"{at} has a pressure in it, which feeds in energy there: give a smaller radius, or a "
                             f"pressure that is not in_crack")
    for part, _, own in among(momentum.parts, elements):
        if part.fibres is not None and part.fibres.size and np.ptp(part.fibres[own], axis=0).max() > 1e-6:
            raise ParameterError(f"{at} has fibres that turn, so that the body is not homogeneous along the crack: no "
                                 f"energy release rate is defined")


def _check_surroundings(body: Body, state: State, domain: _Domain, density: np.ndarray,
                        crack: tuple[np.ndarray, np.ndarray], G: float, at: str) -> None:
    """Refuse a domain whose surfaces, or faces between materials, give it energy when it advances."""
    (tip, direction), space = crack, body.space
    nodes = space.conn[domain.elements]
    ahead = (space.X[nodes] - tip) @ direction > 0
    ring = (domain.q > 0) & (domain.q < 1)
    if (ring & ahead & (state.gamma[nodes] < CRACKED)).any():
        raise ParameterError(f"{at} has failed elements ahead of the crack that reach out of its half: give a greater "
                             f"radius, or the tip that is farthest")
    scale = max(abs(G), 1e-300)

    def across(rows: np.ndarray, outer: np.ndarray, free: bool) -> tuple[float, np.ndarray]:
        """What the faces `outer` of elements `rows` give, and their nodes; the root of a notch is inside if `free`."""
        owner, face = np.nonzero(outer)
        owner, corners = rows[owner], space.face_corners[face]
        faces, q = nodes[owner[:, None], corners], domain.q[owner[:, None], corners]
        lean = area_vectors(space.X[faces], space.X[nodes[owner]].mean(axis=1)) @ direction
        if space.axisymmetric:
            lean = lean * 2.0 * np.pi * space.X[faces, 0].mean(axis=1)
        inside = (q == 1).all(axis=1) & (lean <= 0) & free
        energy = density[owner] * np.abs(lean) * q.mean(axis=1) * ~inside
        return float(energy.sum()) / domain.thickness, faces[(q > 0).any(axis=1)]

    whole, outer = np.arange(len(nodes)), space.outer_faces[domain.elements]
    sloping, faces = across(whole, outer, free=True)
    if sloping > SLOPING * scale:
        raise ParameterError(f"{at} has surfaces of the body across the way of the crack, which change its energy "
                             f"release rate by up to {sloping / scale:.2g} of it (above {SLOPING:g}): give a smaller "
                             f"radius")
    _check_grips(body, state, faces, direction, at)
    parts = _different(body.momentum, domain.elements)
    if len(parts) > 1:
        between = sum(across(rows, _outer(space, domain.elements[rows]), free=False)[0] for rows in parts)
        between -= across(whole, outer, free=False)[0]
        if between > SLOPING * scale:
            raise ParameterError(f"{at} has faces between materials across the way of the crack, which change its "
                                 f"energy release rate by up to {between / scale:.2g} of it (above {SLOPING:g}): give "
                                 f"a smaller radius")


def _different(momentum: Momentum, elements: np.ndarray) -> list[np.ndarray]:
    """The numbers of elements (m,) among the m by their stored energies; regions may differ in the sink alone."""
    found: list[tuple[Material, list[np.ndarray]]] = []
    for part, rows, _ in among(momentum.parts, elements):
        for material, members in found:
            if material == part.material:
                members.append(rows)
                break
        else:
            found.append((part.material, [rows]))
    return [np.concatenate(members) for _, members in found]


def _check_grips(body: Body, state: State, faces: np.ndarray, direction: np.ndarray, at: str) -> None:
    """Refuse faces (f, nodes) that are held and whose displacement changes along the crack."""
    held = ~body.free.reshape(state.u.shape)[faces].any(axis=1)
    faces, held = faces[held.any(axis=1)], held[held.any(axis=1)]
    if not len(faces):
        return
    spread, length = np.ptp(state.u[faces], axis=1) * held, np.ptp(body.space.X[faces], axis=1)
    along = np.ptp(body.space.X[faces] @ direction, axis=1) > 1e-6 * length.max()
    if (spread[along] > 1e-6 * np.abs(state.u).max()).any():
        raise ParameterError(f"{at} has a grip in it that is deformed along the crack, and feeds in energy there: give "
                             f"a smaller radius")


def _outer(space: Space, elements: np.ndarray) -> np.ndarray:
    """Mask (m, 2 dim) of the faces of `elements` (m,) that belong to one of them only."""
    faces = np.stack([node_key(space.conn[elements][:, corners], space.n_nodes) for corners in space.face_corners],
                     axis=1)
    _, index, count = np.unique(faces, return_inverse=True, return_counts=True)
    mask: np.ndarray = (count == 1)[index].reshape(faces.shape)
    return mask


def area_vectors(X: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Outward area vectors (f, dim) of faces with the corners X (f, 2 or 4, dim), of elements around `inside`."""
    if X.shape[-1] == 2:
        edge = X[:, 1] - X[:, 0]
        area = np.column_stack([edge[:, 1], -edge[:, 0]])
    else:
        area = 0.5 * np.cross(X[:, 3] - X[:, 0], X[:, 2] - X[:, 1])
    outward = np.einsum("fi,fi->f", area, X.mean(axis=1) - inside)
    return np.asarray(area * np.sign(outward)[:, None])
