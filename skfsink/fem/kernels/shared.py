"""The loops over tiles, shared by threads: each takes a run of neighbouring tiles, and no result depends on how many.

`least` and `greatest` have an entry for each share; what a share returns is left there.
"""

from __future__ import annotations

from ...system.jit import njit, prange
from .force2d import force_2d
from .force3d import force_3d
from .general import force_general_2d, force_general_3d
from .plane_stress import force_plane_stress
from .volumetric import volumetric_2d, volumetric_3d

__all__ = ["FORCES", "GENERAL_FORCES", "VOLUMETRIC"]


@njit(cache=True, parallel=True)
def _force_2d(law, constants, k_bulk, conn, x, geometry, gamma, j_bar, force, W, psi, least):  # type: ignore[no-untyped-def]
    n, shares = conn.shape[0], least.size
    for s in prange(shares):
        a, b = n * s // shares, n * (s + 1) // shares
        least[s] = force_2d(law, constants, k_bulk, conn[a:b], x, geometry[a:b], gamma[a:b], j_bar, force[a:b],
                            W[a:b], psi[a:b])


@njit(cache=True, parallel=True)
def _force_3d(law, constants, k_bulk, conn, x, geometry, gamma, j_bar, force, W, psi, least):  # type: ignore[no-untyped-def]
    n, shares = conn.shape[0], least.size
    for s in prange(shares):
        a, b = n * s // shares, n * (s + 1) // shares
        least[s] = force_3d(law, constants, k_bulk, conn[a:b], x, geometry[a:b], gamma[a:b], j_bar, force[a:b],
                            W[a:b], psi[a:b])


@njit(cache=True, parallel=True)
def _force_plane_stress(law, constants, k_bulk, conn, x, geometry, gamma, j_bar,  # type: ignore[no-untyped-def]
                        force, W, psi, least):
    n, shares = conn.shape[0], least.size
    for s in prange(shares):
        a, b = n * s // shares, n * (s + 1) // shares
        least[s] = force_plane_stress(law, constants, k_bulk, conn[a:b], x, geometry[a:b], gamma[a:b], j_bar,
                                      force[a:b], W[a:b], psi[a:b])


@njit(cache=True, parallel=True)
def _force_general_2d(law, constants, k_bulk, conn, x, geometry, gamma, fibres,  # type: ignore[no-untyped-def]
                      j_bar, force, W, psi, least):
    n, shares = conn.shape[0], least.size
    for s in prange(shares):
        a, b = n * s // shares, n * (s + 1) // shares
        least[s] = force_general_2d(law, constants, k_bulk, conn[a:b], x, geometry[a:b], gamma[a:b], fibres[a:b],
                                    j_bar, force[a:b], W[a:b], psi[a:b])


@njit(cache=True, parallel=True)
def _force_general_3d(law, constants, k_bulk, conn, x, geometry, gamma, fibres,  # type: ignore[no-untyped-def]
                      j_bar, force, W, psi, least):
    n, shares = conn.shape[0], least.size
    for s in prange(shares):
        a, b = n * s // shares, n * (s + 1) // shares
        least[s] = force_general_3d(law, constants, k_bulk, conn[a:b], x, geometry[a:b], gamma[a:b], fibres[a:b],
                                    j_bar, force[a:b], W[a:b], psi[a:b])


@njit(cache=True, parallel=True)
def _volumetric_2d(conn, x, geometry, gamma, inverse_mass, greatest):  # type: ignore[no-untyped-def]
    n, shares = conn.shape[0], greatest.size
    for s in prange(shares):
        a, b = n * s // shares, n * (s + 1) // shares
        greatest[s] = volumetric_2d(conn[a:b], x, geometry[a:b], gamma[a:b], inverse_mass)


@njit(cache=True, parallel=True)
def _volumetric_3d(conn, x, geometry, gamma, inverse_mass, greatest):  # type: ignore[no-untyped-def]
    n, shares = conn.shape[0], greatest.size
    for s in prange(shares):
        a, b = n * s // shares, n * (s + 1) // shares
        greatest[s] = volumetric_3d(conn[a:b], x, geometry[a:b], gamma[a:b], inverse_mass)


#: the loop of one thread, and the one shared by several, by dimension; 0 is plane stress
FORCES = {2: (force_2d, _force_2d), 3: (force_3d, _force_3d), 0: (force_plane_stress, _force_plane_stress)}
#: the same for laws of several invariants, with the directions of the fibres as an argument more
GENERAL_FORCES = {2: (force_general_2d, _force_general_2d), 3: (force_general_3d, _force_general_3d)}
VOLUMETRIC = {2: (volumetric_2d, _volumetric_2d), 3: (volumetric_3d, _volumetric_3d)}
