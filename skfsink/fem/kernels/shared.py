"""The loops over tiles, shared by threads: each takes a run of neighbouring tiles, and no result depends on how many.

What a loop is shared as has the same arguments, and one more with an entry for each share: what a share returns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...system.jit import njit, prange
from .force2d import force_2d
from .force3d import force_3d
from .general import force_general_2d, force_general_3d
from .general_sheet import force_general_sheet
from .lanes import FAST
from .plane_stress import force_plane_stress
from .records import share
from .viscous import viscous_2d, viscous_3d
from .volumetric import volumetric_2d, volumetric_3d

__all__ = ["FORCES", "GENERAL_FORCES", "VISCOUS", "VOLUMETRIC"]

Loops = tuple[Callable[..., float], Callable[..., None]]   #: for one thread, and for several


def _force(loop: Any) -> Loops:
    """A force loop, and the same shared.

    The body is compiled anew into the shared loop: a cached one would be called as it is, not built in, and the sums in
    it, which the compiler may reorder, would depend on what the cache held.
    """
    body = njit(fastmath=FAST)(loop.py_func)

    @njit(cache=True, parallel=True)
    def shared(address, constants, volumetric, x, elements, returned):  # type: ignore[no-untyped-def]
        shares = returned.size
        for s in prange(shares):
            returned[s] = body(address, constants, volumetric, x, share(elements, s, shares))

    return loop, shared


def _indicator(loop: Any) -> Loops:
    """A loop for the highest frequency, and the same shared."""
    body = njit(fastmath=FAST)(loop.py_func)

    @njit(cache=True, parallel=True)
    def shared(x, elements, inverse_mass, returned):  # type: ignore[no-untyped-def]
        shares = returned.size
        for s in prange(shares):
            returned[s] = body(x, share(elements, s, shares), inverse_mass)

    return loop, shared


def _viscous(loop: Any) -> Loops:
    """A loop for the viscous force, and the same shared."""
    body = njit(fastmath=FAST)(loop.py_func)

    @njit(cache=True, parallel=True)
    def shared(viscous, x, v, elements, returned):  # type: ignore[no-untyped-def]
        shares = returned.size
        for s in prange(shares):
            returned[s] = body(viscous, x, v, share(elements, s, shares))

    return loop, shared


#: by dimension; 0 is plane stress
FORCES = {2: _force(force_2d), 3: _force(force_3d), 0: _force(force_plane_stress)}
#: of laws of several invariants, in the same way
GENERAL_FORCES = {2: _force(force_general_2d), 3: _force(force_general_3d), 0: _force(force_general_sheet)}
VOLUMETRIC = {2: _indicator(volumetric_2d), 3: _indicator(volumetric_3d)}
VISCOUS = {2: _viscous(viscous_2d), 3: _viscous(viscous_3d)}
